# SPDX-License-Identifier: BSD-3-Clause
"""Robot model from URDF, SRDF and joint limits: joints, links, groups, bounds and named states."""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from modular_framework_urdf import srdf_reader
from modular_framework_urdf.mimics import Mimic, resolve_mimics
from modular_framework_urdf.planning_groups import GroupError, KinematicTree
from modular_framework_urdf.srdf_reader import GroupSpec, SemanticDescription, VirtualJoint, read_srdf
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError
from moveit_commander.exception import RobotModelError
from moveit_commander.joints import NO_MIMIC, Joint, is_quaternion, joint_of, root_joint


@dataclass(frozen=True, slots=True)
class Group:
    """A planning group, with joints and links in the order of the model."""

    name: str
    joints: tuple[Joint, ...]
    links: tuple[str, ...]
    is_chain: bool
    end_effector: str
    states: Mapping[str, Mapping[str, float]]

    @property
    def active_joints(self) -> tuple[Joint, ...]:
        return tuple(joint for joint in self.joints if joint.active)

    @property
    def variables(self) -> tuple[Joint, ...]:
        """Variables of all joints, including mimic joints and the parts of planar or floating joints."""
        return tuple(variable for joint in self.joints for variable in joint.variables)

    @property
    def active_variables(self) -> tuple[Joint, ...]:
        """Variables of the active joints."""
        return tuple(variable for joint in self.active_joints for variable in joint.variables)

    @property
    def tip(self) -> str:
        return self.links[-1] if self.is_chain else ""


@dataclass(frozen=True, slots=True)
class EndEffector:
    """A group mounted on a link; `parent_group` is the group of this link, or empty."""

    group: str
    parent_group: str
    parent_link: str


class RobotModel:
    """The robot model, without state."""

    def __init__(self, urdf: str, srdf: str, limits: Mapping[str, Any] | None = None) -> None:
        """Reads the descriptions.

        Args:
            urdf: Robot description (URDF text, expanded).
            srdf: Semantic description (SRDF text).
            limits: Entries of joint_limits.yaml, keyed by joint.

        Raises:
            RobotModelError: A description is invalid, or the descriptions contradict each other.
        """
        try:
            description, semantics = read_urdf(urdf, "URDF"), read_srdf(srdf)
        except XmlError as error:
            raise RobotModelError(f"{error} (is it loaded and expanded?)") from error
        self.name = description.name
        self.visuals = {link.name: link.visuals for link in description.links}
        found = _with_leaders([joint_of(joint, limits or {}) for joint in description.joints])
        self.mimics = {
            joint.name: Mimic(joint.leader, joint.multiplier, joint.offset) for joint in found if joint.leader
        }
        tree = {joint.child: joint for joint in found}
        roots = description.root_links()
        if len(roots) != 1:
            raise RobotModelError(f"URDF '{self.name}': {len(roots)} links have no parent joint; exactly one may")
        self.root_link = roots[0]
        virtual = _virtual_joint(semantics, self.root_link)
        root = root_joint(virtual, self.root_link, limits or {})
        self.base = virtual if virtual and virtual.kind in ("planar", "floating") else None
        # As in MoveIt: the parent frame of a planar or floating base, or the root link below a fixed virtual joint.
        self.planning_frame = self.base.parent_frame if self.base else self.root_link
        ordered = [root, *_depth_first(tree.values(), self.root_link)]
        self.joints = {joint.name: joint for joint in ordered}
        self.links = tuple(joint.child for joint in ordered)
        self._parent_joint = {joint.child: joint for joint in ordered}
        self._tree = KinematicTree({joint.name: (joint.parent, joint.child) for joint in ordered})
        self.passive = semantics.passive_joints
        self._semantics = semantics
        self.groups = {spec.name: self._group(spec) for spec in semantics.groups.values()}
        self.end_effectors = tuple(map(self._end_effector, semantics.end_effectors))

    def group(self, name: str) -> Group:
        """Returns a group; raises RobotModelError with the known names otherwise."""
        if name not in self.groups:
            raise RobotModelError(
                f"There is no group named '{name}' in robot '{self.name}'; it has: "
                f"{', '.join(sorted(self.groups)) or 'none'}"
            )
        return self.groups[name]

    def chain(self, base: str, tip: str) -> list[Joint]:
        """Returns the joints from a link to one of its descendants."""
        try:
            return [self.joints[name] for name in self._tree.chain(base, tip)]
        except GroupError as error:
            raise RobotModelError(f"{error} in robot '{self.name}'") from error

    def complete(self, positions: Mapping[str, float]) -> dict[str, float]:
        """Returns the positions of the model's joints in order, with computed mimic joints; skips unknown joints."""
        values: dict[str, float] = {}
        for variable in self.variables:
            if variable.leader and variable.leader in positions:
                values[variable.name] = variable.multiplier * positions[variable.leader] + variable.offset
            elif variable.name in positions:
                values[variable.name] = positions[variable.name]
        return values

    @property
    def variables(self) -> tuple[Joint, ...]:
        """Variables of all joints in the order of the model."""
        return tuple(variable for joint in self.joints.values() for variable in joint.variables)

    @property
    def base_variables(self) -> tuple[Joint, ...]:
        """Variables of a planar or floating virtual joint; empty without one."""
        return self.joints[self.base.name].parts if self.base else ()

    def defaults(self) -> dict[str, float]:
        """Returns the default position of every variable."""
        return self.complete({variable.name: variable.default for variable in self.variables if not variable.leader})

    def random_values(self, group: Group, generator: random.Random) -> dict[str, float]:
        """Returns positions of the group's joints without passive joints, sampled uniformly within the bounds.

        An unbounded joint gets 0.
        """
        drawn = {
            item.name: generator.uniform(item.lower, item.upper) if math.isfinite(item.upper - item.lower) else 0.0
            for item in group.active_variables
            if item.name not in self.passive
        }
        quaternion_names = [item.name for item in self.base_variables if item.name in drawn and is_quaternion(item)]
        if quaternion_names:
            quaternion = [generator.gauss(0.0, 1.0) for _ in quaternion_names]  # uniform over all rotations
            drawn |= {
                name: value / math.hypot(*quaternion) for name, value in zip(quaternion_names, quaternion, strict=True)
            }
        completed = self.complete(drawn)
        return {joint.name: completed[joint.name] for joint in group.variables if joint.name in completed}

    def _group(self, spec: GroupSpec) -> Group:
        name = spec.name
        try:
            joint_names = set(self._tree.group_joints(name, self._semantics))
        except GroupError as error:
            raise RobotModelError(f"{error} in robot '{self.name}'") from error
        joints = tuple(joint for joint in self.joints.values() if joint.name in joint_names)
        links = tuple(joint.child for joint in joints)
        is_chain = (
            bool(joints)
            and any(joint.active for joint in joints)
            and all(self._follows(sooner, later) for sooner, later in zip(joints[:-1], joints[1:], strict=True))
        )
        known = self._semantics.end_effectors
        effectors = [item for item in known if name in (item.group, item.parent_group)]
        effectors += [item for item in known if item.parent_link in links]
        effector = effectors[0].name if effectors else ""
        return Group(name, joints, links, is_chain, effector, self._semantics.group_states.get(name, {}))

    def _end_effector(self, spec: srdf_reader.EndEffector) -> EndEffector:
        """Returns an end effector; as in MoveIt, the default parent group is the group with the fewest joints."""
        link = spec.parent_link
        possible = [group for group in self.groups.values() if link in group.links and group.name != spec.group]
        named = [group for group in possible if group.name == spec.parent_group]
        chosen = min(named or possible, key=lambda group: len(group.joints), default=None)
        return EndEffector(spec.group, chosen.name if chosen else "", link)

    def _follows(self, sooner: Joint, later: Joint) -> bool:
        """Returns whether only fixed joints lie between two joints."""
        link = later.parent
        while link not in (sooner.child, self.root_link) and self._parent_joint[link].kind == "fixed":
            link = self._parent_joint[link].parent
        return link == sooner.child


def _with_leaders(joints: Sequence[Joint]) -> list[Joint]:
    """Returns the joints with each mimic joint directly following the leader of its chain of mimic joints."""
    moving = [joint for joint in joints if joint.is_movable]
    try:
        mimics = resolve_mimics(
            {joint.name: Mimic(joint.leader, joint.multiplier, joint.offset) for joint in moving if joint.leader},
            [joint.name for joint in moving],
        )
    except ValueError as error:
        raise RobotModelError(str(error)) from error
    return [
        replace(joint, leader=mimic.leader, multiplier=mimic.multiplier, offset=mimic.offset)
        for joint in joints
        for mimic in (mimics.get(joint.name, NO_MIMIC),)
    ]


def _virtual_joint(semantics: SemanticDescription, root_link: str) -> VirtualJoint | None:
    """Returns the virtual joint above the root link, or None."""
    return next((item for item in semantics.virtual_joints if item.child_link == root_link), None)


def _depth_first(joints: Iterable[Joint], root_link: str) -> list[Joint]:
    below: dict[str, list[Joint]] = {}
    for joint in sorted(joints, key=lambda item: item.name):
        below.setdefault(joint.parent, []).append(joint)
    ordered: list[Joint] = []
    waiting = below.get(root_link, [])[::-1]
    while waiting:
        joint = waiting.pop()
        ordered.append(joint)
        waiting.extend(below.get(joint.child, [])[::-1])
    return ordered


def group_values(group: Group, values: Sequence[float]) -> dict[str, float]:
    """Returns the positions of a list, keyed by variable; the list covers all or only the active variables.

    Raises:
        RobotModelError: The list has a wrong length.
    """
    numbers = [float(value) for value in values]
    for joints in (group.variables, group.active_variables):
        if len(numbers) == len(joints):
            return {joint.name: number for joint, number in zip(joints, numbers, strict=True)}
    raise RobotModelError(
        f"group '{group.name}': got {len(numbers)} joint values; {len(group.variables)} are needed, "
        f"in this order: {', '.join(joint.name for joint in group.variables)}"
    )
