# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories of joints: their curves, the check of goals, tolerances, limits, and how a motion is stopped."""
