# SPDX-License-Identifier: BSD-3-Clause
"""SAKE EZGripper over a serial line of Dynamixel servos."""
