# SPDX-License-Identifier: BSD-3-Clause
"""Connections between ROS nodes: workarounds for the delays and the blocking waits of rospy."""
