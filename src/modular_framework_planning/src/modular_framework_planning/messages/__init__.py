# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between ROS messages and the planner's own types; nothing below this package imports a message."""
