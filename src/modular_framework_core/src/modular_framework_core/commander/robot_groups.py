# SPDX-License-Identifier: BSD-3-Clause
"""Reads the joints and the tip link of a planning group from URDF and SRDF texts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from modular_framework_urdf.robot import MOVABLE_KINDS
from modular_framework_urdf.robot import Joint as UrdfJoint
from modular_framework_urdf.srdf_reader import GroupSpec, read_srdf
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError


class RobotModelError(ValueError):
    """A robot description is invalid or lacks the requested group or joint."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """A joint of the robot.

    Attributes:
        name: Name of the joint.
        kind: URDF type.
        parent: Parent link.
        child: Child link.
        lower: Lower position limit [rad or m]; minus infinity without a limit.
        upper: Upper position limit [rad or m]; infinity without a limit.
        effort: Effort limit [N m or N]; infinity without a limit.
        mimics: Leading joint of a mimic joint; "" for an independent joint.
        velocity: Velocity limit [rad/s or m/s]; infinity without a limit.
    """

    name: str
    kind: str
    parent: str
    child: str
    lower: float
    upper: float
    effort: float
    mimics: str
    velocity: float = math.inf

    @property
    def is_active(self) -> bool:
        """Whether the joint is movable and not a mimic joint."""
        return self.kind in MOVABLE_KINDS and not self.mimics


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


def read_joints(urdf: str) -> dict[str, Joint]:
    """Returns the joints of a URDF text by name, in file order.

    Raises:
        RobotModelError: The text is not a URDF.
    """
    try:
        robot = read_urdf(urdf, "robot_description (URDF)")
    except XmlError as error:
        raise _unreadable(error) from error
    return {joint.name: _joint(joint) for joint in robot.joints if joint.parent and joint.child}


def _joint(joint: UrdfJoint) -> Joint:
    limit = joint.limit
    bounded = limit is not None and joint.kind != "continuous"
    return Joint(
        name=joint.name,
        kind=joint.kind,
        parent=joint.parent,
        child=joint.child,
        lower=limit.lower if limit is not None and bounded else -math.inf,
        upper=limit.upper if limit is not None and bounded else math.inf,
        effort=math.inf if limit is None or limit.effort is None else limit.effort,
        mimics=joint.mimic.leader if joint.mimic is not None else "",
        velocity=math.inf if limit is None or limit.velocity is None else limit.velocity,
    )


def read_group(urdf: str, srdf: str, name: str) -> Group:
    """Returns a planning group with its subgroups merged.

    Args:
        urdf: URDF text.
        srdf: SRDF text.
        name: Name of the group.

    Raises:
        RobotModelError: A text is invalid, the group is unknown, or it refers to an unknown group, joint or link.
    """
    joints = read_joints(urdf)
    try:
        semantics = read_srdf(srdf, "robot_description_semantic (SRDF)")
    except XmlError as error:
        raise _unreadable(error) from error
    names, tip = _collect(name, semantics.groups, joints, ())
    active = [joints[joint] for joint in dict.fromkeys(names) if joints[joint].is_active]
    states = {state: dict(positions) for state, positions in semantics.group_states.get(name, {}).items()}
    return Group(name, tuple(active), tip, states)


def _collect(
    name: str, groups: Mapping[str, GroupSpec], joints: dict[str, Joint], parents: tuple[str, ...]
) -> tuple[list[str], str]:
    if name not in groups:
        raise RobotModelError(f"There is no planning group '{name}'; the SRDF has {sorted(groups)}.")
    if name in parents:
        raise RobotModelError(f"Planning group '{name}' contains itself through {list(parents)}.")
    by_child = {joint.child: joint for joint in joints.values()}
    names: list[str] = []
    tip = ""
    for member in groups[name].members:
        match member.kind:
            case "chain":
                tip = member.tip_link
                names += _chain(member.base_link, tip, by_child)
            case "joint":
                if member.name not in joints:
                    raise RobotModelError(
                        f"Planning group '{name}' names the joint '{member.name}', which the URDF lacks."
                    )
                names.append(member.name)
            case "link":
                parent = by_child.get(member.name)
                names += [parent.name] if parent is not None else []
            case "group":
                subgroup_names, subgroup_tip = _collect(member.name, groups, joints, (*parents, name))
                names += subgroup_names
                tip = tip or subgroup_tip
    return names, tip


def _chain(base: str, tip: str, by_child: dict[str, Joint]) -> list[str]:
    names: list[str] = []
    link = tip
    while link != base:
        joint = by_child.get(link)
        if joint is None:
            raise RobotModelError(f"The URDF has no chain of joints from link '{base}' to link '{tip}'.")
        names.append(joint.name)
        link = joint.parent
    return names[::-1]


def _unreadable(error: XmlError) -> RobotModelError:
    return RobotModelError(f"{error}. Check the launch file that loads it.")
