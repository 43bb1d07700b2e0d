# SPDX-License-Identifier: BSD-3-Clause
"""The kinematic tree of a possibly faulty URDF, and its planning groups."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from modular_framework_core.files.faults import SourceLocation
from modular_framework_urdf.robot import Joint, Link, Robot

LIMIT_TOLERANCE = 1.0e-4
"""Tolerance of position limits, the same as at run time [rad or m]."""


class RobotTree:
    """Links and joints of a URDF by name. A duplicate name refers to the first element.

    Args:
        robot: Content of the URDF.
        file: Name of the URDF in messages.

    Attributes:
        links: Links by name.
        joints: Joints by name.
        parent_joint: Parent joint of each link.
    """

    def __init__(self, robot: Robot, file: str = "robot_description") -> None:
        self.robot, self.file = robot, file
        self.links: dict[str, Link] = {}
        self.joints: dict[str, Joint] = {}
        self.parent_joint: dict[str, Joint] = {}
        for link in robot.links:
            self.links.setdefault(link.name, link)
        for joint in robot.joints:
            self.joints.setdefault(joint.name, joint)
            self.parent_joint.setdefault(joint.child, joint)

    @property
    def roots(self) -> list[str]:
        """Links without a parent joint."""
        return self.robot.root_links()

    def up(self, link: str) -> Iterator[Joint]:
        """Yields the joints from a link up to the root, or to the end of a cycle."""
        seen_links = set()
        while (joint := self.parent_joint.get(link)) is not None and link not in seen_links:
            seen_links.add(link)
            yield joint
            link = joint.parent

    def chain(self, base: str, tip: str) -> tuple[Joint, ...] | None:
        """Returns all joints from base to tip, or None if the tip is not a descendant of the base."""
        joints: list[Joint] = []
        if base == tip:
            return ()
        for joint in self.up(tip):
            joints.append(joint)
            if joint.parent == base:
                return tuple(reversed(joints))
        return None

    def children(self, link: str) -> list[Joint]:
        """Returns the child joints of a link, in file order."""
        return [joint for joint in self.robot.joints if joint.parent == link]

    def location(self, line: int) -> SourceLocation:
        """Returns the location of a line in the URDF."""
        return SourceLocation(self.file, line, 1)


@dataclass(frozen=True, slots=True)
class PlanningGroup:
    """A planning group with its resolved members.

    Attributes:
        name: Name of the group.
        joints: All joints, including fixed joints.
        links: Links of the group, and parent and child links of its joints.
        active: Joints that a planner moves, without fixed, mimic and passive joints.
        location: Location of the group in the SRDF.
        is_whole: Whether all members exist in the URDF.
    """

    name: str
    joints: frozenset[str]
    links: frozenset[str]
    active: tuple[str, ...]
    location: SourceLocation
    is_whole: bool


@dataclass(frozen=True, slots=True)
class Semantics:
    """Names in the SRDF that other files refer to.

    Attributes:
        groups: Planning groups by name.
        states: Names of the named states by group.
        virtual_joints: Names of the virtual joints.
    """

    groups: Mapping[str, PlanningGroup] = field(default_factory=dict)
    states: Mapping[str, frozenset[str]] = field(default_factory=dict)
    virtual_joints: frozenset[str] = frozenset()
