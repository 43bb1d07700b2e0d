# SPDX-License-Identifier: BSD-3-Clause
"""The ROS interface: the names of Gazebo on the wire, and the world in the planning scene."""
