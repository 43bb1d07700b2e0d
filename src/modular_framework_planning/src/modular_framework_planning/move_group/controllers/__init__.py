# SPDX-License-Identifier: BSD-3-Clause
"""Execution of trajectories by the controllers of a robot."""
