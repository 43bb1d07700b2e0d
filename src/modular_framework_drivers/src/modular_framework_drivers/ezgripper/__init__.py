# SPDX-License-Identifier: BSD-3-Clause
"""Driver of the SAKE EZGripper over a serial line of Dynamixel servos."""
