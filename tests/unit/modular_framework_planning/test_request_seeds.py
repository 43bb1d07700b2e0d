# SPDX-License-Identifier: BSD-3-Clause
"""The seed of a request follows from what it asks, not from the sequence in which requests come."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from modular_framework_planning.planning_interface.planning_request import JointGoal, PlanningRequest, PoseGoal
from modular_framework_planning.reproducible.request_seeds import RequestCounts, request_digest


def request(start: float = 0.0, goal: float = 1.0, group: str = "arm", planner: str = "RRTConnect") -> PlanningRequest:
    scene: Any = SimpleNamespace(positions=np.array([start, 0.5]))
    return PlanningRequest(scene, group, (JointGoal({"b": goal, "a": 0.25}),), planner_id=planner)


def test_equal_requests_have_equal_digests() -> None:
    assert request_digest(request()) == request_digest(request())


def test_start_goal_group_and_planner_make_a_difference_to_the_last_bit() -> None:
    others = [
        request(start=np.nextafter(0.0, 1.0)),
        request(goal=np.nextafter(1.0, 2.0)),
        request(group="hand"),
        request(planner="EST"),
    ]
    assert len({request_digest(item) for item in [request(), *others]}) == 5


def test_poses_make_a_difference() -> None:
    def to_pose(x: float) -> PlanningRequest:
        matrix = np.eye(4)
        matrix[0, 3] = x
        target: Any = SimpleNamespace(homogeneous=matrix)
        scene: Any = SimpleNamespace(positions=np.zeros(2))
        return PlanningRequest(scene, "arm", (PoseGoal("tip", target),))

    assert request_digest(to_pose(0.1)) == request_digest(to_pose(0.1)) != request_digest(to_pose(0.2))


def test_what_is_asked_again_gets_another_number() -> None:
    counts = RequestCounts()
    assert [counts.count("a", 1.0), counts.count("b", 1.0), counts.count("a", 2.0)] == [0, 0, 1]


def test_numbers_begin_anew_when_time_goes_back() -> None:
    counts = RequestCounts()
    counts.count("a", 5.0)
    assert [counts.count("a", 0.01), counts.count("a", 0.01)] == [0, 1]
