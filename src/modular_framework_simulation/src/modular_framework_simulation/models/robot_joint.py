# SPDX-License-Identifier: BSD-3-Clause
"""A movable joint of a robot, as the simulation sees it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from modular_framework_urdf.mimics import Mimic
from modular_framework_urdf.rotations import Vector3


@dataclass(frozen=True, slots=True)
class RobotJoint:
    """A movable joint of the robot.

    Attributes:
        name: As in the description.
        parent_link: The link it is fastened to.
        child_link: The link it moves.
        axis: Direction in the frame of the child link.
        lower: [rad or m]; of a mimic joint no higher than its leader brings it.
        upper: [rad or m]; of a mimic joint no lower than its leader brings it.
        effort: Largest effort of its drive [Nm or N]; of a mimic joint no more than its leader's drive gives it.
        velocity: Largest velocity [rad/s or m/s].
        interfaces: Hardware interfaces it is commanded by; empty for a joint without a drive of its own.
        mimic: The joint it follows, if it follows one.
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


def gripper_joints(joints: Iterable[RobotJoint]) -> list[RobotJoint]:
    """Returns the joints of all grippers: those that mimic, and those they follow."""
    joints = list(joints)
    leaders = {joint.mimic.leader for joint in joints if joint.mimic is not None}
    return [joint for joint in joints if joint.mimic is not None or joint.name in leaders]
