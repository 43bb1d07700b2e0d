# SPDX-License-Identifier: BSD-3-Clause
"""Markers of the octomap, cubes coloured by height, for an RViz without MoveIt's plugin."""

from __future__ import annotations

import colorsys

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from modular_framework_planning.messages.poses import pose_message
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.markers.scene_markers import delete_all
from modular_framework_planning.octomap.octree import Octree
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene
from modular_framework_ros.publishing import PicturePublisher

MAX_CUBES = 100_000
SHADES = [ColorRGBA(*colorsys.hsv_to_rgb(hue, 0.8, 0.9), 1.0) for hue in np.linspace(0.7, 0.0, 32)]  # blue to red


class OctomapMarkers:
    """Publishes ~octomap_markers (MarkerArray, latched) when the octomap changes."""

    def __init__(self) -> None:
        self._publisher = PicturePublisher(names.OCTOMAP_MARKERS_TOPIC, MarkerArray)
        self._shown: object = None

    def show(self, scene: PlanningScene) -> None:
        """Publishes at most MAX_CUBES occupied voxels of a scene."""
        if scene.octomap is self._shown:
            return
        self._shown = scene.octomap
        self._publisher.show(lambda: _octomap_markers(scene.octomap, scene.model.planning_frame))


def _octomap_markers(body: CollisionObject | None, frame: str) -> MarkerArray:
    markers = [delete_all(frame)]
    if body is not None:
        markers += [
            _cubes(body, shape, frame) for shape, _ in body.shapes if isinstance(shape, Octree) and len(shape.centers)
        ]
    return MarkerArray(markers)


def _cubes(body: CollisionObject, octree: Octree, frame: str) -> Marker:
    centers = octree.centers[:MAX_CUBES]
    marker = Marker(type=Marker.CUBE_LIST, ns="octomap", action=Marker.ADD, pose=pose_message(body.pose))
    marker.header.frame_id = frame
    marker.scale.x = marker.scale.y = marker.scale.z = octree.resolution
    marker.color.a = 1.0
    low, high = centers[:, 2].min(), centers[:, 2].max()
    shades = ((len(SHADES) - 1) * (centers[:, 2] - low) / max(high - low, 1.0e-9)).astype(int)
    marker.points = [Point(*row) for row in centers.tolist()]
    marker.colors = [SHADES[shade] for shade in shades]
    return marker
