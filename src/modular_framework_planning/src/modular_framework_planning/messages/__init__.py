# SPDX-License-Identifier: BSD-3-Clause
"""Where ROS messages meet the planner's own types; nothing below imports a message."""
