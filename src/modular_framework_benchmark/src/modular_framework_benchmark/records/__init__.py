# SPDX-License-Identifier: BSD-3-Clause
"""What the other rooms exchange: the description of an experiment, an episode to run, and what it gave."""
