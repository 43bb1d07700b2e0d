# SPDX-License-Identifier: BSD-3-Clause
"""Immutable robot model from URDF, SRDF and joint limits: joints, groups, frames and geometry."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from modular_framework_planning.errors import ErrorCode, ModelError, UnknownNameError
from modular_framework_planning.geometry.angles import shortest_difference
from modular_framework_planning.geometry.shapes import Shape
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.robot_model.srdf import parse_srdf
from modular_framework_planning.robot_model.urdf_document import (
    CONTINUOUS_BOUND,
    MeshResolver,
    load_urdf,
    package_resolver,
)
from modular_framework_urdf.joint_limits import DEFAULT_ACCELERATION, DEFAULT_VELOCITY, JointLimits, overwritten
from modular_framework_urdf.planning_groups import GroupError, KinematicTree
from modular_framework_urdf.srdf_reader import GroupSpec, SemanticDescription

GOAL_BOUNDS_TOLERANCE = 1.0e-4  # bounds violation of a goal that is clipped, such as 3.1416 for pi [rad or m]
MAX_CACHED_MODELS = 4  # number of robots whose derived data are cached


@dataclass(frozen=True, slots=True)
class LinkGeometry:
    """Collision element of a link, placed in the frame of the joint that moves it."""

    link: str
    joint_id: int
    frame_id: int
    placement: Transform
    shape: Shape

    @property
    def geometry(self) -> Any:
        """Coal geometry of the shape."""
        return self.shape.geometry


@dataclass(frozen=True, slots=True)
class JointGroup:
    """A planning group.

    Attributes:
        name: Name of the group.
        joints: Active joints, in the order of the kinematic tree.
        indices: Indices of these joints in a position vector of the whole robot.
        links: Links whose parent joint belongs to the group.
        base_link, tip_link: Ends of the chain; empty if the group is not a chain.
    """

    name: str
    joints: tuple[str, ...]
    indices: NDArray[np.int64]
    links: tuple[str, ...]
    base_link: str
    tip_link: str

    @property
    def is_chain(self) -> bool:
        """Whether the group is a chain with inverse kinematics."""
        return bool(self.tip_link and self.joints)


def _entry(entries: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Returns a joint's entry in joint_limits.yaml, whose key "joint/variable" the parameter server splits."""
    joint, _, variable = name.rpartition("/")
    return entries.get(name) or (entries.get(joint) or {}).get(variable) or {}


class RobotModel:
    """Immutable and thread-safe robot model.

    Position vectors hold a value per movable joint, including mimic joints, in the order of `joint_names`. A planar or
    floating virtual joint (`base`) is represented by its variables, each a joint.
    """

    def __init__(
        self, urdf: str, srdf: str, limits: Mapping[str, Any] | None = None, resolve: MeshResolver = package_resolver
    ) -> None:
        self.source = (urdf, srdf, dict(limits or {}), resolve)  # used to rebuild the model in another process
        self.semantics: SemanticDescription = parse_srdf(srdf)
        self.document = load_urdf(urdf, resolve, self.semantics.virtual_joints)
        self.base = self.document.multi_dof_joint
        self.name = self.document.robot_name
        self.pin_model = pin.buildModelFromXML(self.document.xml)
        self.joint_names: tuple[str, ...] = tuple(self.pin_model.names)[1:]
        self.index = {name: index for index, name in enumerate(self.joint_names)}
        if self.pin_model.nq != len(self.joint_names):
            raise ModelError(
                f"URDF: {self.pin_model.nq} position variables for {len(self.joint_names)} joints; "
                "only joints with one degree of freedom are supported"
            )
        self.base_indices = np.array(
            [self.index[name] for name in self.base.variables] if self.base else [], dtype=np.int64
        )
        self.passive_joints = frozenset(self.semantics.passive_joints) - self.document.mimics.keys()
        self.follower_joints = frozenset(
            self._with_base_variables((*self.document.mimics, *self.semantics.passive_joints))
        )
        # As in MoveIt: the parent frame of a moving base, or the root link. tf provides the parent frame of a fixed
        # virtual joint.
        self.planning_frame = self.base.parent_frame if self.base else self.document.root_link
        self.frame_ids = {link: self.pin_model.getFrameId(link, pin.FrameType.BODY) for link in self.document.links}
        self.limits, notes = self._joint_limits(limits or {})
        self.notes = (*self.document.notes, *notes)  # ignored elements and limits looser than the URDF, with reasons
        self.lower, self.upper, self.max_velocity, self.max_acceleration, self.max_jerk = (
            np.array([getattr(self.limits[name], key) for name in self.joint_names])
            for key in ("lower", "upper", "velocity", "acceleration", "jerk")
        )
        self.continuous = self.upper >= CONTINUOUS_BOUND
        self.max_deceleration = np.array([self.limits[name].braking for name in self.joint_names])
        self.mimics = [
            (self.index[name], self.index[mimic.leader], mimic.multiplier, mimic.offset)
            for name, mimic in self.document.mimics.items()
        ]
        self.link_geometries = self._load_geometry()
        children = self.document.joint_children
        self.tree = KinematicTree({joint: (self.document.joint_parents[joint], children[joint]) for joint in children})
        try:
            self.groups = {name: self._build_group(spec) for name, spec in self.semantics.groups.items()}
        except GroupError as error:
            raise ModelError(str(error)) from error

    def _with_base_variables(self, joints: Iterable[str]) -> set[str]:
        """Returns joint names, with the base or any of its variables replaced by all its variables."""
        names = set(joints)
        if self.base and names & {self.base.name, *self.base.variables}:
            names = (names - {self.base.name}) | set(self.base.variables)
        return names

    def _joint_limits(self, entries: Mapping[str, Any]) -> tuple[dict[str, JointLimits], tuple[str, ...]]:
        """Returns the limits of all joints, and notes about entries that are ignored or looser than the URDF."""
        result: dict[str, JointLimits] = {}
        notes: list[str] = []
        for index, name in enumerate(self.joint_names):
            bounds = (self.pin_model.lowerPositionLimit[index], self.pin_model.upperPositionLimit[index])
            limits = self.document.limits.get(name)
            if limits is None:  # a variable of the base
                limits = JointLimits(float(bounds[0]), float(bounds[1]), DEFAULT_VELOCITY, DEFAULT_ACCELERATION)
            is_continuous = math.isinf(limits.upper)
            try:
                limits, entry_notes = overwritten(name, limits, _entry(entries, name), is_continuous)
            except ValueError as error:
                raise ModelError(str(error)) from error
            if is_continuous:
                limits = replace(limits, lower=-CONTINUOUS_BOUND, upper=CONTINUOUS_BOUND)
            result[name] = limits
            notes += entry_notes
        return result, tuple(notes)

    def _load_geometry(self) -> tuple[LinkGeometry, ...]:
        result = []
        for link, shapes in self.document.collisions.items():
            frame = self.pin_model.frames[self.frame_ids[link]]
            result += [
                LinkGeometry(link, frame.parentJoint, self.frame_ids[link], frame.placement * pose, shape)
                for shape, pose in shapes
            ]
        return tuple(result)

    def is_carried(self, link: str, carrier: str) -> bool:
        """Checks that only fixed and passive joints lie between a link and its carrier."""
        path, carrier_joints = self.joints_above(link), self.joints_above(carrier)
        return path[: len(carrier_joints)] == carrier_joints and self.passive_joints.issuperset(
            path[len(carrier_joints) :]
        )

    def joints_above(self, link: str) -> list[str]:
        """Returns the names of the joints that move a link, from the root, starting with Pinocchio's "universe"."""
        joint = self.pin_model.frames[self.frame_ids[link]].parentJoint
        return [self.pin_model.names[index] for index in self.pin_model.supports[joint]]

    def _group_joints(self, spec: GroupSpec) -> set[str]:
        return self._with_base_variables(self.tree.group_joints(spec.name, self.semantics))

    def _build_group(self, spec: GroupSpec) -> JointGroup:
        members = self._group_joints(spec)
        joints = tuple(name for name in self.joint_names if name in members and name not in self.follower_joints)
        links = tuple(self.document.joint_children[name] for name in members if name in self.document.joint_children)
        base, tip = self._chain_ends(spec, joints)
        ordered = tuple(link for link in self.document.links if link in links)
        return JointGroup(
            spec.name, joints, np.array([self.index[name] for name in joints], dtype=np.int64), ordered, base, tip
        )

    def _chain_ends(self, spec: GroupSpec, joints: tuple[str, ...]) -> tuple[str, str]:
        if len(spec.chains) == 1 and not (spec.joints or spec.links or spec.subgroups):
            return spec.chains[0]
        for name in spec.subgroups:
            subgroup = self.semantics.groups[name]
            if len(subgroup.chains) == 1 and set(joints) <= set(self.tree.chain(*subgroup.chains[0])):
                return subgroup.chains[0]
        if not joints:
            return "", ""
        base = self.document.joint_parents[joints[0]]
        tip = self.document.joint_children[joints[-1]]
        try:
            movable = [name for name in self.tree.chain(base, tip) if name in self.index]
        except GroupError:
            return "", ""
        return (base, self._last_fixed_link(tip, spec)) if movable == list(joints) else ("", "")

    def _last_fixed_link(self, tip: str, spec: GroupSpec) -> str:
        """Returns the last link behind the fixed joints of the group after its last moving joint."""
        members = self._group_joints(spec)
        for joint, child in self.document.joint_children.items():
            if joint in members and joint not in self.index and self.document.joint_parents[joint] == tip:
                return self._last_fixed_link(child, spec)
        return tip

    def group(self, name: str) -> JointGroup:
        """Returns a planning group; raises UnknownNameError for an unknown name."""
        if name not in self.groups:
            raise UnknownNameError(ErrorCode.INVALID_GROUP_NAME, "planning group", name, self.groups)
        return self.groups[name]

    def joint_index(self, name: str) -> int:
        """Returns the index of a joint in a position vector; raises UnknownNameError for an unknown name."""
        if name not in self.index:
            raise UnknownNameError(ErrorCode.INVALID_ROBOT_STATE, "joint", name, self.joint_names)
        return self.index[name]

    def has_link(self, name: str) -> bool:
        """Checks whether the URDF has a link."""
        return name in self.frame_ids

    def default_positions(self) -> Array:
        """Returns zero for each joint, clipped to its bounds."""
        return self.with_mimics(np.clip(np.zeros(len(self.joint_names)), self.lower, self.upper))

    def with_mimics(self, positions: Array, leaders: Collection[int] | None = None) -> Array:
        """Returns a copy in which mimic joints follow their leaders.

        Args:
            positions: Positions of the whole robot [rad or m].
            leaders: Joints whose mimic joints are updated; None for all. The measured passive joints of a gripper then
                keep their values while the arm moves.
        """
        result = np.array(positions, dtype=float)
        for follower, leader, multiplier, offset in self.mimics:
            if leaders is None or leader in leaders:
                result[follower] = multiplier * result[leader] + offset
        return result

    def merge(self, base: Array, values: Mapping[str, float]) -> Array:
        """Returns a copy of positions with the values of named joints replaced; other mimic joints follow.

        Raises:
            UnknownNameError: A joint does not exist.
        """
        result = np.array(base, dtype=float)
        for name, value in values.items():
            result[self.joint_index(name)] = value
        named = {self.index[name] for name in values}
        for follower, leader, multiplier, offset in self.mimics:
            if leader in named and follower not in named:
                result[follower] = multiplier * result[leader] + offset
        return result

    def is_continuous(self, index: int) -> bool:
        """Checks whether the joint at an index of a position vector is continuous."""
        return bool(self.continuous[index])

    def displacement(self, start: Array, end: Array, indices: Sequence[int] | NDArray[np.int64] | None = None) -> Array:
        """Returns joint displacements from start to end, by the shorter rotation for continuous joints [rad or m].

        Args:
            start: Joint positions, shape (..., joints).
            end: Positions of the same joints.
            indices: Indices of the joints in a position vector; None for all joints.
        """
        difference = np.asarray(end, dtype=float) - start
        continuous = self.continuous if indices is None else self.continuous[np.asarray(indices, dtype=np.int64)]
        return shortest_difference(difference, continuous)

    def with_base(self, positions: Array, transform: Transform) -> Array:
        """Returns a copy with the root link at a new pose, with angles unwrapped to the current angles.

        Args:
            positions: Positions of a robot with a planar or floating virtual joint [rad or m].
            transform: Pose of the root link in the planning frame.
        """
        assert self.base is not None
        result = np.array(positions, dtype=float)
        result[self.base_indices] = self.base.values(transform, result[self.base_indices])
        return result

    def base_transform(self, positions: Array) -> Transform:
        """Returns the pose of the root link in the planning frame."""
        return self.base.transform(positions[self.base_indices]) if self.base else pin.SE3.Identity()

    def bound_violations(
        self,
        positions: Array,
        indices: Iterable[int],
        tolerance: float = 1e-9,
        bounds: tuple[Array, Array] | None = None,
    ) -> list[str]:
        """Returns a message per joint that is out of bounds.

        Args:
            positions: Positions of the whole robot [rad or m].
            indices: Indices of the joints to check.
            tolerance: Accepted violation of a bound [rad or m].
            bounds: Lower and upper bounds of these joints; None for the bounds of the robot.
        """
        selected = np.asarray(list(indices), dtype=np.int64)
        lower, upper = (self.lower[selected], self.upper[selected]) if bounds is None else bounds
        return [
            f"joint {self.joint_names[index]} at {positions[index]:.4f} is outside [{low:.4f}, {high:.4f}]"
            for index, low, high in zip(selected, lower, upper, strict=True)
            if not low - tolerance <= positions[index] <= high + tolerance
        ]

    def link_transforms(self, positions: Array) -> dict[str, Transform]:
        """Returns the pose of every link in the planning frame, keyed by link name."""
        data = self.pin_model.createData()
        pin.framesForwardKinematics(self.pin_model, data, positions)
        return {link: data.oMf[frame].copy() for link, frame in self.frame_ids.items()}
