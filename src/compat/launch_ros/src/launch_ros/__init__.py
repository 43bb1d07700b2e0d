# SPDX-License-Identifier: BSD-3-Clause
"""ROS nodes in Python launch descriptions, for ROS 1: actions, substitutions and parameter descriptions."""
