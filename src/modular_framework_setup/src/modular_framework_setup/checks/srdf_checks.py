# SPDX-License-Identifier: BSD-3-Clause
"""Checks the groups, states, end effectors, joints and collision pairs of an SRDF against the robot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_setup.checks.group_checks import GroupChecker
from modular_framework_setup.config_files.robot_tree import LIMIT_TOLERANCE, PlanningGroup, RobotTree, Semantics
from modular_framework_urdf.srdf_reader import VARIABLES
from modular_framework_urdf.xml_text import Element

VIRTUAL_KINDS = ("fixed", "planar", "floating")
ELEMENTS = (
    "group", "group_state", "end_effector", "virtual_joint", "passive_joint", "disable_collisions",
    "enable_collisions", "disable_default_collisions", "link_sphere_approximation", "joint_property",
)  # fmt: skip


def check_srdf(root: Element, where: str, tree: RobotTree, faults: FaultList) -> Semantics:
    """Checks an SRDF and returns its groups, states and virtual joints.

    Args:
        root: Root element of the SRDF.
        where: Path of the SRDF, for messages.
        tree: Kinematic tree of the robot.
        faults: Receives the faults.
    """
    return _SrdfChecker(root, where, tree, faults).check()


class _SrdfChecker:
    """Checks one SRDF."""

    def __init__(self, root: Element, where: str, tree: RobotTree, faults: FaultList) -> None:
        self._root, self._where, self._tree, self._faults = root, where, tree, faults
        self._virtual_kinds = {item.get("name", ""): item.get("type", "") for item in root.findall("virtual_joint")}

    def check(self) -> Semantics:
        self._check_top()
        groups = GroupChecker(self._root, self._where, self._tree, self._faults).check()
        states: dict[str, set[str]] = {}
        for element in self._root.findall("group_state"):
            self._check_state(element, groups, states)
        for element in self._root.findall("end_effector"):
            self._check_end_effector(element, groups)
        virtual = {item.get("name", "") for item in self._root.findall("virtual_joint")}
        for element in self._root.findall("virtual_joint"):
            self._check_virtual_joint(element)
        for tag in ("passive_joint", "joint_property"):
            key = "name" if tag == "passive_joint" else "joint_name"
            for element in self._root.findall(tag):
                self._check_name(element, key, "joint", {**self._tree.joints, **dict.fromkeys(virtual)})
        self._check_pairs()
        return Semantics(groups, {name: frozenset(items) for name, items in states.items()}, frozenset(virtual))

    def _location(self, element: Element) -> SourceLocation:
        return SourceLocation(self._where, element.sourceline, 1)

    def _check_top(self) -> None:
        name, robot = self._root.get("name", ""), self._tree.robot.name
        if name != robot:
            self._faults.add(
                self._location(self._root),
                f"the SRDF is for robot '{name}', but the URDF ({self._tree.file}) describes '{robot}'; both names "
                "must be the same; correct one of them",
            )
        for element in self._root:
            if isinstance(element.tag, str) and element.tag not in ELEMENTS:
                self._faults.add_unknown(self._location(element), "element", element.tag, ELEMENTS)

    def _check_name(self, element: Element, key: str, noun: str, allowed: Iterable[str]) -> bool:
        name = (element.get(key) or "").strip()
        if not name:
            self._faults.add(self._location(element), f"<{element.tag}> has no attribute '{key}'; add it")
            return False
        if name not in allowed:
            self._faults.add_unknown(self._location(element), f"<{element.tag}>: {noun}", name, allowed)
            return False
        return True

    def _check_state(self, element: Element, groups: Mapping[str, PlanningGroup], states: dict[str, set[str]]) -> None:
        name, group_name = element.get("name", ""), element.get("group", "")
        if not name:
            self._faults.add(self._location(element), "a <group_state> has no name; give it one")
        if not self._check_name(element, "group", "group", groups):
            return
        if name in states.setdefault(group_name, set()):
            self._faults.add(
                self._location(element), f"group '{group_name}' has two states '{name}'; rename one of them"
            )
        states[group_name].add(name)
        group, joints = groups[group_name], set()
        for item in element.findall("joint"):
            joints.add(item.get("name", ""))
            self._check_state_joint(item, f"state '{name}' of group '{group_name}'", group)
        missing = [joint for joint in group.active if joint not in joints]
        if missing and group.is_whole:
            self._faults.add(
                self._location(element),
                f"state '{name}' of group '{group_name}' has no value for {', '.join(missing)}; each active joint "
                "of the group needs a value; add it",
            )

    def _check_state_joint(self, item: Element, owner: str, group: PlanningGroup) -> None:
        name = item.get("name", "")
        if name not in group.joints:
            label = f"{owner}: joint '{name}'"
            if name in self._tree.joints and not group.is_whole:
                return
            if name in self._tree.joints:
                allowed = ", ".join(group.active)
                self._faults.add(self._location(item), f"{label} is not in the group; allowed: {allowed}; remove it")
            else:
                self._faults.add_unknown(self._location(item), f"{owner}: joint", name, group.active)
            return
        try:
            values = [float(word) for word in item.get("value", "").split()]
        except ValueError:
            values = []
        if not values:
            text = item.get("value", "")
            self._faults.add(self._location(item), f"{owner}: '{name}' is '{text}'; expected a position in rad or m")
            return
        variables = VARIABLES.get(self._virtual_kinds.get(name, ""), values)
        if len(values) != len(variables):
            self._faults.add(
                self._location(item),
                f"{owner}: '{name}' has {len(values)} numbers; expected for a {self._virtual_kinds[name]} virtual "
                f"joint: {len(variables)} ({' '.join(map(str, variables))}); correct it",
            )
            return
        joint = self._tree.joints.get(name)
        if joint is None or joint.limit is None or joint.kind not in ("revolute", "prismatic"):
            return
        lower, upper = joint.limit.lower, joint.limit.upper
        if not lower - LIMIT_TOLERANCE <= values[0] <= upper + LIMIT_TOLERANCE:
            self._faults.add(
                self._location(item),
                f"{owner}: '{name}' is at {values[0]:g}; allowed by the URDF: {lower:g} to {upper:g}; correct it",
            )

    def _check_end_effector(self, element: Element, groups: Mapping[str, PlanningGroup]) -> None:
        name = element.get("name", "")
        if not name:
            self._faults.add(self._location(element), "an <end_effector> has no name; give it one")
        has_group = self._check_name(element, "group", "group", groups)
        has_link = self._check_name(element, "parent_link", "parent_link", self._tree.links)
        parent, link = element.get("parent_group", ""), (element.get("parent_link") or "").strip()
        if parent and parent not in groups:
            self._faults.add_unknown(self._location(element), f"end effector '{name}': parent_group", parent, groups)
        elif has_link and parent and link not in groups[parent].links:
            allowed = ", ".join(item for item in self._tree.links if item in groups[parent].links)
            self._faults.add(
                self._location(element),
                f"end effector '{name}': parent_link '{link}' is not in its parent_group '{parent}'; allowed: {allowed}"
                "; correct the link or the group",
            )
        elif has_link and not parent and not self._holders(link, element.get("group", ""), groups):
            self._faults.add(
                self._location(element),
                f"end effector '{name}': no other group contains its parent_link '{link}'; name a "
                "link of a group, or add parent_group",
            )
        if has_group and parent and parent == element.get("group"):
            self._faults.add(
                self._location(element), f"end effector '{name}': group and parent_group are both '{parent}'"
            )

    @staticmethod
    def _holders(link: str, own_group: str, groups: Mapping[str, PlanningGroup]) -> list[str]:
        return [name for name, group in groups.items() if name != own_group and link in group.links]

    def _check_virtual_joint(self, element: Element) -> None:
        name, kind = element.get("name", ""), element.get("type", "")
        if not name or not element.get("parent_frame"):
            missing = "name" if not name else "parent_frame"
            self._faults.add(self._location(element), f"<virtual_joint> '{name}' has no attribute '{missing}'; add it")
        if kind not in VIRTUAL_KINDS:
            self._faults.add_unknown(self._location(element), f"virtual joint '{name}': type", kind, VIRTUAL_KINDS)
        roots = self._tree.roots
        if self._check_name(element, "child_link", "child_link", self._tree.links) and roots:
            child = (element.get("child_link") or "").strip()
            if child not in roots:
                self._faults.add(
                    self._location(element),
                    f"virtual joint '{name}': child_link '{child}' is not the root of the robot; allowed: "
                    f"{', '.join(roots)}; name the root, because a virtual joint places the whole robot",
                )

    def _check_pairs(self) -> None:
        """Reports each unknown link once, even if it occurs in several pairs."""
        links = self._tree.links
        unknown: dict[str, list[tuple[Element, str]]] = {}
        for tag in ("disable_collisions", "enable_collisions"):
            for element in self._root.findall(tag):
                for key in ("link1", "link2"):
                    name = (element.get(key) or "").strip()
                    if name not in links:
                        unknown.setdefault(name, []).append((element, key))
        for name, uses in unknown.items():
            element, key = uses[0]
            note = f" (and in {len(uses) - 1} more pairs)" if len(uses) > 1 else ""
            label = f"<{element.tag}>{note}: {key}" if name else f"<{element.tag}>{note} has no attribute '{key}':"
            self._faults.add_unknown(self._location(element), label, name, links)
        for tag in ("disable_default_collisions", "link_sphere_approximation"):
            for element in self._root.findall(tag):
                self._check_name(element, "link", "link", links)
