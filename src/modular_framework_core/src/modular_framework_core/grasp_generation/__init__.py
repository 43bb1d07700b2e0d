# SPDX-License-Identifier: BSD-3-Clause
"""Common parts of grasp generators: scene objects, hand geometry, and the node that stores the grasps of a method."""
