# SPDX-License-Identifier: BSD-3-Clause
"""Works out everything that is written into the packages of a robot."""

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
from modular_framework_setup.creation.named_states import gripper_states, ready_state
from modular_framework_setup.creation.robot_parts import Arm, Gripper, RobotParts, find_parts
from modular_framework_setup.creation.self_collisions import Hand, PairVerdict, Progress, find_verdicts
from modular_framework_setup.creation.source_urdf import SourceUrdf
from modular_framework_setup.creation.urdf_completion import add_frame, complete_urdf
from modular_framework_setup.errors import CreationError
from modular_framework_urdf import xml_text
from modular_framework_urdf.mesh_paths import mesh_path
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError

SEGMENT_RAD = 0.05  # between two states that a planner checks on its way
ACCELERATION_PER_VELOCITY = 2.0  # full speed in half a second

Ends = Mapping[str, tuple[float, float]]
"""Of each gripper by name: the positions of its driver in which it is open and closed [rad or m]."""
ConfirmParts = Callable[[RobotTree, RobotParts], RobotParts]
"""Shows what was found to a person, and returns what they want."""


@dataclass(frozen=True, slots=True)
class Choices:
    """What a user says about the robot.

    Attributes:
        name: of the robot, in the names of the packages.
        chains: base and tip link of each arm; none: they are found.
        fingers: finger links of each gripper; none: they are found.
        samples, seed: of the self-collision matrix.
        author, email: maintainer of the packages.
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
        """Name of the package with the description."""
        return f"{self.name}_robot"

    @property
    def config_package(self) -> str:
        """Name of the package with the planning configuration."""
        return f"{self.name}_moveit_config"


@dataclass(frozen=True, slots=True)
class MovedJoint:
    """A joint that a controller moves: its limits for planning [rad or m, and their derivatives]."""

    name: str
    lower: float
    upper: float
    velocity: float
    acceleration: float


@dataclass(frozen=True, slots=True)
class RobotPlan:
    """What the packages say.

    Attributes:
        urdf: text of the description.
        root: its root link.
        states: {group: {state: {joint: position}}} [rad or m].
        joints: all that controllers move, by name.
        segment_fractions: of each group, the step between checked states as a share of its joint space.
        palm_parents: of each palm, the link it is fixed to; a palm that a joint moves is left out.
        urdf_file: name of the file it was made from.
        notes: what was added to the description.
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
    """Works out the packages of a robot.

    Args:
        source: its URDF; changed.
        choices: of the user.
        confirm: asked about the arms and grippers.
        progress: of the self-collision matrix.

    Raises:
        CreationError: the URDF cannot be used, or no arm is found.
    """
    source.root.set("name", choices.name)
    tree = _tree(source)
    parts = confirm(tree, find_parts(tree, choices.chains, choices.fingers))
    notes = complete_urdf(source.root, tree, parts.grippers)
    model = _model(source, choices)
    ends = _gripper_ends(model, parts)
    parts = _with_grasp_frames(source, model, parts, ends)
    model = _model(source, choices)
    verdicts = find_verdicts(model, _hands(model, parts, ends), choices.samples, choices.seed, progress)
    disabled = [verdict.pair for verdict in verdicts if verdict.reason]
    return RobotPlan(
        choices,
        xml_text.to_text(source.root),
        source.copies,
        tree.roots[0],
        parts,
        _states(model, parts, ends, disabled, choices.seed),
        verdicts,
        {name: _moved_joint(model, name) for name in _moved(parts)},
        {arm.name: _segment_fraction(model, arm.joints) for arm in parts.arms},
        _palm_parents(tree, parts),
        source.path.name,
        notes,
    )


def _tree(source: SourceUrdf) -> RobotTree:
    try:
        tree = RobotTree(read_urdf(xml_text.to_text(source.root), str(source.path)), str(source.path))
    except XmlError as error:
        raise CreationError(str(error)) from error
    faults = FaultList()
    check_tree(tree, faults)
    if faults:
        raise CreationError("\n".join(map(str, faults.sorted())))
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
    """Returns the positions of each gripper's driver in which it is open and closed [rad or m]."""
    sampling = CollisionSampling(model)
    return {gripper.name: gripper_states(sampling, gripper) for gripper in parts.grippers}


def _with_grasp_frames(source: SourceUrdf, model: RobotModel, parts: RobotParts, ends: Ends) -> RobotParts:
    """Adds a frame between the pads of each gripper that has none, and makes it the tip of its arm."""
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


def _moved(parts: RobotParts) -> list[str]:
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
    """Returns the named states; the arms are placed one after the other, with open grippers."""
    sampling = CollisionSampling(model)
    states: dict[str, dict[str, dict[str, float]]] = {}
    positions = model.default_positions()
    for gripper in parts.grippers:
        opened, closed = ends[gripper.name]
        states[gripper.name] = {
            name: {gripper.driver: _rounded(model, gripper.driver, value)}
            for name, value in (("open", opened), ("closed", closed))
        }
        positions = with_gripper(model, positions, gripper, opened)
    for arm in parts.arms:
        hand = parts.gripper_of(arm)
        approach = (
            np.array([0.0, 0.0, 1.0]) if hand is None else approach_axis(model, hand, arm.tip, ends[hand.name][0])
        )
        positions = ready_state(sampling, arm, approach, positions, disabled, seed)
        states[arm.name] = {"ready": _values(model, arm, positions)}
    return states


def _values(model: RobotModel, arm: Arm, positions: Array) -> dict[str, float]:
    return {name: _rounded(model, name, positions[model.index[name]]) for name in arm.joints}


def _rounded(model: RobotModel, joint: str, value: float) -> float:
    number = model.index[joint]
    return float(np.clip(round(float(value), 4), model.lower[number], model.upper[number])) + 0.0
