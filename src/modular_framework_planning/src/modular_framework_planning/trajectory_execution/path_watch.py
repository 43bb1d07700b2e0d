# SPDX-License-Identifier: BSD-3-Clause
"""Collision checks of the remaining path of a motion, after changes of the scene or of other joints."""

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

CHECK_STEP = 0.01  # maximum joint displacement between checked states [rad or m]
NAMED_CONTACTS = 4


@dataclass(frozen=True, slots=True, eq=False)
class PathCollision:
    """A colliding state on the remaining path; its contacts are computed on request, because this takes longer."""

    checker: CollisionChecker
    positions: Array
    accepted_pairs: frozenset[frozenset[str]] = frozenset()

    def describe(self) -> str:
        """Returns a description of the contacts, without accepted pairs if possible."""
        contacts = self.checker.contacts(self.positions, False)
        return describe_contacts(
            [item for item in contacts if _pair(item) not in self.accepted_pairs] or contacts, NAMED_CONTACTS
        )


class PathWatch:
    """Follows the robot along a motion; not thread-safe, except for `positions_at`."""

    def __init__(
        self,
        joint_names: Sequence[str],
        times: Array,
        rows: Array,
        planned_in: PlanningScene,
        *,
        new_checker: CollisionCheckerFactory = DEFAULT_CHECKER,
        was_planned: bool = True,
    ) -> None:
        """Samples the motion finely and stores the samples.

        Args:
            joint_names: Moving joints of the robot.
            times: Increasing times of the path points, shape (n,) [s].
            rows: Positions at the path points, shape (n, joints) [rad or m].
            planned_in: Scene in which the motion was planned, or starts.
            new_checker: Factory of collision checkers.
            was_planned: Whether the whole path was accepted in this scene, or only its first point.
        """
        self._model = planned_in.model
        self._indices = np.array([self._model.index[name] for name in joint_names], dtype=np.int64)
        self._times, self._rows = self._samples(np.asarray(times, dtype=float), np.asarray(rows, dtype=float))
        self._planned_in, self._new_checker, self._was_planned = planned_in, new_checker, was_planned
        members = set(self._indices.tolist())
        followers = {follower for follower, leader, _, _ in self._model.mimics if leader in members}
        other_joints = [index for index in range(len(self._model.joint_names)) if index not in members | followers]
        self._other_joints = np.array(other_joints, dtype=np.int64)
        self._seen_other_positions = planned_in.positions[self._other_joints]
        self._reached = 0

    def _samples(self, times: Array, rows: Array) -> tuple[Array, Array]:
        """Samples a polyline, including its points, with steps of at most CHECK_STEP; returns times and states."""
        steps = self._model.displacement(rows[:-1], rows[1:], self._indices)
        unwrapped_rows = np.vstack([rows[:1], rows[0] + np.cumsum(steps, axis=0)])
        counts = np.maximum(1, np.ceil(np.abs(steps).max(axis=1, initial=0.0) / CHECK_STEP)).astype(int)
        path_positions = np.concatenate([[0.0], *(index + np.arange(1, n + 1) / n for index, n in enumerate(counts))])
        point_indices = np.arange(len(times), dtype=float)
        return np.interp(path_positions, point_indices, times), _rows_at(path_positions, point_indices, unwrapped_rows)

    def advance(self, positions: Array) -> None:
        """Advances the progress along the path to the positions of the whole robot; progress never decreases."""
        displacement = self._model.displacement(positions[self._indices], self._rows, self._indices)
        distances = np.linalg.norm(displacement, axis=1)
        while self._reached + 1 < len(distances) and distances[self._reached + 1] <= distances[self._reached]:
            self._reached += 1

    def positions_at(self, after_s: Array) -> Array:
        """Returns the predicted positions of the moving joints at times from now [s], shape (times, joints)."""
        return _rows_at(self._times[self._reached] + after_s, self._times, self._rows)

    def scene_collision(self, scene: PlanningScene) -> PathCollision | None:
        """Returns the first collision of the remaining path in a scene, or None.

        The watch ignores states that already collided in the scene of the plan and were accepted by the planner, such
        as a start in contact or an attached object on a table.
        """
        checker, motion = self._checkers(scene)
        rest = self._rows[self._reached :]
        if motion.colliding_state(rest, CHECK_STEP) is None:
            return None
        _, before = self._checkers(self._planned_in.with_positions(scene.positions))
        for values in rest:
            if not motion.state_is_free(values) and before.state_is_free(values):
                return PathCollision(checker, motion.full_positions(values))
        return None

    def other_joints_moved(self, positions: Array) -> bool:
        """Checks whether a joint outside the motion has moved by more than CHECK_STEP since the last True result.

        Args:
            positions: Positions of the whole robot [rad or m].
        """
        now = positions[self._other_joints]
        displacement = self._model.displacement(self._seen_other_positions, now, self._other_joints)
        if np.abs(displacement).max(initial=0.0) <= CHECK_STEP:
            return False
        self._seen_other_positions = now
        return True

    def robot_collision(
        self, scene: PlanningScene, others: Sequence[PathWatch] = (), leads_s: Sequence[float] = (0.0,)
    ) -> PathCollision | None:
        """Returns the first self-collision on the remaining path, or None.

        Contacts that existed when the motion was planned are ignored; for an unplanned motion, contacts at its first
        point are ignored.

        Args:
            scene: Current scene, whose positions are kept by all joints without motion.
            others: Other motions in progress, whose predicted positions are used.
            leads_s: Times by which the other motions may be ahead of their prediction, all of which are checked [s].
        """
        checker = self._new_checker(_robot_only(scene), self._indices)
        for lead_s in leads_s:
            states = self._joint_motion_states(scene, others, lead_s)
            if checker.colliding_state(states, CHECK_STEP) is not None:
                collision = self._new_contact(checker, states)
                if collision is not None:
                    return collision
        return None

    def _new_contact(self, checker: CollisionChecker, states: Array) -> PathCollision | None:
        """Returns the first state with a contact that did not exist when the motion was planned, or None."""
        planned = _robot_only(self._planned_in)
        before = self._new_checker(planned, self._indices)
        accepted = MotionChecker(before, self._indices, planned.positions)
        for state in states:
            if checker.is_free(state):
                continue
            own_values = state[self._indices] if self._was_planned else self._rows[0]
            if accepted.state_is_free(own_values):
                return PathCollision(checker, state)
            accepted_pairs = frozenset(
                _pair(item) for item in before.contacts(accepted.full_positions(own_values), False)
            )
            if any(_pair(item) not in accepted_pairs for item in checker.contacts(state, False)):
                return PathCollision(checker, state, accepted_pairs)
        return None

    def _joint_motion_states(self, scene: PlanningScene, others: Sequence[PathWatch], lead_s: float) -> Array:
        """Predicts the states of the whole robot until all motions have ended, with steps of at most CHECK_STEP."""
        watches = (self, *others)
        times_s = np.unique(np.concatenate([watch._times[watch._reached :] - watch._now_s for watch in watches]))
        result = np.tile(scene.positions, (len(times_s), 1))
        for watch in watches:
            ahead_s = 0.0 if watch is self else lead_s
            result[:, watch._indices] = watch.positions_at(np.maximum(times_s + ahead_s, 0.0))
        moved_joints = {index for watch in watches for index in watch._indices.tolist()}
        for follower, leader, multiplier, offset in self._model.mimics:
            if leader in moved_joints and follower not in moved_joints:
                result[:, follower] = multiplier * result[:, leader] + offset
        return result

    @property
    def _now_s(self) -> float:
        return float(self._times[self._reached])

    def _checkers(self, scene: PlanningScene) -> tuple[CollisionChecker, MotionChecker]:
        checker = self._new_checker(scene, self._indices)
        return checker, MotionChecker(checker, self._indices, scene.positions)


def _robot_only(scene: PlanningScene) -> PlanningScene:
    """Returns the scene with only the robot and its attached objects."""
    return scene.without_objects().with_octomap(None)


def _rows_at(path_positions: Array, knots: Array, rows: Array) -> Array:
    return np.column_stack([np.interp(path_positions, knots, column) for column in rows.T])


def _pair(contact: Contact) -> frozenset[str]:
    return frozenset((contact.first.name, contact.second.name))
