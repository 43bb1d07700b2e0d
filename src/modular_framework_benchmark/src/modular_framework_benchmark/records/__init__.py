# SPDX-License-Identifier: BSD-3-Clause
"""Records that the other packages exchange: the description of an experiment, episodes and their results."""
