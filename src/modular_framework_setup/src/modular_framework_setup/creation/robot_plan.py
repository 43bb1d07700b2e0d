# SPDX-License-Identifier: BSD-3-Clause
"""Computes the content of a robot's packages."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from modular_framework_core.files.faults import FaultList
from modular_framework_planning.errors import ModelError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_setup.checks.urdf_checks import check_tree
from modular_framework_setup.config_files.config_package import find_package
from modular_framework_setup.config_files.robot_tree import RobotTree
from modular_framework_setup.creation.collision_sampling import CollisionSampling, Pair
from modular_framework_setup.creation.finger_shapes import with_gripper
from modular_framework_setup.creation.grasp_frame import approach_axis, grasp_pose
from modular_framework_setup.creation.named_states import gripper_states, pad_travel, ready_state
from modular_framework_setup.creation.robot_parts import Arm, Gripper, RobotParts, find_parts
from modular_framework_setup.creation.self_collisions import Hand, PairVerdict, Progress, find_verdicts
from modular_framework_setup.creation.source_urdf import SourceUrdf
from modular_framework_setup.creation.urdf_completion import add_frame, bound_grip, complete_urdf
from modular_framework_setup.errors import CreationError
from modular_framework_urdf import xml_text
from modular_framework_urdf.mesh_paths import mesh_path
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError

SEGMENT_RAD = 0.05  # distance between collision-checked states of a path
ACCELERATION_PER_VELOCITY = 2.0  # acceleration per velocity [1/s]; reaches full speed in half a second

Ends = Mapping[str, tuple[float, float]]
"""Open and closed position of each gripper's driven joint, by gripper name [rad or m]."""
ConfirmParts = Callable[[RobotTree, RobotParts], RobotParts]
"""Function with which the user confirms or corrects the detected parts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choices:
    """Options of the user.

    Attributes:
        name: Robot name, used in the package names.
        chains: Base and tip link of each arm; empty to find the arms.
        fingers: Finger links of each gripper; empty to find the grippers.
        samples: Number of random states for the self-collision matrix.
        seed: Seed of the random states.
        author: Maintainer of the packages.
        email: Address of the maintainer.
    """

    name: str
    chains: Sequence[tuple[str, str]] = ()
    fingers: Sequence[Sequence[str]] = ()
    samples: int = 10_000
    seed: int = 1
    author: str = "maintainer"
    email: str = "maintainer@example.com"

    @property
    def robot_package(self) -> str:
        """Name of the package with the robot description."""
        return f"{self.name}_robot"

    @property
    def config_package(self) -> str:
        """Name of the package with the planning configuration."""
        return f"{self.name}_moveit_config"


@dataclass(frozen=True, slots=True)
class MovedJoint:
    """A joint moved by a controller, with its limits for planning [rad or m, per s, per s^2]."""

    name: str
    lower: float
    upper: float
    velocity: float
    acceleration: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotPlan:
    """Content of a robot's packages.

    Attributes:
        choices: Options of the user.
        urdf: URDF text.
        copies: Files to copy, path in the robot package -> source file.
        root: Root link.
        parts: Arms and grippers.
        states: Named states, {group: {state: {joint: position}}} [rad or m].
        verdicts: Self-collision matrix.
        joints: Joints moved by controllers, by name.
        segment_fractions: Distance between collision-checked states by group, as a fraction of the joint space.
        palm_parents: Parent link of each palm that is fixed to its parent.
        urdf_file: Name of the source file.
        notes: Notes about additions to the URDF.
    """

    choices: Choices
    urdf: str
    copies: Mapping[str, Path]
    root: str
    parts: RobotParts
    states: Mapping[str, Mapping[str, Mapping[str, float]]]
    verdicts: Sequence[PairVerdict]
    joints: Mapping[str, MovedJoint]
    segment_fractions: Mapping[str, float]
    palm_parents: Mapping[str, str]
    urdf_file: str
    notes: Sequence[str] = field(default_factory=tuple)


def make_plan(source: SourceUrdf, choices: Choices, confirm: ConfirmParts, progress: Progress) -> RobotPlan:
    """Computes the content of a robot's packages.

    Args:
        source: URDF, which is modified.
        choices: Options of the user.
        confirm: Function that confirms or corrects the arms and grippers.
        progress: Function that shows the progress of the self-collision matrix.

    Raises:
        CreationError: The URDF is invalid, or no arm is found.
    """
    source.root.set("name", choices.name)
    tree = _tree(source)
    parts = confirm(tree, find_parts(tree, choices.chains, choices.fingers))
    notes = complete_urdf(source.root, tree, parts.grippers)
    model = _model(source, choices)
    ends = _gripper_ends(model, parts)
    notes += _bound_grips(source, model, parts, ends)
    parts = _with_grasp_frames(source, model, parts, ends)
    model = _model(source, choices)
    verdicts = find_verdicts(model, _hands(model, parts, ends), choices.samples, choices.seed, progress)
    disabled = [verdict.pair for verdict in verdicts if verdict.reason]
    return RobotPlan(
        choices=choices,
        urdf=xml_text.to_text(source.root),
        copies=source.copies,
        root=tree.roots[0],
        parts=parts,
        states=_states(model, parts, ends, disabled, choices.seed),
        verdicts=verdicts,
        joints={name: _moved_joint(model, name) for name in _controlled_joints(parts)},
        segment_fractions={arm.name: _segment_fraction(model, arm.joints) for arm in parts.arms},
        palm_parents=_palm_parents(tree, parts),
        urdf_file=source.path.name,
        notes=notes,
    )


def _tree(source: SourceUrdf) -> RobotTree:
    try:
        tree = RobotTree(read_urdf(xml_text.to_text(source.root), str(source.path)), str(source.path))
    except XmlError as error:
        raise CreationError(str(error)) from error
    faults = FaultList()
    check_tree(tree, faults)
    if faults:
        raise CreationError("\n".join(map(str, faults.sorted_faults())))
    return tree


def _model(source: SourceUrdf, choices: Choices) -> RobotModel:
    def resolve(uri: str) -> str:
        target = uri.removeprefix(f"package://{choices.robot_package}/")
        return str(source.copies[target] if target in source.copies else mesh_path(uri, find_package))

    try:
        return RobotModel(xml_text.to_text(source.root), f'<robot name="{choices.name}"/>', resolve=resolve)
    except ModelError as error:
        raise CreationError(f"{source.path}: {error}") from error


def _gripper_ends(model: RobotModel, parts: RobotParts) -> dict[str, tuple[float, float]]:
    """Returns the open and closed position of each gripper's driven joint [rad or m]."""
    sampling = CollisionSampling(model)
    return {gripper.name: gripper_states(sampling, gripper) for gripper in parts.grippers}


def _bound_grips(source: SourceUrdf, model: RobotModel, parts: RobotParts, ends: Ends) -> list[str]:
    sampling, notes = CollisionSampling(model), []
    for gripper in parts.grippers:
        notes += bound_grip(source.root, gripper, pad_travel(sampling, gripper, *ends[gripper.name]))
    return notes


def _with_grasp_frames(source: SourceUrdf, model: RobotModel, parts: RobotParts, ends: Ends) -> RobotParts:
    """Adds a grasp frame to each gripper without a tip frame, and makes the grasp frame the tip of the arm."""
    arms = []
    for arm in parts.arms:
        gripper = parts.gripper_of(arm)
        if gripper is not None and arm.tip == gripper.palm and _has_fingers(model, gripper):
            frame = f"{gripper.name}_grasp_frame"
            add_frame(source.root, frame, gripper.palm, grasp_pose(model, gripper, *ends[gripper.name]))
            arm = replace(arm, tip=frame)
        arms.append(arm)
    return replace(parts, arms=tuple(arms))


def _hands(model: RobotModel, parts: RobotParts, ends: Ends) -> list[Hand]:
    return [
        Hand(
            frozenset((item.palm, *item.links)),
            tuple(with_gripper(model, model.default_positions(), item, position) for position in ends[item.name]),
        )
        for item in parts.grippers
    ]


def _has_fingers(model: RobotModel, gripper: Gripper) -> bool:
    return any(item.link in gripper.links for item in model.link_geometries)


def _palm_parents(tree: RobotTree, parts: RobotParts) -> dict[str, str]:
    joints = [tree.parent_joint.get(item.palm) for item in parts.grippers]
    return {joint.child: joint.parent for joint in joints if joint is not None and joint.kind == "fixed"}


def _controlled_joints(parts: RobotParts) -> list[str]:
    return [*parts.torso, *(n for arm in parts.arms for n in arm.joints), *(item.driver for item in parts.grippers)]


def _moved_joint(model: RobotModel, name: str) -> MovedJoint:
    limits = model.limits[name]
    acceleration = ACCELERATION_PER_VELOCITY * limits.velocity
    return MovedJoint(name, limits.lower, limits.upper, limits.velocity, acceleration)


def _segment_fraction(model: RobotModel, joints: Sequence[str]) -> float:
    ranges = [min(model.limits[name].upper - model.limits[name].lower, 2.0 * math.pi) for name in joints]
    return min(SEGMENT_RAD / math.hypot(*ranges), 0.02)


def _states(
    model: RobotModel, parts: RobotParts, ends: Ends, disabled: Sequence[Pair], seed: int
) -> dict[str, dict[str, dict[str, float]]]:
    """Returns the named states. The arms are posed one by one, with open grippers."""
    sampling = CollisionSampling(model)
    states: dict[str, dict[str, dict[str, float]]] = {}
    positions = model.default_positions()
    for gripper in parts.grippers:
        opened, closed = ends[gripper.name]
        states[gripper.name] = {
            name: {gripper.driver: _rounded_position(model, gripper.driver, value)}
            for name, value in (("open", opened), ("closed", closed))
        }
        positions = with_gripper(model, positions, gripper, opened)
    for arm in parts.arms:
        hand = parts.gripper_of(arm)
        approach = (
            np.array([0.0, 0.0, 1.0]) if hand is None else approach_axis(model, hand, arm.tip, ends[hand.name][0])
        )
        positions = ready_state(sampling, arm, approach, positions, disabled=disabled, seed=seed)
        states[arm.name] = {"ready": _values(model, arm, positions)}
    return states


def _values(model: RobotModel, arm: Arm, positions: Array) -> dict[str, float]:
    return {name: _rounded_position(model, name, positions[model.index[name]]) for name in arm.joints}


def _rounded_position(model: RobotModel, joint: str, value: float) -> float:
    index = model.index[joint]
    return float(np.clip(round(float(value), 4), model.lower[index], model.upper[index])) + 0.0
