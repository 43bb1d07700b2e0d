# SPDX-License-Identifier: BSD-3-Clause
"""The kinematic tree of a robot description that may be faulty, and the planning groups on it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from modular_framework_core.files.faults import SourceLocation
from modular_framework_urdf.robot import Joint, Link, Robot

END_M = 1.0e-4
"""A position this little beyond a limit counts as the limit, as at run time [rad or m]."""


class RobotTree:
    """Links and joints by name; a name that occurs twice means the first one.

    Attributes:
        file: what to call the description in messages.
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
        """Links that no joint carries."""
        return self.robot.root_links()

    def up(self, link: str) -> Iterator[Joint]:
        """Yields the joints from a link to the root; a loop ends it."""
        seen = set()
        while (joint := self.parent_joint.get(link)) is not None and link not in seen:
            seen.add(link)
            yield joint
            link = joint.parent

    def chain(self, base: str, tip: str) -> tuple[Joint, ...] | None:
        """Returns the joints from base to tip, fixed ones too; None when the tip does not hang below the base."""
        found: list[Joint] = []
        if base == tip:
            return ()
        for joint in self.up(tip):
            found.append(joint)
            if joint.parent == base:
                return tuple(reversed(found))
        return None

    def children(self, link: str) -> list[Joint]:
        """Returns the joints that hang on a link, in the order of the file."""
        return [joint for joint in self.robot.joints if joint.parent == link]

    def location(self, line: int) -> SourceLocation:
        """Returns the location of a line of the description."""
        return SourceLocation(self.file, line, 1)


@dataclass(frozen=True, slots=True)
class PlanningGroup:
    """A group of the SRDF with everything its members stand for.

    Attributes:
        joints: all of them, fixed ones too.
        links: links above or below those joints, and those it names.
        active: joints a planner moves: no fixed, mimic or passive ones.
        location: of the group in the SRDF.
        is_whole: whether the robot has everything the group names.
    """

    name: str
    joints: frozenset[str]
    links: frozenset[str]
    active: tuple[str, ...]
    location: SourceLocation
    is_whole: bool


@dataclass(frozen=True, slots=True)
class Semantics:
    """What the checks of other files need of the SRDF.

    Attributes:
        groups: planning groups by name.
        states: {group: names of its states}.
        virtual_joints: names of the joints that connect the robot to the world.
    """

    groups: Mapping[str, PlanningGroup] = field(default_factory=dict)
    states: Mapping[str, frozenset[str]] = field(default_factory=dict)
    virtual_joints: frozenset[str] = frozenset()
