# SPDX-License-Identifier: BSD-3-Clause
"""Points of depth sensors, without the robot and the known objects."""
