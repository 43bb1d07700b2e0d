# SPDX-License-Identifier: BSD-3-Clause
"""Reads the joints and the tip link of a planning group from URDF and SRDF texts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from modular_framework_urdf.joint_limits import known_limits
from modular_framework_urdf.planning_groups import GroupError, KinematicTree
from modular_framework_urdf.robot import Joint as UrdfJoint
from modular_framework_urdf.srdf_reader import GroupSpec, read_srdf
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError


class RobotModelError(ValueError):
    """A robot description is invalid or lacks the requested group or joint."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """An active joint of a group.

    Attributes:
        name: Name of the joint.
        lower: Lower position limit [rad or m]; minus infinity without a limit.
        upper: Upper position limit [rad or m]; infinity without a limit.
        effort: Effort limit [N m or N]; infinity without a limit.
        velocity: Velocity limit [rad/s or m/s]; infinity without a limit.
        acceleration: Acceleration limit [rad/s^2 or m/s^2]; infinity without a limit.
        is_prismatic: Whether the position is a distance [m] instead of an angle.
    """

    name: str
    lower: float = -math.inf
    upper: float = math.inf
    effort: float = math.inf
    velocity: float = math.inf
    acceleration: float = math.inf
    is_prismatic: bool = False


@dataclass(frozen=True, slots=True)
class Group:
    """A planning group.

    Attributes:
        name: Name of the group.
        joints: Active joints, in the order of the kinematic chain or of the SRDF.
        tip_link: Last link of the chain; "" if the group is not a chain.
        states: Named states, {state: {joint: position [rad or m]}}.
    """

    name: str
    joints: tuple[Joint, ...]
    tip_link: str
    states: dict[str, dict[str, float]]

    def joint(self, name: str) -> Joint:
        """Returns an active joint of the group.

        Raises:
            RobotModelError: The group has no active joint of this name.
        """
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise RobotModelError(
            f"Group '{self.name}' has no active joint '{name}'; it has {[joint.name for joint in self.joints]}."
        )

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the active joints."""
        return tuple(joint.name for joint in self.joints)


def _joint(joint: UrdfJoint, entry: Mapping[str, Any]) -> Joint:
    limit = joint.limit
    try:
        known = known_limits(joint, entry)
    except ValueError as error:
        raise RobotModelError(str(error)) from error
    bounded = limit is not None and joint.kind != "continuous"
    return Joint(
        name=joint.name,
        lower=limit.lower if limit is not None and bounded else -math.inf,
        upper=limit.upper if limit is not None and bounded else math.inf,
        effort=math.inf if limit is None or limit.effort is None else limit.effort,
        velocity=known.velocity,
        acceleration=known.acceleration,
        is_prismatic=joint.kind == "prismatic",
    )


def read_group(urdf: str, srdf: str, name: str, limits: Mapping[str, Any] | None = None) -> Group:
    """Returns a planning group with its subgroups merged.

    Args:
        urdf: URDF text.
        srdf: SRDF text.
        name: Name of the group.
        limits: Entries of joint_limits.yaml by joint, for velocities and accelerations.

    Raises:
        RobotModelError: A description or limit is invalid, the group is unknown, or the group refers to an unknown
            group, joint or link.
    """
    try:
        robot = read_urdf(urdf, "robot_description (URDF)")
        semantics = read_srdf(srdf, "robot_description_semantic (SRDF)")
    except XmlError as error:
        raise RobotModelError(f"{error}. Check the launch file that loads it.") from error
    joints = {joint.name: joint for joint in robot.joints if joint.parent and joint.child}
    tree = KinematicTree({joint.name: (joint.parent, joint.child) for joint in joints.values()})
    try:
        members = [joints[member] for member in tree.group_joints(name, semantics) if member in joints]
    except GroupError as error:
        raise RobotModelError(str(error)) from error
    entries = limits or {}
    active = tuple(
        _joint(joint, entries.get(joint.name) or {}) for joint in members if joint.is_movable and joint.mimic is None
    )
    states = {state: dict(positions) for state, positions in semantics.group_states.get(name, {}).items()}
    return Group(name, active, _tip_link(semantics.groups[name], semantics.groups), states)


def _tip_link(spec: GroupSpec, groups: Mapping[str, GroupSpec]) -> str:
    """Returns the tip of a group's last chain, or of its first subgroup with a chain; "" without a chain."""
    own_tips = [tip for _, tip in reversed(spec.chains)]
    return next(filter(None, own_tips + [_tip_link(groups[name], groups) for name in spec.subgroups]), "")
