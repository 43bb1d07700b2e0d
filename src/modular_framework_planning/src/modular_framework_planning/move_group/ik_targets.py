# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics of a request with one link to place, or with one for each of several subgroups."""

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
from modular_framework_planning.errors import ErrorCode, PlanningError, UnknownNameError
from modular_framework_planning.geometry.regions import SphereSolid
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics, KinematicsPool
from modular_framework_planning.messages.constraint_conversions import frame_on_robot, holding_link
from modular_framework_planning.messages.poses import stamped_in_scene
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel

MIN_TRIES = 32  # made even after the timeout, so that a busy machine does not report reachable poses as unreachable
MAX_TRIES = 1024  # where the clock must not decide
MOST_COMBINED = 256  # solutions of several subgroups put together
REACHED = 1.0e-4  # [m and rad]; a subgroup that another one carries does not reach its pose in their combination


@dataclass(frozen=True, slots=True, eq=False)
class IkTarget:
    """A link and the pose to bring it to.

    Attributes:
        link: the link that is moved.
        placed: pose, in the link's frame, of the frame to place: the link itself, a held object or a subframe of it.
        target: its target pose in the planning frame.
    """

    link: str
    placed: Transform
    target: Transform

    def solutions(self, solver: InverseKinematics, seed: Array, timeout_s: float | None) -> list[Array]:
        """Returns positions of the whole robot, nearest to the seed first.

        The orientation is left open where the group's settings ask for the position only.
        """
        if solver.settings.position_only:
            return solver.position_solutions(
                self.link, self.placed.translation, self.target.translation, seed, timeout_s
            )
        return solver.solutions(self.link, self.target * self.placed.inverse(), seed, timeout_s)

    def constraints(
        self, scene: PlanningScene, position_only: bool
    ) -> tuple[PositionConstraint, list[OrientationConstraint]]:
        """Returns the target as a position constraint, and as an orientation constraint if that is not left open."""
        link, world = frame_on_robot(scene, self.link), frame_on_robot(scene, "")
        place = pin.SE3(np.eye(3), self.target.translation)
        position = PositionConstraint(link, self.placed.translation, world, ((SphereSolid(0.0), place),))
        rotation = self.target.rotation @ self.placed.rotation.T
        kind = Parameterization.ROTATION_VECTOR
        return position, [] if position_only else [OrientationConstraint(link, world, rotation, np.zeros(3), kind)]

    def is_reached(self, model: RobotModel, positions: Array, position_only: bool) -> bool:
        """Returns whether the frame is at its target."""
        gap = self.target.actInv(model.link_transforms(positions)[self.link] * self.placed)
        turned = 0.0 if position_only else float(np.abs(gap.rotation - np.eye(3)).max())
        return max(float(np.abs(gap.translation).max()), turned) < REACHED

    def failure_reason(self, solver: InverseKinematics, seed: Array) -> str:
        """Says why there is no solution."""
        if solver.settings.position_only:
            where = np.array2string(self.target.translation, precision=3, separator=", ")
            return (
                f"no inverse kinematics for '{self.link}': no joint positions within the bounds of group "
                f"'{solver.group.name}' reach the position {where} m, whatever the orientation (position_only_ik)"
            )
        return solver.explain_unreachable(self.link, self.target * self.placed.inverse(), seed)


def ik_targets(scene: PlanningScene, group: JointGroup, request: Any) -> list[IkTarget]:
    """Reads what a moveit_msgs/PositionIKRequest asks for: ik_link_name and pose_stamped, or the lists of several.

    Raises:
        PlanningError: numbers of links and poses differ, a link is named twice or unknown, or a pose has no meaning.
    """
    links, poses = list(request.ik_link_names), list(request.pose_stamped_vector)
    if len(links) <= 1 and len(poses) <= 1:
        links, poses = [links[0] if links else request.ik_link_name], poses or [request.pose_stamped]
    if len(links) != len(poses):
        raise PlanningError(
            ErrorCode.INVALID_LINK_NAME,
            f"{len(links)} ik_link_names ({', '.join(links) or 'none'}) and {len(poses)} poses in pose_stamped_vector; "
            "one link for each pose is needed",
        )
    repeated = sorted({name for name in links if links.count(name) > 1})
    if repeated:
        raise PlanningError(
            ErrorCode.INVALID_LINK_NAME, f"ik_link_names has {', '.join(repeated)} twice; give each link one pose"
        )
    return [_target(scene, group, *item) for item in zip(links, poses, strict=True)]


def _target(scene: PlanningScene, group: JointGroup, link_name: str, pose: Any) -> IkTarget:
    name = (link_name or group.tip_link).removeprefix("/")
    target = stamped_in_scene(scene, pose, "pose_stamped")
    if not name:
        raise PlanningError(
            ErrorCode.INVALID_LINK_NAME,
            f"no link is named, and group '{group.name}' has no tip of its own; name the links in ik_link_names, which "
            f"has one for each pose of pose_stamped_vector ({_ends(scene.model, _subgroups(scene.model, group))})",
        )
    link = holding_link(scene, name)
    if not link:
        raise UnknownNameError(ErrorCode.INVALID_LINK_NAME, "link", name, [*scene.model.frame_ids, *scene.attached])
    return IkTarget(link, scene.frame_transform(link).actInv(scene.frame_transform(name)), target)


def solvers_of(kinematics: KinematicsPool, model: RobotModel, group: JointGroup, links: Sequence[str]) -> list[Any]:
    """Returns a solver for each link: the group's own for one link of a chain, else that of a subgroup with that tip.

    Raises:
        PlanningError: a link is the end of no subgroup, or those of two links share joints.
    """
    if len(links) == 1 and group.is_chain:
        return [kinematics.solver(group.name)]
    inner = _subgroups(model, group)
    if not inner:
        kind = "is one chain of joints, for one link" if group.is_chain else "holds no group that is a chain of joints"
        raise PlanningError(
            ErrorCode.NO_IK_SOLUTION,
            f"group '{group.name}' {kind}; got {len(links)} links to place ({', '.join(links)}), and inverse "
            "kinematics needs a chain from a base link to a tip link for each of them",
        )
    fitting = [[item for item in inner if _moves(model, item, link)] for link in links]
    without = [link for link, found in zip(links, fitting, strict=True) if not found]
    if without:
        raise PlanningError(
            ErrorCode.NO_IK_SOLUTION,
            f"no subgroup of '{group.name}' ends at {', '.join(without)}; {_ends(model, inner)}: name these, or links "
            "rigidly fixed to them",
        )
    chosen = next((option for option in product(*fitting) if _share_nothing(option)), None)
    if chosen is None:
        raise PlanningError(
            ErrorCode.NO_IK_SOLUTION,
            f"the subgroups of '{group.name}' that end at {', '.join(links)} share joints, so they have no solution "
            f"each of its own; {_ends(model, inner)}: name links of different ones",
        )
    return [kinematics.solver(item.name) for item in chosen]


def _subgroups(model: RobotModel, group: JointGroup) -> list[JointGroup]:
    """Returns the chains within a group: those the SRDF puts into it first, then those with most joints."""
    named = model.semantics.groups[group.name].subgroups
    inner = [item for item in model.groups.values() if item.is_chain and set(item.joints) < set(group.joints)]
    return sorted(inner, key=lambda item: (item.name not in named, -len(item.joints)))


def _ends(model: RobotModel, groups: Sequence[JointGroup]) -> str:
    return "subgroups and their tips: " + (", ".join(f"{item.name} ({item.tip_link})" for item in groups) or "none")


def _moves(model: RobotModel, group: JointGroup, link: str) -> bool:
    """Whether a link is at the end of a chain."""
    return model.is_carried(link, model.document.joint_children[group.joints[-1]])


def _share_nothing(groups: Sequence[JointGroup]) -> bool:
    joints = [joint for group in groups for joint in group.joints]
    return len(joints) == len(set(joints))


def combined_solutions(
    targets: Sequence[IkTarget], solvers: Sequence[InverseKinematics], seed: Array, timeout_s: float | None
) -> list[Array]:
    """Returns positions of the whole robot that bring each link to its target, nearest to the seed first.

    Args:
        targets: what to place.
        solvers: of these, in the same order; they share no joints.
        seed: positions of the whole robot [rad or m].
        timeout_s: for all solvers together; None: the groups' own.

    Raises:
        PlanningError: a target cannot be reached; says which and why.
    """
    share_s = None if timeout_s is None else timeout_s / len(targets)
    most = max(1, int(MOST_COMBINED ** (1.0 / len(targets))))
    found = []
    for target, solver in zip(targets, solvers, strict=True):
        found.append(target.solutions(solver, seed, share_s)[:most])
        if not found[-1]:
            raise PlanningError(ErrorCode.NO_IK_SOLUTION, target.failure_reason(solver, seed))
    if len(targets) == 1:
        return found[0]
    together = np.array([_joined(seed, solvers, choice) for choice in product(*found)])
    together = together[np.argsort(np.linalg.norm(together - seed, axis=1), kind="stable")]
    parts = list(zip(targets, solvers, strict=True))
    missed = [item.link for item, by in parts if not item.is_reached(by.model, together[0], by.settings.position_only)]
    if missed:
        raise PlanningError(
            ErrorCode.NO_IK_SOLUTION,
            f"{', '.join(missed)} is carried by another subgroup of the request, so each cannot be solved for alone; "
            "ask for one link of a group that is one chain",
        )
    return list(together)


def sampled_solutions(
    scene: PlanningScene,
    group: JointGroup,
    targets: Sequence[IkTarget],
    solvers: Sequence[InverseKinematics],
    constraints: KinematicConstraints,
    end_s: float,
) -> Iterator[Array]:
    """Yields positions of the whole robot that bring each link to its target and keep the constraints.

    The first one is sought from the scene's state with its joints moved within their constraints, the others from
    random states within these.

    Args:
        scene: the seed.
        group: the joints that may move.
        targets: what to place.
        solvers: of these, in the same order.
        constraints: of the request.
        end_s: time.monotonic() at which the search ends; with math.inf the number of tries does.
    """
    pairs = zip(targets, solvers, strict=True)
    poses = [target.constraints(scene, solver.settings.position_only) for target, solver in pairs]
    together = KinematicConstraints(
        scene.model,
        constraints.joints,
        [*constraints.positions, *(position for position, _ in poses)],
        [*constraints.orientations, *(turn for _, turns in poses for turn in turns)],
    )
    rng = np.random.default_rng(0)
    found = together.project(scene.positions, group.indices)
    for number in count():
        if found is not None:
            yield found
        if number >= MAX_TRIES if math.isinf(end_s) else number >= MIN_TRIES and time.monotonic() > end_s:
            return
        found = together.sample(rng, scene.positions, group.indices, attempts=1)


def _joined(seed: Array, solvers: Sequence[InverseKinematics], solutions: Sequence[Array]) -> Array:
    """Returns the seed with each solver's joints, and those that follow them, as in its solution."""
    result = seed.copy()
    for solver, solution in zip(solvers, solutions, strict=True):
        own = set(solver.group.indices.tolist())
        columns = sorted(own | {follower for follower, leader, _, _ in solver.model.mimics if leader in own})
        result[columns] = solution[columns]
    return result
