# SPDX-License-Identifier: BSD-3-Clause
"""A cart with an arm of three joints, joined to the world by a virtual joint, and its forward kinematics on its own."""

from __future__ import annotations

import functools

import numpy as np

from modular_framework_planning.robot_model.robot_model import RobotModel

URDF = """<robot name="cart">
<link name="cart"><collision><origin xyz="0 0 0.1"/><geometry><box size="0.4 0.3 0.2"/></geometry></collision></link>
<joint name="mount" type="fixed"><parent link="cart"/><child link="post"/><origin xyz="0.1 0 0.2"/></joint>
<link name="post"/>
<joint name="pan" type="continuous"><parent link="post"/><child link="turret"/><axis xyz="0 0 1"/>
  <limit velocity="2" effort="1"/></joint>
<link name="turret"/>
<joint name="lift" type="revolute"><parent link="turret"/><child link="upper"/><origin xyz="0 0 0.1"/>
  <axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" velocity="2" effort="1"/></joint>
<link name="upper"><collision><origin xyz="0 0 0.25"/><geometry><box size="0.05 0.05 0.4"/></geometry></collision>
</link>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>
  <limit lower="-2.5" upper="2.5" velocity="2" effort="1"/></joint>
<link name="fore"><collision><origin xyz="0 0 0.2"/><geometry><box size="0.04 0.04 0.3"/></geometry></collision></link>
<joint name="wrist" type="fixed"><parent link="fore"/><child link="tool"/><origin xyz="0 0 0.4"/></joint>
<link name="tool"/></robot>"""
SRDF = """<robot name="cart">
<virtual_joint name="drive" type="{kind}" parent_frame="odom" child_link="cart"/>
<group name="arm"><chain base_link="post" tip_link="tool"/></group>
<group name="base"><joint name="drive"/></group>
<group name="all"><group name="base"/><group name="arm"/></group>
<disable_collisions link1="cart" link2="upper"/><disable_collisions link1="upper" link2="fore"/></robot>"""


@functools.cache
def robot(kind: str) -> RobotModel:
    """The robot with a virtual joint of that type."""
    return RobotModel(URDF, SRDF.format(kind=kind))


def turned(axis: str, angle: float) -> np.ndarray:
    """Homogeneous turn about x, y or z."""
    first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(4)
    matrix[first, first] = matrix[second, second] = np.cos(angle)
    matrix[second, first] = np.sin(angle)
    matrix[first, second] = -np.sin(angle)
    return matrix


def shifted(x: float, y: float, z: float) -> np.ndarray:
    """Homogeneous translation."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def from_quaternion(position: np.ndarray, quaternion_xyzw: np.ndarray) -> np.ndarray:
    """Homogeneous pose, by the sandwich product of quaternions."""
    x, y, z, w = quaternion_xyzw / np.linalg.norm(quaternion_xyzw)
    matrix = shifted(*position)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return matrix


def tool_in_cart(pan: float, lift: float, elbow: float) -> np.ndarray:
    """Where the tool is in the frame of the cart."""
    upper = shifted(0.1, 0, 0.2) @ turned("z", pan) @ shifted(0, 0, 0.1) @ turned("y", lift)
    return upper @ shifted(0, 0, 0.5) @ turned("y", elbow) @ shifted(0, 0, 0.4)
