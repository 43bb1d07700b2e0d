# SPDX-License-Identifier: BSD-3-Clause
"""Converts ROS messages to and from plain values."""
