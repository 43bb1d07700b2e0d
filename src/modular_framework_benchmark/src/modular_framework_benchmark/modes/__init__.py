# SPDX-License-Identifier: BSD-3-Clause
"""Runs episodes without the simulated task: planning, kinematics or grasps alone."""
