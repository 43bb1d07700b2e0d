# SPDX-License-Identifier: BSD-3-Clause
"""Constraints on states of the robot."""
