# SPDX-License-Identifier: BSD-3-Clause
"""Request digests, so that seeds do not depend on the order in which threads send requests."""

from __future__ import annotations

import hashlib
import threading
from collections import Counter

import numpy as np

from modular_framework_planning.planning_interface.planning_request import JointGoal, PlanningRequest, PoseGoal


def request_digest(request: PlanningRequest) -> str:
    """Returns a digest of the group, start, goals and planner of a request."""
    digest = hashlib.sha256(np.asarray(request.scene.positions, dtype=float).tobytes())
    for text in (request.group, request.pipeline_id, request.planner_id, *map(_goal_text, request.goals)):
        digest.update(f"\0{text}".encode())
    return digest.hexdigest()


def _goal_text(goal: object) -> str:
    match goal:
        case JointGoal():
            return " ".join(f"{name} {float(value).hex()}" for name, value in sorted(goal.positions.items()))
        case PoseGoal():
            numbers = np.asarray(goal.target.homogeneous, dtype=float).ravel()
            return f"{goal.link} {' '.join(float(value).hex() for value in numbers)}"
    return type(goal).__name__


class RequestCounts:
    """Counts equal requests, so that a repeated request gets a different seed; thread-safe.

    The counts are reset if time goes back, as after the restart of a simulation.
    """

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._last_s = 0.0
        self._lock = threading.Lock()

    def count(self, digest: str, time_s: float) -> int:
        """Returns the number of equal requests before.

        Args:
            digest: Digest of the request.
            time_s: Time of the ROS clock [s].
        """
        with self._lock:
            if time_s < self._last_s:
                self._counts.clear()
            self._last_s = time_s
            count = self._counts[digest]
            self._counts[digest] += 1
            return count
