# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics of requests for one link, or for one link of each of several subgroups."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count, product
from typing import Any

import numpy as np
import pinocchio as pin

from modular_framework_planning.constraints.constraint_kinds import (
    OrientationConstraint,
    Parameterization,
    PositionConstraint,
)
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.constraints.robot_frames import frame_on_robot, require_holding_link
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.regions import SphereSolid
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics, KinematicsPool
from modular_framework_planning.messages.poses import stamped_in_scene
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel

MIN_ATTEMPTS = 32  # attempts made even after the timeout, for results independent of the machine's load
MAX_ATTEMPTS = 1024  # attempts without a time limit
MAX_COMBINATIONS = 256  # combined solutions of several subgroups
POSE_TOLERANCE = 1.0e-4  # pose tolerance [m and rad]; not met if a subgroup moves the base of another subgroup


@dataclass(frozen=True, slots=True, eq=False)
class IkTarget:
    """A target pose of a frame on a link.

    Attributes:
        link: Name of the link.
        offset: Pose of the frame in the link's frame; the frame is the link, a held object or a subframe.
        target: Target pose of the frame in the planning frame.
    """

    link: str
    offset: Transform
    target: Transform

    def solutions(self, solver: InverseKinematics, seed: Array, timeout_s: float | None) -> list[Array]:
        """Returns solutions, nearest to the seed first; the orientation is free if the settings say position only.

        Args:
            solver: Solver of the group.
            seed: Joint positions of the whole robot [rad or m].
            timeout_s: Time limit [s]; None for the group's time limit.
        """
        if solver.settings.position_only:
            return solver.position_solutions(
                self.link, self.offset.translation, self.target.translation, seed, timeout_s
            )
        return solver.solutions(self.link, self.target * self.offset.inverse(), seed, timeout_s=timeout_s)

    def has_complete_solutions(self, solver: InverseKinematics, seed: Array) -> bool:
        """Returns whether `solutions` finds all solutions."""
        return solver.is_complete(self.link, self.target * self.offset.inverse(), seed)

    def constraints(
        self, scene: PlanningScene, position_only: bool
    ) -> tuple[PositionConstraint, list[OrientationConstraint]]:
        """Returns the target as a position constraint and, unless `position_only`, an orientation constraint."""
        link, world = frame_on_robot(scene, self.link), frame_on_robot(scene, "")
        point = pin.SE3(np.eye(3), self.target.translation)
        position = PositionConstraint(link, self.offset.translation, world, ((SphereSolid(0.0), point),))
        rotation = self.target.rotation @ self.offset.rotation.T
        kind = Parameterization.ROTATION_VECTOR
        return position, [] if position_only else [OrientationConstraint(link, world, rotation, np.zeros(3), kind)]

    def is_reached(self, model: RobotModel, positions: Array, position_only: bool) -> bool:
        """Returns whether the frame is at its target.

        Args:
            model: Robot.
            positions: Joint positions (nq,) [rad or m].
            position_only: Whether the orientation is free.
        """
        error = self.target.actInv(model.link_transforms(positions)[self.link] * self.offset)
        rotation_error = 0.0 if position_only else float(np.abs(error.rotation - np.eye(3)).max())
        return max(float(np.abs(error.translation).max()), rotation_error) < POSE_TOLERANCE

    def failure_reason(self, solver: InverseKinematics, seed: Array) -> str:
        """Returns the reason why no solution exists."""
        if solver.settings.position_only:
            source_name = np.array2string(self.target.translation, precision=3, separator=", ")
            return (
                f"no inverse kinematics for '{self.link}': no joint positions within the bounds of group "
                f"'{solver.group.name}' reach the position {source_name} m, whatever the orientation (position_only_ik)"
            )
        return solver.explain_unreachable(self.link, self.target * self.offset.inverse(), seed)


def ik_targets(scene: PlanningScene, group: JointGroup, request: Any) -> list[IkTarget]:
    """Reads the targets of a moveit_msgs/PositionIKRequest: ik_link_name and pose_stamped, or lists of both.

    Args:
        scene: Planning scene.
        group: Planning group.
        request: Request message.

    Raises:
        PlanningError: The counts of links and poses differ, a link is repeated or unknown, or a pose is invalid.
    """
    links, poses = list(request.ik_link_names), list(request.pose_stamped_vector)
    if len(links) <= 1 and len(poses) <= 1:
        links, poses = [links[0] if links else request.ik_link_name], poses or [request.pose_stamped]
    if len(links) != len(poses):
        raise PlanningError(
            ErrorCode.INVALID_LINK_NAME,
            f"{len(links)} ik_link_names ({', '.join(links) or 'none'}) and {len(poses)} poses in pose_stamped_vector; "
            "give one link per pose",
        )
    repeated = sorted({name for name in links if links.count(name) > 1})
    if repeated:
        raise PlanningError(
            ErrorCode.INVALID_LINK_NAME, f"ik_link_names repeats {', '.join(repeated)}; list each link once"
        )
    return [_target(scene, group, *item) for item in zip(links, poses, strict=True)]


def _target(scene: PlanningScene, group: JointGroup, link_name: str, pose: Any) -> IkTarget:
    name = (link_name or group.tip_link).removeprefix("/")
    target = stamped_in_scene(scene, pose, "pose_stamped")
    if not name:
        raise PlanningError(
            ErrorCode.INVALID_LINK_NAME,
            f"no link is given, and group '{group.name}' has no tip link; list one link per pose of "
            f"pose_stamped_vector in ik_link_names ({_ends(scene.model, _subgroups(scene.model, group))})",
        )
    link = require_holding_link(scene, name, "link")
    return IkTarget(link, scene.frame_transform(link).actInv(scene.frame_transform(name)), target)


def solvers_of(kinematics: KinematicsPool, model: RobotModel, group: JointGroup, links: Sequence[str]) -> list[Any]:
    """Returns a solver per link: the group's solver for one link of a chain, else the solver of a subgroup.

    Args:
        kinematics: Solvers of all groups.
        model: Robot model.
        group: Planning group.
        links: Links to place.

    Raises:
        PlanningError: A link is not the tip of a subgroup, or the subgroups share joints.
    """
    if len(links) == 1 and group.is_chain:
        return [kinematics.solver(group.name)]
    subgroups = _subgroups(model, group)
    if not subgroups:
        kind = "is a chain with one tip link" if group.is_chain else "contains no subgroup that is a chain"
        raise PlanningError(
            ErrorCode.NO_IK_SOLUTION,
            f"group '{group.name}' {kind}; got {len(links)} links to place ({', '.join(links)}), but inverse "
            "kinematics needs one chain per link",
        )
    candidates = [[item for item in subgroups if _moves_link(model, item, link)] for link in links]
    unmatched = [link for link, solvers in zip(links, candidates, strict=True) if not solvers]
    if unmatched:
        raise PlanningError(
            ErrorCode.NO_IK_SOLUTION,
            f"no subgroup of '{group.name}' ends at {', '.join(unmatched)}; {_ends(model, subgroups)}; name tips, or "
            "links rigidly fixed to tips",
        )
    chosen = next((option for option in product(*candidates) if _are_disjoint(option)), None)
    if chosen is None:
        raise PlanningError(
            ErrorCode.NO_IK_SOLUTION,
            f"the subgroups of '{group.name}' that end at {', '.join(links)} share joints and cannot be solved "
            f"separately; {_ends(model, subgroups)}; name links of subgroups without common joints",
        )
    return [kinematics.solver(item.name) for item in chosen]


def _subgroups(model: RobotModel, group: JointGroup) -> list[JointGroup]:
    """Returns the chains within a group: subgroups in the SRDF first, then by descending number of joints."""
    declared = model.semantics.groups[group.name].subgroups
    chains = [item for item in model.groups.values() if item.is_chain and set(item.joints) < set(group.joints)]
    return sorted(chains, key=lambda item: (item.name not in declared, -len(item.joints)))


def _ends(model: RobotModel, groups: Sequence[JointGroup]) -> str:
    return "subgroups and their tips: " + (", ".join(f"{item.name} ({item.tip_link})" for item in groups) or "none")


def _moves_link(model: RobotModel, group: JointGroup, link: str) -> bool:
    """Returns whether a link is at the end of a chain."""
    return model.is_carried(link, model.document.joint_children[group.joints[-1]])


def _are_disjoint(groups: Sequence[JointGroup]) -> bool:
    joints = [joint for group in groups for joint in group.joints]
    return len(joints) == len(set(joints))


def combined_solutions(
    targets: Sequence[IkTarget], solvers: Sequence[InverseKinematics], seed: Array, timeout_s: float | None
) -> list[Array]:
    """Returns joint positions of the whole robot that reach all targets, nearest to the seed first.

    Args:
        targets: Targets.
        solvers: Solver of each target; the solvers share no joints.
        seed: Joint positions of the whole robot [rad or m].
        timeout_s: Time limit for all solvers together [s]; None for the time limits of the groups.

    Raises:
        PlanningError: A target is unreachable.
    """
    solver_timeout_s = None if timeout_s is None else timeout_s / len(targets)
    max_solutions = max(1, int(MAX_COMBINATIONS ** (1.0 / len(targets))))
    solutions = []
    for target, solver in zip(targets, solvers, strict=True):
        solutions.append(target.solutions(solver, seed, solver_timeout_s)[:max_solutions])
        if not solutions[-1]:
            raise PlanningError(ErrorCode.NO_IK_SOLUTION, target.failure_reason(solver, seed))
    if len(targets) == 1:
        return solutions[0]
    combined = np.array([_combined_solution(seed, solvers, choice) for choice in product(*solutions)])
    combined = combined[np.argsort(np.linalg.norm(combined - seed, axis=1), kind="stable")]
    pairs = list(zip(targets, solvers, strict=True))
    missed = [
        target.link
        for target, solver in pairs
        if not target.is_reached(solver.model, combined[0], solver.settings.position_only)
    ]
    if missed:
        raise PlanningError(
            ErrorCode.NO_IK_SOLUTION,
            f"{', '.join(missed)} is moved by another subgroup of the request, so the targets cannot be solved "
            "separately; request one link of a group that is a chain",
        )
    return list(combined)


def sampled_solutions(
    scene: PlanningScene,
    group: JointGroup,
    targets: Sequence[IkTarget],
    solvers: Sequence[InverseKinematics],
    *,
    constraints: KinematicConstraints,
    end_s: float,
) -> Iterator[Array]:
    """Yields joint positions of the whole robot that reach all targets and satisfy the constraints.

    The first search starts at the scene's state, projected into the joint constraints; further searches start at random
    states that satisfy these constraints.

    Args:
        scene: Scene with the seed state.
        group: Group of joints to move.
        targets: Targets.
        solvers: Solver of each target.
        constraints: Constraints of the request.
        end_s: Deadline on time.monotonic() [s]; with math.inf, MAX_ATTEMPTS ends the search.
    """
    pairs = zip(targets, solvers, strict=True)
    poses = [target.constraints(scene, solver.settings.position_only) for target, solver in pairs]
    all_constraints = KinematicConstraints(
        scene.model,
        constraints.joints,
        [*constraints.positions, *(position for position, _ in poses)],
        [*constraints.orientations, *(orientation for _, orientations in poses for orientation in orientations)],
    )
    rng = np.random.default_rng(0)
    positions = all_constraints.project(scene.positions, group.indices)
    for attempt in count():
        if positions is not None:
            yield positions
        if attempt >= MAX_ATTEMPTS if math.isinf(end_s) else attempt >= MIN_ATTEMPTS and time.monotonic() > end_s:
            return
        positions = all_constraints.sample(rng, scene.positions, group.indices, attempts=1)


def _combined_solution(seed: Array, solvers: Sequence[InverseKinematics], solutions: Sequence[Array]) -> Array:
    """Returns the seed with each solver's joints, and their mimic joints, replaced by the solver's solution."""
    result = seed.copy()
    for solver, solution in zip(solvers, solutions, strict=True):
        joints = set(solver.group.indices.tolist())
        columns = sorted(joints | {follower for follower, leader, _, _ in solver.model.mimics if leader in joints})
        result[columns] = solution[columns]
    return result
