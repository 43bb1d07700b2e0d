# SPDX-License-Identifier: BSD-3-Clause
"""Two arms whose forward kinematics is written down anew here, sharing no code with the planner.

The UR5's Denavit-Hartenberg lengths and the joint frames of the seven-joint arm (those of a Franka Panda) are public.
"""
from __future__ import annotations

import math

import numpy as np

UR5_D = (0.089159, 0.0, 0.0, 0.10915, 0.09465, 0.0823)  # [m]
UR5_A = (0.0, -0.425, -0.39225, 0.0, 0.0, 0.0)  # [m]
UR5_ALPHA = (math.pi / 2, 0.0, 0.0, math.pi / 2, -math.pi / 2, 0.0)  # [rad]

_UP, _DOWN = math.pi / 2, -math.pi / 2
SEVEN_JOINTS = (  # position [m] and turn about x [rad] of each joint in the frame of the one before, bounds [rad]
    ((0.0, 0.0, 0.333), 0.0, (-2.8973, 2.8973)), ((0.0, 0.0, 0.0), _DOWN, (-1.7628, 1.7628)),
    ((0.0, -0.316, 0.0), _UP, (-2.8973, 2.8973)), ((0.0825, 0.0, 0.0), _UP, (-3.0718, -0.0698)),
    ((-0.0825, 0.384, 0.0), _DOWN, (-2.8973, 2.8973)), ((0.0, 0.0, 0.0), _UP, (-0.0175, 3.7525)),
    ((0.088, 0.0, 0.0), _UP, (-2.8973, 2.8973)))
FLANGE = 0.107  # [m] along z of the last joint

_JOINT = """<link name="link{n}"/>
<joint name="joint{n}" type="revolute"><parent link="{parent}"/><child link="link{n}"/>
<origin xyz="{x} {y} {z}" rpy="{turn} 0 0"/><axis xyz="0 0 1"/>
<limit lower="{low}" upper="{high}" velocity="2" effort="10"/></joint>"""
SEVEN_JOINT_URDF = '<robot name="seven"><link name="base"/>' + "".join(
    _JOINT.format(n=n, parent=f"link{n - 1}" if n > 1 else "base", x=at[0], y=at[1], z=at[2], turn=turn, low=low,
                  high=high) for n, (at, turn, (low, high)) in enumerate(SEVEN_JOINTS, 1)) + (
    '<link name="flange"/><joint name="fixed" type="fixed"><parent link="link7"/><child link="flange"/>'
    f'<origin xyz="0 0 {FLANGE}"/></joint></robot>')
SEVEN_JOINT_SRDF = """<robot name="seven">
<group name="arm"><chain base_link="base" tip_link="flange"/></group></robot>"""


def _turn_z(angle: float) -> np.ndarray:
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, -sine, 0, 0], [sine, cosine, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=float)


def _turn_x(angle: float) -> np.ndarray:
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[1, 0, 0, 0], [0, cosine, -sine, 0], [0, sine, cosine, 0], [0, 0, 0, 1]], dtype=float)


def _shift(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def ur5_tool(values: np.ndarray) -> np.ndarray:
    """Pose of tool0 in base_link, shape (4, 4); the DH base is turned by half a turn against base_link."""
    pose = _turn_z(math.pi)
    for angle, d, a, alpha in zip(values, UR5_D, UR5_A, UR5_ALPHA, strict=True):
        pose = pose @ _turn_z(angle) @ _shift(a, 0.0, d) @ _turn_x(alpha)
    return pose


def seven_joint_flange(values: np.ndarray) -> np.ndarray:
    """Pose of the flange in the base, shape (4, 4)."""
    pose = np.eye(4)
    for angle, (at, turn, _) in zip(values, SEVEN_JOINTS, strict=True):
        pose = pose @ _shift(*at) @ _turn_x(turn) @ _turn_z(angle)
    return pose @ _shift(0.0, 0.0, FLANGE)


def pose_gap(first: np.ndarray, second: np.ndarray) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses, exact for small angles."""
    turned = first[:3, :3].T @ second[:3, :3]
    axis = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
    return (float(np.linalg.norm(first[:3, 3] - second[:3, 3])),
            math.atan2(0.5 * float(np.linalg.norm(axis)), 0.5 * (float(np.trace(turned)) - 1.0)))
