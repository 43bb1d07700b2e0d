# SPDX-License-Identifier: BSD-3-Clause
"""A grasp generator for antipodal contact pairs on the visible surface in a depth camera's point cloud."""
