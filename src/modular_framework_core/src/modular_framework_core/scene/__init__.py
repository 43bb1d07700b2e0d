# SPDX-License-Identifier: BSD-3-Clause
"""The surroundings of the robot: sensor frames, text scenes, objects of the simulation."""
