# SPDX-License-Identifier: BSD-3-Clause
"""A method that generates grasps: antipodal pairs of contacts on what a depth camera sees of an object."""
