# SPDX-License-Identifier: BSD-3-Clause
"""ROS client helpers that every package of the framework may import."""
