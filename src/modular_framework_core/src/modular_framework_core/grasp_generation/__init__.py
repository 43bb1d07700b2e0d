# SPDX-License-Identifier: BSD-3-Clause
"""What grasp generators share: objects of the scene, geometry of the hand, the node that stores what a method finds."""
