# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory execution by the controllers of a robot."""
