# SPDX-License-Identifier: BSD-3-Clause
"""Answers which joints and which tip link a planning group has, from the robot's URDF and SRDF texts."""
from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

from modular_framework_urdf import xml_text

MOVING_TYPES = ("revolute", "continuous", "prismatic")


class RobotModelError(ValueError):
    """A robot description lacks what is asked of it; the text says what was found and what is allowed."""


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint of the robot.

    Attributes:
        name: Name of the joint.
        kind: URDF type.
        parent: Link it hangs on.
        child: Link it carries.
        lower: Lowest position [rad or m]; minus infinity without a limit.
        upper: Highest position [rad or m]; infinity without a limit.
        effort: Greatest effort [N m or N]; infinity without a limit.
        mimics: Joint it follows; empty for an independent joint.
        velocity: Greatest velocity [rad/s or m/s]; infinity without a limit.
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
        """True when the joint moves and follows no other."""
        return self.kind in MOVING_TYPES and not self.mimics


@dataclass(frozen=True, slots=True)
class Group:
    """A planning group.

    Attributes:
        name: Name of the group.
        joints: Active joints, in the order of the kinematic chain or of the SRDF.
        tip_link: Last link of the chain; empty when the group is no chain.
        states: Named states: {state: {joint: position}}.
    """

    name: str
    joints: tuple[Joint, ...]
    tip_link: str
    states: dict[str, dict[str, float]]

    def joint(self, name: str) -> Joint:
        """Returns a joint of the group.

        Raises:
            RobotModelError: The group has no such active joint.
        """
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise RobotModelError(f"Group '{self.name}' has no active joint '{name}'; it has "
                              f"{[joint.name for joint in self.joints]}.")

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the active joints."""
        return tuple(joint.name for joint in self.joints)


def read_joints(urdf: str) -> dict[str, Joint]:
    """Reads the joints of a URDF text.

    Returns:
        {name: joint} in file order.

    Raises:
        RobotModelError: The text is no URDF.
    """
    joints: dict[str, Joint] = {}
    for element in _parse(urdf, "robot_description (URDF)").findall("joint"):
        parent, child = element.find("parent"), element.find("child")
        if parent is None or child is None:
            continue
        name, kind = element.get("name", ""), element.get("type", "")
        limit, mimic = element.find("limit"), element.find("mimic")
        bounded = limit is not None and kind != "continuous"
        joints[name] = Joint(
            name, kind, parent.get("link", ""), child.get("link", ""),
            float(limit.get("lower", 0.0)) if limit is not None and bounded else -math.inf,
            float(limit.get("upper", 0.0)) if limit is not None and bounded else math.inf,
            float(limit.get("effort", math.inf)) if limit is not None else math.inf,
            mimic.get("joint", "") if mimic is not None else "",
            float(limit.get("velocity", math.inf)) if limit is not None else math.inf)
    return joints


def read_group(urdf: str, srdf: str, name: str) -> Group:
    """Reads one planning group.

    Args:
        urdf: Text of the robot description.
        srdf: Text of the semantic description.
        name: Name of the group.

    Returns:
        The group with its subgroups merged.

    Raises:
        RobotModelError: A text cannot be read, or there is no such group, or the group names what is not there.
    """
    joints = read_joints(urdf)
    root = _parse(srdf, "robot_description_semantic (SRDF)")
    groups = {element.get("name", ""): element for element in root.findall("group")}
    names, tip = _collect(name, groups, joints, ())
    active = [joints[joint] for joint in dict.fromkeys(names) if joints[joint].is_active]
    states = {state.get("name", ""): {joint.get("name", ""): float(joint.get("value", "nan").split()[0])
                                      for joint in state.findall("joint")}
              for state in root.findall("group_state") if state.get("group") == name}
    return Group(name, tuple(active), tip, states)


def _collect(name: str, groups: dict[str, ElementTree.Element], joints: dict[str, Joint],
             above: tuple[str, ...]) -> tuple[list[str], str]:
    if name not in groups:
        raise RobotModelError(f"There is no planning group '{name}'; the SRDF has {sorted(groups)}.")
    if name in above:
        raise RobotModelError(f"Planning group '{name}' contains itself through {list(above)}.")
    by_child = {joint.child: joint for joint in joints.values()}
    names: list[str] = []
    tip = ""
    for element in groups[name]:
        match element.tag:
            case "chain":
                tip = element.get("tip_link", "")
                names += _chain(element.get("base_link", ""), tip, by_child)
            case "joint":
                joint = element.get("name", "")
                if joint not in joints:
                    raise RobotModelError(f"Planning group '{name}' names the joint '{joint}', which the URDF lacks.")
                names.append(joint)
            case "link":
                parent = by_child.get(element.get("name", ""))
                names += [parent.name] if parent is not None else []
            case "group":
                inner, inner_tip = _collect(element.get("name", ""), groups, joints, (*above, name))
                names += inner
                tip = tip or inner_tip
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


def _parse(text: str, what: str) -> ElementTree.Element:
    try:
        return xml_text.parse(text, what)
    except xml_text.XmlError as error:
        raise RobotModelError(f"{error}. Check the launch file that loads it.") from error
