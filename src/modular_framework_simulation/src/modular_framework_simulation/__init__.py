# SPDX-License-Identifier: BSD-3-Clause
"""Robot simulation in PyBullet or MuJoCo with the ROS interface of Gazebo."""
