# SPDX-License-Identifier: BSD-3-Clause
"""Resolves the planning groups of an SRDF to the joints of a robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from modular_framework_urdf.srdf_reader import SemanticDescription


class GroupError(ValueError):
    """A planning group contains itself, or refers to a joint, link, chain or group that does not exist."""


class KinematicTree:
    """The joints of a robot and the links that they connect.

    Args:
        links_of: Parent link and child link of each joint.
    """

    def __init__(self, links_of: Mapping[str, tuple[str, str]]) -> None:
        self._above = {child: (joint, parent) for joint, (parent, child) in links_of.items()}
        self._links = {link for pair in links_of.values() for link in pair}
        self._joints = links_of.keys()

    def up(self, link: str) -> Iterator[tuple[str, str]]:
        """Yields the joints from a link up to the root, each with its parent link; stops before a repeated link."""
        below = {link}
        while link in self._above and self._above[link][1] not in below:  # a virtual joint may connect equal names
            joint, link = self._above[link]
            below.add(link)
            yield joint, link

    def chain(self, base: str, tip: str) -> list[str]:
        """Returns the joints from a link to one of its descendants, including fixed joints.

        Raises:
            GroupError: The tip is not a descendant of the base.
        """
        joints: list[str] = []
        if base == tip:
            return joints
        for joint, parent in self.up(tip):
            joints.append(joint)
            if parent == base:
                return joints[::-1]
        raise GroupError(f"link '{tip}' is not below link '{base}'")

    def group_joints(self, name: str, semantics: SemanticDescription, parents: tuple[str, ...] = ()) -> list[str]:
        """Returns the joints of a group and of its subgroups in the order of the SRDF, each once.

        A link stands for the joint above it. Virtual joints are included.

        Args:
            name: Name of the group.
            semantics: Content of the SRDF.
            parents: Groups that contain the group.

        Raises:
            GroupError: The group is unknown or contains itself, or a member does not exist.
        """
        if name not in semantics.groups:
            container = f"group '{parents[-1]}' contains the unknown group" if parents else "there is no group"
            raise GroupError(f"SRDF: {container} '{name}'; known: {', '.join(sorted(semantics.groups)) or 'none'}")
        if name in parents:
            raise GroupError(f"SRDF: group '{name}' contains itself; remove one <group> element")
        virtual = {joint.name for joint in semantics.virtual_joints}
        joints: list[str] = []
        for member in semantics.groups[name].members:
            match member.kind:
                case "chain":
                    joints += self.chain(member.base_link, member.tip_link)
                case "group":
                    joints += self.group_joints(member.name, semantics, (*parents, name))
                case "joint" if member.name in self._joints or member.name in virtual:
                    joints.append(member.name)
                case "link" if member.name in self._links:
                    joints += [self._above[member.name][0]] if member.name in self._above else []
                case _:
                    raise GroupError(f"SRDF: group '{name}' names the {member.kind} '{member.name}', not in the URDF")
        return list(dict.fromkeys(joints))
