# SPDX-License-Identifier: BSD-3-Clause
"""A window with a slider for each joint of a robot, and the joint states it publishes."""
