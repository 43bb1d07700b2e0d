# SPDX-License-Identifier: BSD-3-Clause
"""Simulated sensors and their measurements, independent of ROS."""
