# SPDX-License-Identifier: BSD-3-Clause
"""Converts a generator query to a request, and the grasps of an external method to candidates."""

from __future__ import annotations

import numpy as np

from mbf_method.grasp_request import CameraView, GraspRequest, Gripper, RobotState
from mbf_method.grasp_request import SceneObject as RequestObject
from mbf_method.grasps import Grasps
from modular_framework_core.grasp_generation.grasp_candidates import GraspCandidate, GraspQuery
from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_core.grasp_generation.hand_motion_settings import HandMotionSettings
from modular_framework_core.grasp_generation.planning_scene_objects import SceneObject
from modular_framework_core.grasp_generation.solid_meshes import join_meshes


def grasp_request(query: GraspQuery, frame: str, robot: RobotState, camera: CameraView | None = None) -> GraspRequest:
    """Returns the request for the grasps of an object.

    Args:
        query: Object to grasp, obstacles and gripper.
        frame: Planning frame, the frame of all coordinates.
        robot: Joint positions of the robot.
        camera: Camera images of the scene; None if the method needs no images.
    """
    gripper = query.gripper
    return GraspRequest(
        frame=frame,
        target=_request_object(query.target),
        obstacles=tuple(map(_request_object, query.obstacles)),
        support_z=query.support_z,
        gripper=Gripper(
            max_opening=gripper.max_opening,
            pad_width=2 * gripper.pad_half_width,
            pad_height=2 * gripper.pad_half_height,
            fingertip=float((gripper.tips - gripper.pad_centres[:, 2]).max()),
        ),
        robot=robot,
        seed=query.seed,
        camera=camera,
    )


def _request_object(item: SceneObject) -> RequestObject:
    vertices, triangles = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    if item.solids:
        mesh = join_meshes(item.solids)
        vertices, triangles = mesh.vertices, mesh.triangles
    return RequestObject(item.name, item.surface.points, item.surface.normals, vertices, triangles)


def grasp_candidates(grasps: Grasps, gripper: GripperGeometry, settings: HandMotionSettings) -> list[GraspCandidate]:
    """Returns the grasps for which the hand can open wide enough, best first.

    Args:
        grasps: Checked grasps.
        gripper: Geometry of the hand.
        settings: Distances of approach and lift, and clearance of the fingers.
    """
    widest = gripper.max_opening - 2 * settings.min_finger_clearance_m
    order = np.argsort(-grasps.scores, kind="stable")
    return [
        GraspCandidate(
            position=pose[:3, 3] - pose[:3, :3] @ gripper.object_centre(width, opening),
            hand_axes=pose[:3, :3],
            pregrasp_joint=gripper.position_for(opening),
            approach_distance_m=settings.approach_distance_m,
            lift_distance_m=settings.lift_distance_m,
            quality=float(score),
        )
        for pose, width, score in zip(grasps.poses[order], grasps.widths[order], grasps.scores[order], strict=True)
        if width <= widest
        for opening in [min(float(width) + 2 * settings.finger_clearance_m, gripper.max_opening)]
    ]
