# SPDX-License-Identifier: BSD-3-Clause
"""A method that generates grasps: top-down grasps for the objects of the planning scene."""
