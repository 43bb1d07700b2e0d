# SPDX-License-Identifier: BSD-3-Clause
"""Cartesian paths: joint positions along straight lines between poses, with the reason if a path ends early.

The joints follow a line by continuation, so the arm configuration does not change along the line. Between two points
that are 1 cm apart, interpolation of the joint positions deviates from the line by less than 0.1 mm.
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

MAX_STEP_M = 0.01  # upper bound for max_step of a request
RADIANS_PER_METRE = 3.5  # a step of 0.01 m may rotate by 0.035 rad, as in MoveIt
MAX_STEPS = 50_000  # maximum number of steps per request
MIN_STEPS_FOR_MEAN = 10  # minimum number of steps per line for the mean step of jump detection

StepCheck = Callable[[Array, Array], str]


@dataclass(frozen=True, slots=True)
class JumpThresholds:
    """Thresholds of a joint-space jump between two points; 0 disables a threshold.

    Attributes:
        factor: Maximum ratio of a step to the mean step of its line, in joint space.
        prismatic: Maximum step of a prismatic joint [m].
        revolute: Maximum step of a revolute joint [rad].
    """

    factor: float = 0.0
    prismatic: float = 0.0
    revolute: float = 0.0


NO_JUMP_TEST = JumpThresholds()


@dataclass(frozen=True, slots=True, eq=False)
class StraightLine:
    """Followed part of the lines.

    Attributes:
        rows: Joint positions of the group, from the start, shape (n, joints) [rad or m].
        fraction: Followed fraction of the lines in [0, 1]; all lines have equal weight.
        stop: Reason why the path ends early; empty for a complete path.
        code: Error code of this reason.
    """

    rows: Array
    fraction: float
    stop: str
    code: ErrorCode


def accept_step(_before: Array, _after: Array) -> str:
    """Accepts every step."""
    return ""


def collision_check(checker: CollisionChecker, motion: MotionChecker, step: float) -> StepCheck:
    """Returns a function that rejects steps in collision and names the contacts.

    Args:
        checker: Collision checker of the scene.
        motion: Motion checker of the group.
        step: Distance between two checked states [rad or m].
    """

    def check_step(before: Array, after: Array) -> str:
        touching = motion.colliding_state(np.vstack([before, after]), step)
        if touching is None:
            return ""
        contacts = checker.contacts(motion.full_positions(touching), include_fixed=False)
        return "; ".join(item.describe() for item in contacts[:4]) or "a collision"

    return check_step


def straight_line(
    follower: PoseFollower,
    waypoints: Sequence[Transform],
    max_step_m: float,
    *,
    jumps: JumpThresholds = NO_JUMP_TEST,
    check_step: StepCheck = accept_step,
    carried: Transform | None = None,
) -> StraightLine:
    """Follows straight lines through waypoints until a step is not allowed.

    Args:
        follower: Kinematics of the link, starting at its rest state.
        waypoints: Poses of the moved frame in the planning frame.
        max_step_m: Maximum step [m].
        jumps: Thresholds of a joint-space jump.
        check_step: Function of the joint positions before and after a step; returns the reason to reject it, or "".
        carried: Pose of the moved frame in the link frame, such as the pose of a held object; None for the link frame.

    Raises:
        PlanningError: The step is not above 0 or gives more than 50,000 steps, a threshold is below 0, or there is no
            waypoint.
    """
    _require_usable(waypoints, max_step_m, jumps)
    rows = [follower.rest[follower.group.indices]]
    to_link = pin.SE3.Identity() if carried is None else carried.inverse()
    poses = [follower.pose(rows[0]) * to_link.inverse(), *waypoints]
    lines = [
        _Line(follower, (before, after, to_link), min(max_step_m, MAX_STEP_M), jumps, check_step)
        for before, after in zip(poses[:-1], poses[1:], strict=True)
    ]
    _require_countable(lines, max_step_m)
    for number, line in enumerate(lines):
        followed, stop, code = line.follow(rows[-1])
        rows += followed
        if stop:
            fraction = (number + len(followed) / line.count) / len(waypoints)
            reason = f"waypoint {number}, step {len(followed) + 1} of {line.count}: {stop}"
            return StraightLine(np.array(rows), fraction, reason, code)
    return StraightLine(np.array(rows), 1.0, "", ErrorCode.SUCCESS)


def _require_usable(waypoints: Sequence[Transform], max_step_m: float, jumps: JumpThresholds) -> None:
    if not waypoints:
        raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, "waypoints: the list is empty; give at least one pose")
    if len(waypoints) > MAX_STEPS:
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"waypoints: got {len(waypoints)}; allowed: at most {MAX_STEPS}; use fewer waypoints",
        )
    if not (np.isfinite(max_step_m) and max_step_m > 0.0):
        raise PlanningError(ErrorCode.FAILURE, f"max_step is {max_step_m}; allowed: more than 0 m")
    for name in ("factor", "prismatic", "revolute"):
        value = getattr(jumps, name)
        if not (np.isfinite(value) and value >= 0.0):
            raise PlanningError(
                ErrorCode.INVALID_MOTION_PLAN,
                f"jump threshold '{name}' is {value}; allowed: more than 0, or 0 to disable the threshold",
            )


def _require_countable(lines: Sequence[_Line], max_step_m: float) -> None:
    steps = sum(line.count for line in lines)
    if steps > MAX_STEPS:
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"{len(lines)} waypoints with max_step {max_step_m} m take "
            f"{steps} steps; allowed: at most {MAX_STEPS}; use a longer step or fewer waypoints",
        )


class _Line:
    """Straight line between two poses."""

    def __init__(
        self,
        follower: PoseFollower,
        ends: tuple[Transform, Transform, Transform],
        step_m: float,
        jumps: JumpThresholds,
        check_step: StepCheck,
    ) -> None:
        """Divides the line into steps.

        Args:
            follower: Kinematics of the link.
            ends: First and last pose of the moved frame, and pose of the link in the moved frame.
            step_m: Maximum step [m].
            jumps: Thresholds of a joint-space jump.
            check_step: Function that returns the reason to reject a step, or "".
        """
        start, end, self._to_link = ends
        self._follower, self._start, self._end = follower, start, end
        self._jumps, self._check_step = jumps, check_step
        self._rotation_vector = pin.log3(start.rotation.T @ end.rotation)
        length = float(np.linalg.norm(end.translation - start.translation))
        angle = float(np.linalg.norm(self._rotation_vector))
        self.count = max(
            1,
            int(np.ceil(max(length / step_m, angle / (RADIANS_PER_METRE * step_m)) - 1e-9)),
            MIN_STEPS_FOR_MEAN if jumps.factor > 0.0 else 1,
        )

    def _pose(self, number: int) -> Transform:
        fraction = number / self.count
        return (
            pin.SE3(
                self._start.rotation @ pin.exp3(fraction * self._rotation_vector),
                self._start.translation + fraction * (self._end.translation - self._start.translation),
            )
            * self._to_link
        )

    def follow(self, begin: Array) -> tuple[list[Array], str, ErrorCode]:
        """Returns the rows after the first, the reason for an early end ("" for none), and its error code."""
        rows, change = [begin], np.zeros_like(begin)
        stop, code = "", ErrorCode.SUCCESS
        for number in range(1, self.count + 1):
            try:
                values = self._follower.solve(rows[-1] + change, self._pose(number))
            except PlanningError as error:
                stop, code = error.reason, error.code
                break
            stop = self._jump(rows[-1], values) or self._check_step(rows[-1], values)
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
        """Returns the joint that exceeds an absolute threshold as text, or ""."""
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
        """Truncates the path before the first step that exceeds the jump factor; returns the path and the reason."""
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
            f"a step of {sizes[first]:.4f} in joint space, mostly by joint '{joint}', exceeds "
            f"jump_threshold {self._jumps.factor} times the mean step {sizes.mean():.4f}"
        )
