# SPDX-License-Identifier: BSD-3-Clause
"""A grasp generator: top-down grasps for the objects of the planning scene."""
