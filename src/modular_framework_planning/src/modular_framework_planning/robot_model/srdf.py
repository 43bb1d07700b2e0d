# SPDX-License-Identifier: BSD-3-Clause
"""Reads the semantic description (SRDF) of a robot into plain records; it knows nothing of the robot's joints."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from modular_framework_planning.errors import ModelError
from modular_framework_urdf import xml_text
from modular_framework_urdf.xml_text import Element


@dataclass(frozen=True, slots=True)
class GroupSpec:
    """What a <group> lists, by the names in the file."""

    name: str
    joints: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    chains: tuple[tuple[str, str], ...] = ()
    subgroups: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class EndEffector:
    """A gripper group fixed to a link of another group."""

    name: str
    group: str
    parent_link: str
    parent_group: str


@dataclass(frozen=True, slots=True)
class VirtualJoint:
    """How the root of the robot is fixed to the world."""

    name: str
    kind: str
    parent_frame: str
    child_link: str


@dataclass(frozen=True, slots=True)
class SemanticDescription:
    """Everything of an SRDF the planner uses.

    Attributes:
        touching_links: links that may touch anything by default (<disable_default_collisions>).
        enabled_pairs: pairs that are checked all the same (<enable_collisions>).
        disabled_pairs: pairs that may touch, and the reason the file gives (<disable_collisions>).
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


def _need(element: Element, attribute: str) -> str:
    value = element.get(attribute)
    if value is None:
        raise ModelError(f"SRDF: <{element.tag}> {dict(element.attrib)} has no attribute '{attribute}'; add it")
    return value


def _group(element: Element) -> GroupSpec:
    return GroupSpec(
        name=_need(element, "name"),
        joints=tuple(_need(item, "name") for item in element.findall("joint")),
        links=tuple(_need(item, "name") for item in element.findall("link")),
        chains=tuple((_need(item, "base_link"), _need(item, "tip_link")) for item in element.findall("chain")),
        subgroups=tuple(_need(item, "name") for item in element.findall("group")),
    )


def _group_states(root: Element) -> dict[str, dict[str, dict[str, float]]]:
    states: dict[str, dict[str, dict[str, float]]] = {}
    for element in root.findall("group_state"):
        values = {_need(item, "name"): float(_need(item, "value").split()[0]) for item in element.findall("joint")}
        states.setdefault(_need(element, "group"), {})[_need(element, "name")] = values
    return states


def _pair(element: Element) -> frozenset[str]:
    return frozenset((_need(element, "link1").strip(), _need(element, "link2").strip()))


def parse_srdf(text: str) -> SemanticDescription:
    """Parses an SRDF document.

    Raises:
        ModelError: the text is not XML, has a DOCTYPE, or an element lacks an attribute.
    """
    try:
        root = xml_text.parse(text, "SRDF")
    except xml_text.XmlError as error:
        raise ModelError(f"{error} (is robot_description_semantic loaded?)") from error
    try:
        states = _group_states(root)
    except ValueError as error:
        raise ModelError(f"SRDF: a group_state holds a value that is not a number ({error})") from error
    return SemanticDescription(
        robot_name=root.get("name", ""),
        groups={spec.name: spec for spec in map(_group, root.findall("group"))},
        group_states=states,
        end_effectors=tuple(
            EndEffector(_need(e, "name"), _need(e, "group"), _need(e, "parent_link"), e.get("parent_group", ""))
            for e in root.findall("end_effector")),
        virtual_joints=tuple(
            VirtualJoint(_need(e, "name"), _need(e, "type"), _need(e, "parent_frame"), _need(e, "child_link"))
            for e in root.findall("virtual_joint")),
        passive_joints=frozenset(_need(e, "name") for e in root.findall("passive_joint")),
        touching_links=tuple(dict.fromkeys(
            _need(e, "link").strip() for e in root.findall("disable_default_collisions"))),
        enabled_pairs=frozenset(map(_pair, root.findall("enable_collisions"))),
        disabled_pairs={_pair(e): e.get("reason", "") for e in root.findall("disable_collisions")},
    )
