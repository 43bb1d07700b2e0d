# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between ROS messages and the planner's own types; packages below import no messages."""
