# SPDX-License-Identifier: BSD-3-Clause
"""The world in the physics engine, and the robot in it behind `RobotHW`."""
