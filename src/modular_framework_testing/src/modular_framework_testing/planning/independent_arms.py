# SPDX-License-Identifier: BSD-3-Clause
"""Two arms with a forward kinematics that shares no code with the planner.

The UR5's Denavit-Hartenberg lengths and the joint frames of the seven-joint arm, a Franka Panda, are public.
"""

from __future__ import annotations

import math

import numpy as np

UR5_D = (0.089159, 0.0, 0.0, 0.10915, 0.09465, 0.0823)  # [m]
UR5_A = (0.0, -0.425, -0.39225, 0.0, 0.0, 0.0)  # [m]
UR5_ALPHA = (math.pi / 2, 0.0, 0.0, math.pi / 2, -math.pi / 2, 0.0)  # [rad]

_UP, _DOWN = math.pi / 2, -math.pi / 2
SEVEN_JOINTS = (  # position [m] and turn about x [rad] of each joint in the frame of the previous joint, bounds [rad]
    ((0.0, 0.0, 0.333), 0.0, (-2.8973, 2.8973)),
    ((0.0, 0.0, 0.0), _DOWN, (-1.7628, 1.7628)),
    ((0.0, -0.316, 0.0), _UP, (-2.8973, 2.8973)),
    ((0.0825, 0.0, 0.0), _UP, (-3.0718, -0.0698)),
    ((-0.0825, 0.384, 0.0), _DOWN, (-2.8973, 2.8973)),
    ((0.0, 0.0, 0.0), _UP, (-0.0175, 3.7525)),
    ((0.088, 0.0, 0.0), _UP, (-2.8973, 2.8973)),
)
FLANGE = 0.107  # [m] along z of the last joint

_JOINT = """<link name="link{n}"/>
<joint name="joint{n}" type="revolute"><parent link="{parent}"/><child link="link{n}"/>
<origin xyz="{x} {y} {z}" rpy="{turn} 0 0"/><axis xyz="0 0 1"/>
<limit lower="{low}" upper="{high}" velocity="2" effort="10"/></joint>"""
SEVEN_JOINT_URDF = (
    '<robot name="seven"><link name="base"/>'
    + "".join(
        _JOINT.format(
            n=n, parent=f"link{n - 1}" if n > 1 else "base", x=at[0], y=at[1], z=at[2], turn=turn, low=low, high=high
        )
        for n, (at, turn, (low, high)) in enumerate(SEVEN_JOINTS, 1)
    )
    + (
        '<link name="flange"/><joint name="fixed" type="fixed"><parent link="link7"/><child link="flange"/>'
        f'<origin xyz="0 0 {FLANGE}"/></joint></robot>'
    )
)
SEVEN_JOINT_SRDF = """<robot name="seven">
<group name="arm"><chain base_link="base" tip_link="flange"/></group></robot>"""


def _turn(angles: np.ndarray, first: int, second: int) -> np.ndarray:
    """Turns in the plane of two axes, one for each angle: shape (..., 4, 4)."""
    matrices = np.zeros((*np.shape(angles), 4, 4))
    matrices[...] = np.eye(4)
    matrices[..., first, first] = matrices[..., second, second] = np.cos(angles)
    matrices[..., second, first] = np.sin(angles)
    matrices[..., first, second] = -matrices[..., second, first]
    return matrices


def _turn_z(angles: np.ndarray | float) -> np.ndarray:
    return _turn(np.asarray(angles), 0, 1)


def _turn_x(angle: float) -> np.ndarray:
    return _turn(np.asarray(angle), 1, 2)


def _shift(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def ur5_tool(values: np.ndarray) -> np.ndarray:
    """Poses of tool0 in base_link, shape (..., 4, 4), for joint values of shape (..., 6).

    The DH base is turned by half a turn against base_link.
    """
    pose = _turn_z(math.pi)
    for angles, d, a, alpha in zip(np.moveaxis(values, -1, 0), UR5_D, UR5_A, UR5_ALPHA, strict=True):
        pose = pose @ _turn_z(angles) @ (_shift(a, 0.0, d) @ _turn_x(alpha))
    return pose


def seven_joint_flange(values: np.ndarray) -> np.ndarray:
    """Poses of the flange in the base, shape (..., 4, 4), for joint values of shape (..., 7)."""
    pose = np.eye(4)
    for angles, (at, turn, _) in zip(np.moveaxis(values, -1, 0), SEVEN_JOINTS, strict=True):
        pose = pose @ (_shift(*at) @ _turn_x(turn)) @ _turn_z(angles)
    return pose @ _shift(0.0, 0.0, FLANGE)


def pose_gap(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances [m] and angles [rad] between poses of shape (..., 4, 4), exact for small angles."""
    turned = np.swapaxes(first[..., :3, :3], -1, -2) @ second[..., :3, :3]
    axis = np.stack(
        [
            turned[..., 2, 1] - turned[..., 1, 2],
            turned[..., 0, 2] - turned[..., 2, 0],
            turned[..., 1, 0] - turned[..., 0, 1],
        ],
        axis=-1,
    )
    trace = np.trace(turned, axis1=-2, axis2=-1)
    return (
        np.linalg.norm(first[..., :3, 3] - second[..., :3, 3], axis=-1),
        np.arctan2(0.5 * np.linalg.norm(axis, axis=-1), 0.5 * (trace - 1.0)),
    )
