# SPDX-License-Identifier: BSD-3-Clause
"""Records that the other rooms exchange: the description of an experiment, episodes and their results."""
