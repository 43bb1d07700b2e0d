# SPDX-License-Identifier: BSD-3-Clause
"""Checks the remaining path of a motion in progress when the scene or another part of the robot changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modular_framework_planning.contacts import Contact, describe_contacts
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker, CollisionCheckerFactory
from modular_framework_planning.planning_interface.collision_detectors import DEFAULT_CHECKER
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_scene.planning_scene import PlanningScene

CHECK_STEP = 0.01  # [rad or m, any joint]
NAMED_CONTACTS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Hit:
    """A state on the rest of a motion in which bodies touch that may not; naming them takes longer than finding it."""

    checker: CollisionChecker
    positions: Array
    known: frozenset[frozenset[str]] = frozenset()

    def describe(self) -> str:
        """Says which bodies touch; those that were known to are left out."""
        found = self.checker.contacts(self.positions, False)
        return describe_contacts([item for item in found if _pair(item) not in self.known] or found, NAMED_CONTACTS)


class PathWatch:
    """Follows the robot along one motion. Not for use from two threads at a time, but for `positions_at`."""

    def __init__(
        self,
        joint_names: Sequence[str],
        times: Array,
        rows: Array,
        planned_in: PlanningScene,
        new_checker: CollisionCheckerFactory = DEFAULT_CHECKER,
        was_planned: bool = True,
    ) -> None:
        """Takes a motion.

        Args:
            joint_names: joints of the motion; all of them are joints of the robot.
            times: of the points of the path, increasing, shape (n,) [s].
            rows: positions at these points, shape (n, joints) [rad or m].
            planned_in: the scene in which the motion was found to be acceptable, or in which it begins.
            new_checker: makes the collision checkers.
            was_planned: whether the path was found to be acceptable in that scene; else only its first point was.
        """
        self._model = planned_in.model
        self._indices = np.array([self._model.index[name] for name in joint_names], dtype=np.int64)
        self._times, self._rows = self._samples(np.asarray(times, dtype=float), np.asarray(rows, dtype=float))
        self._planned_in, self._new_checker, self._was_planned = planned_in, new_checker, was_planned
        members = set(self._indices.tolist())
        followers = {follower for follower, leader, _, _ in self._model.mimics if leader in members}
        elsewhere = [number for number in range(len(self._model.joint_names)) if number not in members | followers]
        self._elsewhere = np.array(elsewhere, dtype=np.int64)
        self._seen_elsewhere = planned_in.positions[self._elsewhere]
        self._reached = 0

    def _samples(self, times: Array, rows: Array) -> tuple[Array, Array]:
        """Returns times and states of a polyline at most CHECK_STEP apart, its points included."""
        steps = self._model.way(rows[:-1], rows[1:], self._indices)
        straight = np.vstack([rows[:1], rows[0] + np.cumsum(steps, axis=0)])
        counts = np.maximum(1, np.ceil(np.abs(steps).max(axis=1, initial=0.0) / CHECK_STEP)).astype(int)
        at = np.concatenate([[0.0], *(number + np.arange(1, n + 1) / n for number, n in enumerate(counts))])
        numbers = np.arange(len(times), dtype=float)
        return np.interp(at, numbers, times), _rows_at(at, numbers, straight)

    def advance(self, positions: Array) -> None:
        """Updates the progress along the path from positions of the whole robot; the progress never decreases."""
        way = self._model.way(positions[self._indices], self._rows, self._indices)
        gaps = np.linalg.norm(way, axis=1)
        while self._reached + 1 < len(gaps) and gaps[self._reached + 1] <= gaps[self._reached]:
            self._reached += 1

    def positions_at(self, after_s: Array) -> Array:
        """Returns where the motion's joints will be at times from now [s], shape (times, joints) [rad or m]."""
        return _rows_at(self._times[self._reached] + after_s, self._times, self._rows)

    def blocked_by(self, scene: PlanningScene) -> Hit | None:
        """Returns where the rest of the motion collides in this scene, or None.

        States that collided already in the scene the motion was planned in do not count: the planner accepted them
        (a start in contact, a held object on its table).
        """
        checker, motion = self._checkers(scene)
        rest = self._rows[self._reached :]
        if motion.colliding_state(rest, CHECK_STEP) is None:
            return None
        _, before = self._checkers(self._planned_in.with_positions(scene.positions))
        for values in rest:
            if not motion.state_is_free(values) and before.state_is_free(values):
                return Hit(checker, motion.full_positions(values))
        return None

    def elsewhere_moved(self, positions: Array) -> bool:
        """Returns whether another joint of the robot moved since the last call that returned true.

        Args:
            positions: of the whole robot; moved is by more than CHECK_STEP.
        """
        now = positions[self._elsewhere]
        way = self._model.way(self._seen_elsewhere, now, self._elsewhere)
        if np.abs(way).max(initial=0.0) <= CHECK_STEP:
            return False
        self._seen_elsewhere = now
        return True

    def robot_in_the_way(
        self, scene: PlanningScene, others: Sequence[PathWatch] = (), slacks_s: Sequence[float] = (0.0,)
    ) -> Hit | None:
        """Returns where the rest of the motion hits another part of the robot, or None.

        Objects of the world do not count. Bodies that touched already with the other joints where they were when the
        motion was planned do not count either; where that is not known, those that touched at its first point.

        Args:
            scene: as it is now; joints that no other motion moves stay where they are.
            others: the other motions under way: each joint of theirs is taken to be where it will be at that time.
            slacks_s: by how much each of them may be ahead of its time [s]; each is checked.
        """
        checker = self._new_checker(_robot_alone(scene), self._indices)
        for slack_s in slacks_s:
            together = self._together(scene, others, slack_s)
            if checker.colliding_state(together, CHECK_STEP) is not None:
                hit = self._new_contact(checker, together)
                if hit is not None:
                    return hit
        return None

    def _new_contact(self, checker: CollisionChecker, states: Array) -> Hit | None:
        """Returns the first state with a contact that was not accepted when the motion was planned, or None."""
        planned = _robot_alone(self._planned_in)
        before = self._new_checker(planned, self._indices)
        accepted = MotionChecker(before, self._indices, planned.positions)
        for state in states:
            if checker.is_free(state):
                continue
            own = state[self._indices] if self._was_planned else self._rows[0]
            if accepted.state_is_free(own):
                return Hit(checker, state)
            known = frozenset(_pair(item) for item in before.contacts(accepted.full_positions(own), False))
            if any(_pair(item) not in known for item in checker.contacts(state, False)):
                return Hit(checker, state, known)
        return None

    def _together(self, scene: PlanningScene, others: Sequence[PathWatch], slack_s: float) -> Array:
        """Returns states of the whole robot from now until all motions have ended, at most CHECK_STEP apart."""
        watches = (self, *others)
        after = np.unique(np.concatenate([watch._times[watch._reached :] - watch._now_s for watch in watches]))
        result = np.tile(scene.positions, (len(after), 1))
        for watch in watches:
            ahead_s = 0.0 if watch is self else slack_s
            result[:, watch._indices] = watch.positions_at(np.maximum(after + ahead_s, 0.0))
        moved = {number for watch in watches for number in watch._indices.tolist()}
        for follower, leader, multiplier, offset in self._model.mimics:
            if leader in moved and follower not in moved:
                result[:, follower] = multiplier * result[:, leader] + offset
        return result

    @property
    def _now_s(self) -> float:
        return float(self._times[self._reached])

    def _checkers(self, scene: PlanningScene) -> tuple[CollisionChecker, MotionChecker]:
        checker = self._new_checker(scene, self._indices)
        return checker, MotionChecker(checker, self._indices, scene.positions)


def _robot_alone(scene: PlanningScene) -> PlanningScene:
    """Returns the scene without a world: the robot and what it holds."""
    return scene.without_objects().with_octomap(None)


def _rows_at(at: Array, known_at: Array, rows: Array) -> Array:
    return np.column_stack([np.interp(at, known_at, column) for column in rows.T])


def _pair(contact: Contact) -> frozenset[str]:
    return frozenset((contact.first.name, contact.second.name))
