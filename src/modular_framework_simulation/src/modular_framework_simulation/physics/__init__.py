# SPDX-License-Identifier: BSD-3-Clause
"""Simulated world in the physics engine, and the robot's `RobotHW`."""
