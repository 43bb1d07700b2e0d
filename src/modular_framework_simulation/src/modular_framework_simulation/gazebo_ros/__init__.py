# SPDX-License-Identifier: BSD-3-Clause
"""ROS interface of the simulation: Gazebo's topics and services, and the world in the planning scene."""
