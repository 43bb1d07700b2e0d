# SPDX-License-Identifier: BSD-3-Clause
"""Markers of the scene, paths and the octomap, for an RViz without MoveIt's plugin."""
