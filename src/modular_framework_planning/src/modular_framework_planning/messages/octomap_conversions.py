# SPDX-License-Identifier: BSD-3-Clause
"""Conversion of the octomap between planning scene messages and scenes."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from octomap_msgs.msg import OctomapWithPose

from modular_framework_planning.errors import GeometryError
from modular_framework_planning.messages.poses import pose_message, transform_from_pose
from modular_framework_planning.octomap.encoding import TREE_TYPE, read_stream, write_full
from modular_framework_planning.octomap.octree import Octree
from modular_framework_planning.octomap.voxel_map import VoxelMap
from modular_framework_planning.planning_scene.planning_scene import PlanningScene

CLEARED = "cleared"  # type of a map without data, which clears the octomap


def with_octomap_of(scene: PlanningScene, message: OctomapWithPose) -> PlanningScene:
    """Returns the scene with the octomap of a message.

    A message with a type but no data clears the octomap; a message with neither changes nothing.

    Raises:
        PlanningError: The tree's type, data, frame or pose is invalid.
    """
    octomap = message.octomap
    if not octomap.data:
        return scene.with_octomap(None) if octomap.id else scene
    if octomap.id != TREE_TYPE:
        raise GeometryError(f"world.octomap: tree of type '{octomap.id}'; the type must be '{TREE_TYPE}'")
    data = np.array(octomap.data, dtype=np.int8).tobytes()
    voxels = read_stream(data, float(octomap.resolution), bool(octomap.binary))
    p, q = message.origin.position, message.origin.orientation
    unset = not any((p.x, p.y, p.z, q.x, q.y, q.z, q.w))
    origin = pin.SE3.Identity() if unset else transform_from_pose(message.origin, "world.octomap origin")
    return scene.with_octomap(Octree(voxels), scene.frame_transform(message.header.frame_id) * origin)


def voxels_of(scene: PlanningScene) -> VoxelMap | None:
    """Returns the voxel map of the scene's octomap, or None."""
    if scene.octomap is None:
        return None
    shape = scene.octomap.shapes[0][0]
    return shape.voxels if isinstance(shape, Octree) else None


def octomap_message(scene: PlanningScene) -> OctomapWithPose:
    """Returns the scene's octomap with probabilities; a scene without octomap gives a message of type CLEARED."""
    message = OctomapWithPose()
    message.header.frame_id = message.octomap.header.frame_id = scene.model.planning_frame
    message.origin.orientation.w = 1.0
    message.octomap.id = CLEARED
    voxels = voxels_of(scene)
    if scene.octomap is not None and voxels is not None:
        message.origin = pose_message(scene.octomap.pose)
        message.octomap.resolution = voxels.resolution
        data = write_full(voxels)
        if data:
            message.octomap.id = TREE_TYPE
            message.octomap.data = np.frombuffer(data, dtype=np.int8).tolist()
    return message
