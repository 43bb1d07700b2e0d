# SPDX-License-Identifier: BSD-3-Clause
"""Inputs of methods for checks without the framework: objects on a table, motions and observations of a planar arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mbf_method.grasp_request import CameraView, GraspRequest, Gripper, RobotState, SceneObject
from mbf_method.observation import GRIPPER_COLUMN, ActionSpec, CameraImages, Observation
from mbf_method.path_request import Obstacle, PathRequest

GRIPPER = Gripper(max_opening=0.1, pad_width=0.02, pad_height=0.03, fingertip=0.02)
TABLE_Z_M = 0.7
SPACING_M = 0.004
"""Distance between neighbouring points of a surface [m]."""
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
TRIANGLES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip
"""Triangles of a box with the vertices `CORNERS`."""
CAMERA_HEIGHT_M = 0.8
IMAGE_HEIGHT, IMAGE_WIDTH, FOCAL_LENGTH = 240, 320, 300.0

ARM_JOINTS = ("joint_1", "joint_2", "joint_3")
LINK_LENGTH_M = 0.3
START, GOAL = (-1.2, 0.3, 0.3), (1.2, -0.3, -0.3)
POLICY_RATE_HZ, HORIZON = 10.0, 8


def grasp_requests(camera: bool = False) -> list[GraspRequest]:
    """Returns requests for boxes of three sizes, turned about the vertical and beside another box.

    Args:
        camera: Whether the requests contain camera images.
    """
    other = _box("other", (0.05, 0.05, 0.05), (0.2, 0.2), 0.0)
    requests = []
    for number, (size, yaw) in enumerate((((0.04, 0.07, 0.1), 0.0), ((0.03, 0.06, 0.04), 0.6), ((0.05,) * 3, 1.2))):
        box = _box(f"box_{number + 1}", size, (0.4, 0.1 - 0.1 * number), yaw)
        view = _view_from_above(box) if camera else None
        requests.append(
            GraspRequest("world", box, (other,), TABLE_Z_M, GRIPPER, RobotState((), np.zeros(0)), number + 1, view)
        )
    return requests


def path_requests() -> list[PathRequest]:
    """Returns requests for a planar arm: a free motion, a motion around a box, and a motion with two goals."""
    free = _arm_request(())
    box = Obstacle(
        "wall", "box", np.array([0.1, 0.1, 0.3]), np.zeros((0, 3)), np.zeros((0, 3), np.int64), _at(0.75, 0.0, 0.0)
    )
    goals = np.array([GOAL, (0.8, -0.9, 0.4)])
    return [free, replace(free, obstacles=(box,), seed=2), replace(free, goals=goals, seed=3)]


def observations() -> list[Observation]:
    """Returns observations of a planar arm with a gripper and a camera in two states."""
    box = _box("box", (0.04, 0.07, 0.1), (0.4, 0.1), 0.0)
    view = _view_from_above(box)
    gripper = ([0.0], [1.0], [np.inf], [np.inf])
    lower, upper, velocity, acceleration = (
        np.append(np.full(3, limit), end) for limit, end in zip((-2.5, 2.5, 2.0, np.inf), gripper)
    )
    names = (*ARM_JOINTS, GRIPPER_COLUMN)
    spec = ActionSpec("positions", names, HORIZON, POLICY_RATE_HZ, lower, upper, velocity, acceleration)
    first = Observation(
        robot=RobotState(ARM_JOINTS, np.array(START)),
        gripper=0.0,
        cameras={"top": CameraImages(view.colour, view.depth)},
        prompt="pick up the box",
        time_s=0.0,
        step=0,
        actions=spec,
        seed=1,
    )
    later = RobotState(ARM_JOINTS, np.zeros(3))
    return [first, replace(first, robot=later, gripper=0.5, time_s=0.8, step=HORIZON)]


def _box(name: str, size: tuple[float, ...], place: tuple[float, float], yaw: float) -> SceneObject:
    """Returns a box on the table, with points on a regular grid of each face."""
    points, normals = [], []
    for axis in range(3):
        first, second = (other for other in range(3) if other != axis)
        grids = np.meshgrid(*(_even(size[other]) for other in (first, second)))
        for side in (-0.5, 0.5):
            face = np.zeros((grids[0].size, 3))
            face[:, axis], face[:, first], face[:, second] = side * size[axis], grids[0].ravel(), grids[1].ravel()
            points.append(face)
            normals.append(np.tile(2 * side * np.eye(3)[axis], (len(face), 1)))
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    centre = np.array([*place, TABLE_Z_M + size[2] / 2])
    return SceneObject(
        name,
        np.concatenate(points) @ turn.T + centre,
        np.concatenate(normals) @ turn.T,
        (CORNERS * size) @ turn.T + centre,
        TRIANGLES,
    )


def _even(length: float) -> np.ndarray:
    return np.linspace(-length / 2, length / 2, int(np.ceil(length / SPACING_M)) + 1)


def _view_from_above(box: SceneObject) -> CameraView:
    """Returns images of the table and the top of a box, from a camera above the box that looks down."""
    middle, top = box.vertices.mean(axis=0), box.vertices[:, 2].max()
    pose = _at(middle[0], middle[1], TABLE_Z_M + CAMERA_HEIGHT_M)
    pose[:3, :3] = np.diag([1.0, -1.0, -1.0])
    matrix = np.array([[FOCAL_LENGTH, 0.0, IMAGE_WIDTH / 2], [0.0, FOCAL_LENGTH, IMAGE_HEIGHT / 2], [0.0, 0.0, 1.0]])
    view = CameraView(
        np.full((IMAGE_HEIGHT, IMAGE_WIDTH), TABLE_Z_M + CAMERA_HEIGHT_M - top), np.zeros(0), matrix, pose
    )
    # a pixel shows the box if its point at the height of the top lies between the sides of the box
    edges = np.array([box.vertices[4] - box.vertices[0], box.vertices[2] - box.vertices[0]])
    offsets = (view.points() - box.vertices[0])[..., :2] @ edges[:, :2].T
    is_box = ((offsets >= 0.0) & (offsets <= (edges[:, :2] ** 2).sum(axis=1))).all(axis=-1)
    depth = np.where(is_box, TABLE_Z_M + CAMERA_HEIGHT_M - top, CAMERA_HEIGHT_M).astype(np.float32)
    colour = np.where(is_box[..., None], [200, 40, 40], [120, 120, 120]).astype(np.uint8)
    return CameraView(depth, colour, matrix, pose)


def _arm_request(obstacles: tuple[Obstacle, ...]) -> PathRequest:
    return PathRequest(
        frame="base",
        group="arm",
        joint_names=ARM_JOINTS,
        lower=np.full(3, -2.5),
        upper=np.full(3, 2.5),
        max_velocity=np.full(3, 2.0),
        max_acceleration=np.full(3, 5.0),
        start=np.array(START),
        goals=np.array([GOAL]),
        robot=RobotState(ARM_JOINTS, np.array(START)),
        obstacles=obstacles,
        allowed_contacts=(("link_1", "link_2"), ("link_2", "link_3")),
        padding=0.0,
        urdf=_arm_urdf(),
        srdf="<robot name='planar_arm'><group name='arm'><chain base_link='base' tip_link='link_3'/></group></robot>",
        planner="",
        parameters={},
        allowed_time_s=5.0,
        seed=1,
    )


def _arm_urdf() -> str:
    text = "<robot name='planar_arm'><link name='base'/>"
    for number in (1, 2, 3):
        parent, x = (f"link_{number - 1}", LINK_LENGTH_M) if number > 1 else ("base", 0.0)
        text += (
            f"<link name='link_{number}'><collision><origin xyz='{LINK_LENGTH_M / 2} 0 0'/>"
            f"<geometry><box size='{LINK_LENGTH_M} 0.04 0.04'/></geometry></collision></link>"
            f"<joint name='joint_{number}' type='revolute'><parent link='{parent}'/><child link='link_{number}'/>"
            f"<origin xyz='{x} 0 0'/><axis xyz='0 0 1'/><limit lower='-2.5' upper='2.5' velocity='2' effort='10'/>"
            "</joint>"
        )
    return text + "</robot>"


def _at(x: float, y: float, z: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose
