# SPDX-License-Identifier: BSD-3-Clause
"""Reads SRDF, the semantic description of a robot, independently of the URDF."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from modular_framework_urdf import xml_text
from modular_framework_urdf.xml_text import Element, XmlError

MemberKind = Literal["joint", "link", "chain", "group"]
VARIABLES = {  # variables of virtual joints by type, in MoveIt's order [m, rad, quaternion]
    "planar": ("x", "y", "theta"),
    "floating": ("trans_x", "trans_y", "trans_z", "rot_x", "rot_y", "rot_z", "rot_w"),
}


@dataclass(frozen=True, slots=True)
class GroupMember:
    """A member of a <group>: a joint, link or group by name, or a chain by base and tip link."""

    kind: MemberKind
    name: str = ""
    base_link: str = ""
    tip_link: str = ""


@dataclass(frozen=True, slots=True)
class GroupSpec:
    """A <group> with its members in file order."""

    name: str
    members: tuple[GroupMember, ...] = ()

    def _names(self, kind: MemberKind) -> tuple[str, ...]:
        return tuple(member.name for member in self.members if member.kind == kind)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joint members."""
        return self._names("joint")

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the link members, each of which includes its parent joint."""
        return self._names("link")

    @property
    def subgroups(self) -> tuple[str, ...]:
        """Names of the subgroups."""
        return self._names("group")

    @property
    def chains(self) -> tuple[tuple[str, str], ...]:
        """Base and tip link of each chain."""
        return tuple((member.base_link, member.tip_link) for member in self.members if member.kind == "chain")


@dataclass(frozen=True, slots=True)
class EndEffector:
    """An end-effector group fixed to a parent link."""

    name: str
    group: str
    parent_link: str
    parent_group: str


@dataclass(frozen=True, slots=True)
class VirtualJoint:
    """Connection of the robot's root to the world."""

    name: str
    kind: str
    parent_frame: str
    child_link: str

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the variables as used by clients, "joint/variable"; empty for a fixed joint."""
        return tuple(f"{self.name}/{variable}" for variable in VARIABLES.get(self.kind, ()))


@dataclass(frozen=True, slots=True)
class SemanticDescription:
    """Content of an SRDF.

    Attributes:
        robot_name: Name of the robot.
        groups: Planning groups by name.
        group_states: Named states, {group: {state: {joint: position}}} [rad or m]. A planar or floating virtual joint
            is represented by its variables, "joint/variable".
        end_effectors: End effectors.
        virtual_joints: Virtual joints.
        passive_joints: Names of the passive joints.
        touching_links: Links that may touch any other link by default (<disable_default_collisions>).
        enabled_pairs: Pairs that are checked despite ``touching_links`` (<enable_collisions>).
        disabled_pairs: Pairs that may touch, with their reasons (<disable_collisions>).
    """

    robot_name: str
    groups: Mapping[str, GroupSpec] = field(default_factory=dict)
    group_states: Mapping[str, Mapping[str, Mapping[str, float]]] = field(default_factory=dict)
    end_effectors: tuple[EndEffector, ...] = ()
    virtual_joints: tuple[VirtualJoint, ...] = ()
    passive_joints: frozenset[str] = frozenset()
    touching_links: tuple[str, ...] = ()
    enabled_pairs: frozenset[frozenset[str]] = frozenset()
    disabled_pairs: Mapping[frozenset[str], str] = field(default_factory=dict)


def read_srdf(text: str | bytes, location: str = "SRDF") -> SemanticDescription:
    """Reads an SRDF.

    Args:
        text: SRDF text.
        location: Name of the file or parameter, for messages.

    Raises:
        XmlError: The text is not XML or has a DOCTYPE, an attribute is missing, a position is not a number, or the
            number of values of a virtual joint in a group_state is wrong.
    """
    return _Reader(location).read(xml_text.parse(text, location))


class _Reader:
    """Reads one SRDF; `location` is its name in messages."""

    def __init__(self, location: str) -> None:
        self._where = location

    def read(self, root: Element) -> SemanticDescription:
        required_attribute = self._required_attribute
        virtual_joints = tuple(
            VirtualJoint(
                required_attribute(e, "name"),
                required_attribute(e, "type"),
                required_attribute(e, "parent_frame"),
                required_attribute(e, "child_link"),
            )
            for e in root.findall("virtual_joint")
        )
        return SemanticDescription(
            robot_name=root.get("name", ""),
            groups={spec.name: spec for spec in map(self._group, root.findall("group"))},
            group_states=self._group_states(root, {joint.name: joint for joint in virtual_joints}),
            end_effectors=tuple(
                EndEffector(
                    required_attribute(e, "name"),
                    required_attribute(e, "group"),
                    required_attribute(e, "parent_link"),
                    e.get("parent_group", ""),
                )
                for e in root.findall("end_effector")
            ),
            virtual_joints=virtual_joints,
            passive_joints=frozenset(required_attribute(e, "name") for e in root.findall("passive_joint")),
            touching_links=tuple(
                dict.fromkeys(required_attribute(e, "link").strip() for e in root.findall("disable_default_collisions"))
            ),
            enabled_pairs=frozenset(map(self._pair, root.findall("enable_collisions"))),
            disabled_pairs={self._pair(e): e.get("reason", "") for e in root.findall("disable_collisions")},
        )

    def _required_attribute(self, element: Element, attribute: str) -> str:
        value = element.get(attribute)
        if value is None:
            raise XmlError(
                f"{self._where}:{element.sourceline}",
                f"<{element.tag}> {dict(element.attrib)} has no attribute '{attribute}'",
                "add it",
            )
        return str(value)

    def _group(self, element: Element) -> GroupSpec:
        return GroupSpec(
            self._required_attribute(element, "name"),
            tuple(
                GroupMember(
                    "chain", "", self._required_attribute(item, "base_link"), self._required_attribute(item, "tip_link")
                )
                if item.tag == "chain"
                else GroupMember(item.tag, self._required_attribute(item, "name"))
                for item in element
                if item.tag in ("joint", "link", "chain", "group")
            ),
        )

    def _group_states(
        self, root: Element, virtual_joints: Mapping[str, VirtualJoint]
    ) -> dict[str, dict[str, dict[str, float]]]:
        states: dict[str, dict[str, dict[str, float]]] = {}
        for element in root.findall("group_state"):
            values: dict[str, float] = {}
            for item in element.findall("joint"):
                name, numbers = self._required_attribute(item, "name"), self._positions(item)
                joint = virtual_joints.get(name.strip())
                values |= self._variables(item, joint, numbers) if joint else {name: numbers[0]}
            states.setdefault(self._required_attribute(element, "group"), {})[
                self._required_attribute(element, "name")
            ] = values
        return states

    def _positions(self, element: Element) -> list[float]:
        text = self._required_attribute(element, "value")
        try:
            numbers = [float(word) for word in text.split()]
            numbers[0]
        except (ValueError, IndexError) as error:
            raise XmlError(
                f"{self._where}:{element.sourceline}",
                f"a group_state contains a value that is not a number ('{text}' for joint '{element.get('name')}')",
                "give a position in rad or m",
            ) from error
        return numbers

    def _variables(self, element: Element, joint: VirtualJoint, numbers: list[float]) -> dict[str, float]:
        """Returns the positions of a virtual joint by variable; empty for a fixed joint."""
        names = VARIABLES.get(joint.kind)
        if names is None:
            return {}
        if len(numbers) != len(names):
            raise XmlError(
                f"{self._where}:{element.sourceline}",
                f"a group_state contains {len(numbers)} numbers for the {joint.kind} virtual joint '{joint.name}'",
                f"give {len(names)}, separated by spaces: {' '.join(names)} [m, rad]",
            )
        return dict(zip(joint.variables, numbers, strict=True))

    def _pair(self, element: Element) -> frozenset[str]:
        return frozenset(
            (self._required_attribute(element, "link1").strip(), self._required_attribute(element, "link2").strip())
        )
