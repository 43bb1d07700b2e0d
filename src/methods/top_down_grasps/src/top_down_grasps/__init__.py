# SPDX-License-Identifier: BSD-3-Clause
"""A grasp generator for top-down grasps of the objects in the planning scene."""
