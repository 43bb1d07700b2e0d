# SPDX-License-Identifier: BSD-3-Clause
"""Simulated sensors: what they measure, without ROS."""
