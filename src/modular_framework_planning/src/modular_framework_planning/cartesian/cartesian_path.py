# SPDX-License-Identifier: BSD-3-Clause
"""Cartesian paths: straight lines between poses as joint positions, how far they go, and why they end early.

The joints follow the line by continuation, so they cannot change the arm's posture on the way; between two rows the
straight motion of the joints keeps the link within a tenth of a millimetre of the line for steps of a centimetre.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker
from modular_framework_planning.planning_interface.motion_check import MotionChecker

LONGEST_STEP_M = 0.01  # a longer max_step is followed in steps of this length
RADIANS_PER_METRE = 3.5  # a step of 0.01 m may turn by 0.035 rad, as in MoveIt
MAX_STEPS = 50_000  # of one request
MIN_STEPS_FOR_MEAN = 10  # of a line, where a jump is judged by the mean step

Objection = Callable[[Array, Array], str]


@dataclass(frozen=True, slots=True)
class JumpThresholds:
    """Thresholds of a joint-space jump between two steps; 0 switches a test off.

    Attributes:
        factor: a step further than this times the mean step of its line, in joint space.
        prismatic: change of a prismatic joint [m].
        revolute: change of a revolute joint [rad].
    """

    factor: float = 0.0
    prismatic: float = 0.0
    revolute: float = 0.0


NO_JUMP_TEST = JumpThresholds()


@dataclass(frozen=True, slots=True, eq=False)
class StraightLine:
    """The part of the lines that was followed.

    Attributes:
        rows: joint values of the group, the start first, shape (n, joints).
        fraction: of the lines, each line counting the same, in [0, 1].
        waypoint_rows: the row of each waypoint that was reached.
        stop: why the lines were not followed to their end; empty if they were.
        code: error code of that cause.
    """

    rows: Array
    fraction: float
    waypoint_rows: tuple[int, ...]
    stop: str
    code: ErrorCode


def no_objection(_before: Array, _after: Array) -> str:
    """Allows every step."""
    return ""


def collision_objection(checker: CollisionChecker, motion: MotionChecker, step: float) -> Objection:
    """Refuses steps that touch something and names the contact.

    Args:
        checker: of the scene.
        motion: of the group.
        step: between two checked states [rad or m].
    """

    def objection(before: Array, after: Array) -> str:
        touching = motion.colliding_state(np.vstack([before, after]), step)
        if touching is None:
            return ""
        contacts = checker.contacts(motion.full_positions(touching), include_fixed=False)
        return "; ".join(item.describe() for item in contacts[:4]) or "a collision"

    return objection


def straight_line(
    follower: PoseFollower,
    waypoints: Sequence[Transform],
    max_step_m: float,
    *,
    jumps: JumpThresholds = NO_JUMP_TEST,
    objection: Objection = no_objection,
    carried: Transform | None = None,
) -> StraightLine:
    """Follows straight lines through waypoints until something is in the way.

    Args:
        follower: kinematics of the link that follows the lines, or carries what follows them, from its rest state.
        waypoints: poses in the planning frame of what follows the lines.
        max_step_m: longest step [m].
        jumps: what counts as a jump.
        objection: takes the joint values before and after each step; returns why it is not allowed, or "".
        carried: pose, in the link's frame, of what follows the lines (a held object); None: the link itself does.

    Raises:
        PlanningError: the step is not above 0 or gives more than 50,000 steps, a threshold is below 0, or there is no
            waypoint.
    """
    _require_usable(waypoints, max_step_m, jumps)
    rows = [follower.rest[follower.group.indices]]
    reached: list[int] = []
    to_link = pin.SE3.Identity() if carried is None else carried.inverse()
    poses = [follower.pose(rows[0]) * to_link.inverse(), *waypoints]
    lines = [
        _Line(follower, (before, after, to_link), min(max_step_m, LONGEST_STEP_M), jumps, objection)
        for before, after in zip(poses[:-1], poses[1:], strict=True)
    ]
    _require_countable(lines, max_step_m)
    for number, line in enumerate(lines):
        followed, stop, code = line.follow(rows[-1])
        rows += followed
        if stop:
            fraction = (number + len(followed) / line.count) / len(waypoints)
            return StraightLine(
                np.array(rows),
                fraction,
                tuple(reached),
                f"waypoint {number}, step {len(followed) + 1} of {line.count}: {stop}",
                code,
            )
        reached.append(len(rows) - 1)
    return StraightLine(np.array(rows), 1.0, tuple(reached), "", ErrorCode.SUCCESS)


def _require_usable(waypoints: Sequence[Transform], max_step_m: float, jumps: JumpThresholds) -> None:
    if not waypoints:
        raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, "waypoints: there is none; give at least one pose")
    if len(waypoints) > MAX_STEPS:
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"waypoints: {len(waypoints)}; at most {MAX_STEPS} are followed: thin them out",
        )
    if not (np.isfinite(max_step_m) and max_step_m > 0.0):
        raise PlanningError(ErrorCode.FAILURE, f"max_step is {max_step_m}; a length above 0 m is needed")
    for name in ("factor", "prismatic", "revolute"):
        value = getattr(jumps, name)
        if not (np.isfinite(value) and value >= 0.0):
            raise PlanningError(
                ErrorCode.INVALID_MOTION_PLAN,
                f"jump threshold '{name}' is {value}; it must be above 0, or 0 for no such test",
            )


def _require_countable(lines: Sequence[_Line], max_step_m: float) -> None:
    steps = sum(line.count for line in lines)
    if steps > MAX_STEPS:
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"{len(lines)} waypoints with max_step {max_step_m} m take "
            f"{steps} steps; at most {MAX_STEPS} are followed: choose a longer step or fewer lines",
        )


class _Line:
    """One straight line."""

    def __init__(
        self,
        follower: PoseFollower,
        ends: tuple[Transform, Transform, Transform],
        step_m: float,
        jumps: JumpThresholds,
        objection: Objection,
    ) -> None:
        """Divides the line into steps.

        Args:
            follower: solves for the joints.
            ends: first and last pose of what follows the line, and pose of the follower's link in its frame.
            step_m: longest step [m].
            jumps: what counts as a jump.
            objection: says why a step is not allowed, or nothing.
        """
        start, end, self._to_link = ends
        self._follower, self._start, self._end = follower, start, end
        self._jumps, self._objection = jumps, objection
        self._turn = pin.log3(start.rotation.T @ end.rotation)
        length = float(np.linalg.norm(end.translation - start.translation))
        angle = float(np.linalg.norm(self._turn))
        self.count = max(
            1,
            int(np.ceil(max(length / step_m, angle / (RADIANS_PER_METRE * step_m)) - 1e-9)),
            MIN_STEPS_FOR_MEAN if jumps.factor > 0.0 else 1,
        )

    def _pose(self, number: int) -> Transform:
        share = number / self.count
        return (
            pin.SE3(
                self._start.rotation @ pin.exp3(share * self._turn),
                self._start.translation + share * (self._end.translation - self._start.translation),
            )
            * self._to_link
        )

    def follow(self, begin: Array) -> tuple[list[Array], str, ErrorCode]:
        """Returns the rows after the first, why they end early ("" if they do not) and the code of that."""
        rows, change = [begin], np.zeros_like(begin)
        stop, code = "", ErrorCode.SUCCESS
        for number in range(1, self.count + 1):
            try:
                values = self._follower.solve(rows[-1] + change, self._pose(number))
            except PlanningError as error:
                stop, code = error.reason, error.code
                break
            stop = self._jump(rows[-1], values) or self._objection(rows[-1], values)
            if stop:
                code = ErrorCode.INVALID_MOTION_PLAN
                break
            change = values - rows[-1]
            rows.append(values)
        kept, jump = self._without_far_step(rows)
        if jump:
            stop, code = jump, ErrorCode.INVALID_MOTION_PLAN
        return kept[1:], stop, code

    def _jump(self, before: Array, after: Array) -> str:
        """Tests a step by the absolute thresholds."""
        group, kinds = self._follower.group, self._follower.model.document.joint_kinds
        for joint, low, high in zip(group.joints, before, after, strict=True):
            prismatic = kinds[joint] == "prismatic"
            limit = self._jumps.prismatic if prismatic else self._jumps.revolute
            if limit > 0.0 and abs(high - low) > limit:
                return (
                    f"joint '{joint}' jumps by {abs(high - low):.4f} {'m' if prismatic else 'rad'}; "
                    f"{'prismatic' if prismatic else 'revolute'}_jump_threshold allows {limit}"
                )
        return ""

    def _without_far_step(self, rows: list[Array]) -> tuple[list[Array], str]:
        """Cuts the rows before the first step that is far above the mean."""
        if self._jumps.factor <= 0.0 or len(rows) < 3:
            return rows, ""
        changes = np.diff(np.array(rows), axis=0)
        sizes = np.linalg.norm(changes, axis=1)
        far = np.flatnonzero(sizes > self._jumps.factor * sizes.mean())
        if not len(far):
            return rows, ""
        first = int(far[0])
        joint = self._follower.group.joints[int(np.abs(changes[first]).argmax())]
        return rows[: first + 1], (
            f"a step of {sizes[first]:.4f} in joint space, most of it by joint '{joint}', is "
            f"more than jump_threshold {self._jumps.factor} times the mean {sizes.mean():.4f}"
        )
