# SPDX-License-Identifier: BSD-3-Clause
"""Runs episodes of the modes without simulation: planning, kinematics, grasps."""
