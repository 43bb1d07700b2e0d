# SPDX-License-Identifier: BSD-3-Clause
"""Checks the remaining path of a motion in progress when the scene changes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker, CollisionCheckerFactory
from modular_framework_planning.planning_interface.collision_detectors import DEFAULT_CHECKER
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_scene.planning_scene import PlanningScene

CHECK_STEP = 0.01  # [rad or m, any joint]


class PathWatch:
    """Follows the robot along one motion. Not for use from two threads at a time."""

    def __init__(
        self,
        joint_names: Sequence[str],
        rows: Array,
        planned_in: PlanningScene,
        new_checker: CollisionCheckerFactory = DEFAULT_CHECKER,
    ) -> None:
        """Takes a motion.

        Args:
            joint_names: joints of the motion; all of them are joints of the robot.
            rows: positions along the path, in order, shape (n, joints) [rad or m].
            planned_in: the scene in which the motion was found to be acceptable.
            new_checker: makes the collision checkers.
        """
        self._indices = np.array([planned_in.model.index[name] for name in joint_names], dtype=np.int64)
        self._rows = np.asarray(rows, dtype=float)
        self._planned_in, self._new_checker = planned_in, new_checker
        self._reached = 0

    def advance(self, positions: Array) -> None:
        """Updates the progress along the path from positions of the whole robot; the progress never decreases."""
        way = self._planned_in.model.way(positions[self._indices], self._rows, self._indices)
        gaps = np.linalg.norm(way, axis=1)
        while self._reached + 1 < len(gaps) and gaps[self._reached + 1] <= gaps[self._reached]:
            self._reached += 1

    def blocked_by(self, scene: PlanningScene) -> str:
        """Describes what the rest of the motion collides with in this scene; "" if it is free.

        States that collided already in the scene the motion was planned in do not count: the planner accepted them
        (a start in contact, a held object on its table).
        """
        checker, motion = self._checkers(scene)
        rest = self._rows[self._reached :]
        if motion.colliding_state(rest, CHECK_STEP) is None:
            return ""
        _, before = self._checkers(self._planned_in.with_positions(scene.positions))
        for values in _samples(rest):
            if not motion.state_is_free(values) and before.state_is_free(values):
                return "; ".join(item.describe() for item in checker.contacts(motion.full_positions(values), False)[:4])
        return ""

    def _checkers(self, scene: PlanningScene) -> tuple[CollisionChecker, MotionChecker]:
        checker = self._new_checker(scene, self._indices)
        return checker, MotionChecker(checker, self._indices, scene.positions)


def _samples(rows: Array) -> Array:
    """Returns the states of a polyline at most CHECK_STEP apart, ends included."""
    pieces = [rows[:1]]
    for start, end in zip(rows[:-1], rows[1:], strict=True):
        count = max(1, int(np.ceil(float(np.abs(end - start).max()) / CHECK_STEP)))
        pieces.append(start + np.arange(1, count + 1)[:, None] / count * (end - start))
    return np.vstack(pieces)
