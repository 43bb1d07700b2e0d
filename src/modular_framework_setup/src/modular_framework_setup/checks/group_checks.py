# SPDX-License-Identifier: BSD-3-Clause
"""Checks the planning groups of an SRDF against the robot and resolves them to joints and links."""

from __future__ import annotations

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_setup.config_files.robot_tree import PlanningGroup, RobotTree
from modular_framework_urdf.xml_text import Element

MEMBERS = ("joint", "link", "chain", "group")


class GroupChecker:
    """Checks the groups of an SRDF.

    Args:
        root: Root element of the SRDF.
        where: Path of the SRDF, for messages.
        tree: Kinematic tree of the robot.
        faults: Receives the faults.
    """

    def __init__(self, root: Element, where: str, tree: RobotTree, faults: FaultList) -> None:
        self._where, self._tree, self._faults = where, tree, faults
        self._elements: dict[str, Element] = {}
        self._virtual = [item.get("name", "") for item in root.findall("virtual_joint")]
        self._passive = {item.get("name", "") for item in root.findall("passive_joint")}
        for element in root.findall("group"):
            name = element.get("name")
            if not name:
                faults.add(self._location(element), "a <group> has no name; give it one")
            elif name in self._elements:
                first = self._elements[name].sourceline
                faults.add(self._location(element), f"group '{name}' exists twice, first in line {first}; rename one")
            else:
                self._elements[name] = element

    def _location(self, element: Element) -> SourceLocation:
        return SourceLocation(self._where, element.sourceline, 1)

    def check(self) -> dict[str, PlanningGroup]:
        """Checks all groups and returns them by name."""
        return {name: self._group(name, element) for name, element in self._elements.items()}

    def _group(self, name: str, element: Element) -> PlanningGroup:
        if not any(item.tag in MEMBERS for item in element):
            allowed = "allowed: <joint>, <link>, <chain> or <group> in it"
            self._faults.add(self._location(element), f"group '{name}' is empty; {allowed}; add its members")
        group_faults = FaultList()
        joints, links = self._members(name, element, (name,), group_faults)
        self._faults.extend(group_faults)
        ends = {end for joint in joints if joint in self._tree.joints for end in self._ends(joint)}
        active = tuple(joint.name for joint in self._tree.robot.movable_joints() if self._is_active(joint.name, joints))
        return PlanningGroup(
            name, frozenset(joints), frozenset(links | ends), active, self._location(element), not group_faults
        )

    def _ends(self, joint: str) -> tuple[str, str]:
        return self._tree.joints[joint].parent, self._tree.joints[joint].child

    def _is_active(self, joint: str, joints: set[str]) -> bool:
        return joint in joints and joint not in self._passive and self._tree.joints[joint].mimic is None

    def _members(
        self, name: str, element: Element, parents: tuple[str, ...], faults: FaultList
    ) -> tuple[set[str], set[str]]:
        """Returns the joints and links of a group, including its subgroups."""
        joints: set[str] = set()
        links: set[str] = set()
        for item in element:
            match item.tag:
                case "joint":
                    joints |= self._joint(name, item, faults)
                case "link":
                    known = self._link(name, item, faults)
                    links |= known
                    joints |= {joint.name for link in known if (joint := self._tree.parent_joint.get(link))}
                case "chain":
                    joints |= self._chain(name, item, faults)
                case "group":
                    members = self._subgroup(name, item, parents, faults)
                    joints, links = joints | members[0], links | members[1]
                case str():
                    faults.add_unknown(self._location(item), f"group '{name}': element", item.tag, MEMBERS)
        return joints, links

    def _joint(self, group: str, item: Element, faults: FaultList) -> set[str]:
        name = item.get("name", "")
        allowed = [*self._tree.joints, *self._virtual]
        if name not in allowed:
            faults.add_unknown(self._location(item), f"group '{group}': joint", name, allowed)
            return set()
        return {name}

    def _link(self, group: str, item: Element, faults: FaultList) -> set[str]:
        name = item.get("name", "")
        if name not in self._tree.links:
            faults.add_unknown(self._location(item), f"group '{group}': link", name, self._tree.links)
            return set()
        return {name}

    def _chain(self, group: str, item: Element, faults: FaultList) -> set[str]:
        base, tip = item.get("base_link", ""), item.get("tip_link", "")
        is_known = True
        for role, link in (("base_link", base), ("tip_link", tip)):
            if link not in self._tree.links:
                faults.add_unknown(
                    self._location(item), f"group '{group}': {role} of the chain", link, self._tree.links
                )
                is_known = False
        chain = self._tree.chain(base, tip) if is_known else ()
        if chain is None:
            descendants = [link for link in self._tree.links if self._tree.chain(base, link)]
            faults.add(
                self._location(item),
                f"group '{group}': tip_link '{tip}' is not a descendant of base_link '{base}'; descendants: "
                f"{', '.join(descendants) or 'none'}; swap or correct the links",
            )
        return {joint.name for joint in chain or ()}

    def _subgroup(
        self, group: str, item: Element, parents: tuple[str, ...], faults: FaultList
    ) -> tuple[set[str], set[str]]:
        name = item.get("name", "")
        if name in parents:
            loop = " -> ".join((*parents, name))
            faults.add(
                self._location(item), f"group '{group}' contains itself: {loop}; remove one of these <group> elements"
            )
            return set(), set()
        if name not in self._elements:
            others = [other for other in self._elements if other != group]
            faults.add_unknown(self._location(item), f"group '{group}': group", name, others)
            return set(), set()
        return self._members(name, self._elements[name], (*parents, name), faults)
