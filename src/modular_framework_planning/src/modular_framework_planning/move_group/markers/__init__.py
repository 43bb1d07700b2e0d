# SPDX-License-Identifier: BSD-3-Clause
"""Show the scene, paths and the octomap in an RViz without MoveIt's plugin."""
