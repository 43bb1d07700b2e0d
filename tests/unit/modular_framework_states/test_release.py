# SPDX-License-Identifier: BSD-3-Clause
"""Letting go counts once the fingers are open and nothing is attached to them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from geometry_msgs.msg import Point, Pose, Quaternion

from modular_framework_states.grasp_goals import GraspGoalError
from modular_framework_states.states import release
from modular_framework_states.states.release import Release


@pytest.fixture
def hand(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A hand that holds a can, in a scene that detaches it on request, or by itself after some reads."""
    state = SimpleNamespace(simulation=False, sent=[], held={"can__link": "palm"}, reads_left=0, problem="", time_s=0.0)
    state.falls_until_s = 0.0

    def send(client: Any, stage: str, grasp: Any, **_: Any) -> None:
        state.sent.append((stage, grasp))
        if state.problem:
            raise GraspGoalError(state.problem)

    def held_objects() -> dict[str, str]:
        if state.simulation and state.reads_left == 0:
            state.held = {}
        state.reads_left -= 1
        return dict(state.held)

    def object_poses(names: list[str]) -> dict[str, Pose]:
        state.time_s += 0.1
        return {
            name: Pose(Point(0.0, 0.0, -min(state.time_s, state.falls_until_s)), Quaternion(w=1.0)) for name in names
        }

    clock = SimpleNamespace(get_param=lambda *_: state.simulation, get_time=lambda: state.time_s)
    monkeypatch.setattr(release, "rospy", clock)
    monkeypatch.setattr(release, "SimulatedTime", lambda: SimpleNamespace(enabled=False))
    monkeypatch.setattr(release, "object_poses", object_poses)
    monkeypatch.setattr(release, "posture_positions", lambda posture: {"f": 0.0})
    monkeypatch.setattr(release, "posture_grasp", lambda positions, torque: dict(positions))
    monkeypatch.setattr(release, "send", send)
    monkeypatch.setattr(release, "held_objects", held_objects)
    monkeypatch.setattr(release, "detach", lambda objects: [state.held.pop(name) for name in objects])
    return state


def run(timeout: float = 5.0, rest_time: float = 0.0) -> tuple[str, str]:
    state = Release(timeout=timeout, rest_time=rest_time)
    outcome = state.execute(SimpleNamespace(manipulator_controller_client=None, max_torque=1.0))
    return outcome, state.reason


def test_without_a_simulation_the_object_is_detached_here(hand: Any) -> None:
    assert run() == ("success", "")
    assert hand.sent == [("pregrasp", {"f": 0.0})] and not hand.held


def test_in_simulation_the_object_is_waited_for_until_the_fingers_have_left_it(hand: Any) -> None:
    hand.simulation, hand.reads_left = True, 3
    assert run() == ("success", "")


def test_what_stays_between_the_fingers_and_fingers_that_do_not_open_are_failures_with_the_reason(hand: Any) -> None:
    hand.simulation, hand.reads_left = True, 10**6
    outcome, reason = run(timeout=0.3)
    assert outcome == "fail" and "still has can__link attached to palm" in reason
    hand.problem = "joint 'f' is 0.4 away from its target"
    outcome, reason = run()
    assert outcome == "fail" and "joint 'f' is 0.4 away" in reason


def test_held_time_passes_until_the_simulation_has_noticed_that_the_fingers_left_the_object(
    hand: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    hand.simulation, hand.reads_left = True, 10**6

    def sleep(duration_s: float) -> None:
        hand.time_s += duration_s
        hand.reads_left = 0 if hand.time_s > 0.3 else hand.reads_left

    monkeypatch.setattr(release, "SimulatedTime", lambda: SimpleNamespace(enabled=True, sleep=sleep))
    assert run() == ("success", "")


def test_a_released_object_must_come_to_rest_if_a_rest_time_is_given(hand: Any) -> None:
    hand.falls_until_s = 0.4
    assert run(rest_time=0.5) == ("success", "")
    assert hand.time_s == pytest.approx(0.4 + 0.5, abs=0.11)
    hand.falls_until_s, hand.held = 1000.0, {"can__link": "palm"}
    outcome, reason = run(timeout=0.3, rest_time=0.5)
    assert outcome == "fail" and "released can__link, but the planning scene does not show it at rest" in reason
