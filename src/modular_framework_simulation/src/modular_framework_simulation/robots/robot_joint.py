# SPDX-License-Identifier: BSD-3-Clause
"""Movable joint of a simulated robot."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from modular_framework_urdf.mimics import Mimic
from modular_framework_urdf.rotations import Vector3


@dataclass(frozen=True, slots=True)
class RobotJoint:
    """Movable joint of a robot.

    Attributes:
        name: Name in the description.
        parent_link: Name of the parent link.
        child_link: Name of the child link.
        axis: Axis direction in the frame of the child link.
        lower: Lower limit [rad or m]; a mimic joint's limits include the range given by its leading joint.
        upper: Upper limit [rad or m].
        effort: Maximum effort of the drive [Nm or N]; for a mimic joint, limited by the leading joint's drive.
        velocity: Maximum velocity [rad/s or m/s].
        interfaces: Hardware interfaces for commands; empty for a joint without its own drive.
        mimic: Relation of a mimic joint to its leading joint; None for other joints.
    """

    name: str
    parent_link: str
    child_link: str
    axis: Vector3
    lower: float
    upper: float
    effort: float
    velocity: float
    interfaces: tuple[str, ...]
    mimic: Mimic | None


def gripper_joints(joints: Iterable[RobotJoint], end_effector_joints: Collection[str]) -> tuple[RobotJoint, ...]:
    """Returns the joints of all grippers: mimic joints, their leading joints, and the joints of end effectors.

    Args:
        joints: Movable joints of the robot.
        end_effector_joints: Names of the joints in the groups of end effectors.
    """
    joints = list(joints)
    names = {joint.mimic.leader for joint in joints if joint.mimic is not None} | {*end_effector_joints}
    return tuple(joint for joint in joints if joint.mimic is not None or joint.name in names)
