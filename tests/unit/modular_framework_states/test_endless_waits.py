# SPDX-License-Identifier: BSD-3-Clause
"""A timeout may be infinite: the state then waits until it has what it waits for, or is stopped."""

from __future__ import annotations

import math
import threading
from types import SimpleNamespace
from typing import Any

import pytest
import rospy
from actionlib import CommState
from actionlib_msgs.msg import GoalStatus

from modular_framework_ros.calls import call_service, wait_for_result
from modular_framework_ros.simulated_time import SimulatedTime
from modular_framework_states.states.call_action import CallAction
from modular_framework_states.states.call_service import CallService
from modular_framework_states.states.cartesian_move import CartesianMove
from modular_framework_states.states.execute_trajectory import ExecuteTrajectory, sample_path
from modular_framework_states.states.grasp import Grasp
from modular_framework_states.states.gripper import Gripper
from modular_framework_states.states.move import Move
from modular_framework_states.states.set_planner import SetPlanner
from modular_framework_states.states.wait import Wait
from modular_framework_states.states.wait_for_message import WaitForMessage

INF, NAN = math.inf, math.nan
ENDLESS = [
    (CallAction, {"action_name": "a"}, "timeout"),
    (CallAction, {"action_name": "a"}, "server_timeout"),
    (CallService, {"service_name": "s"}, "timeout"),
    (Gripper, {"posture": "open"}, "timeout"),
    (Grasp, {"grasp_type": "pregrasp"}, "timeout"),
    (Wait, {"duration": 1.0}, "timeout"),
    (Wait, {}, "duration"),
    (WaitForMessage, {"topic_name": "t"}, "timeout"),
    (Move, {}, "start_tolerance"),
    (Move, {}, "goal_tolerance"),
    (ExecuteTrajectory, {}, "goal_tolerance"),
    (ExecuteTrajectory, {}, "step"),
]
FINITE = [
    (CartesianMove, {"pose_name": "p"}, "max_step"),
    (CartesianMove, {"pose_name": "p"}, "speed"),
    (SetPlanner, {}, "planning_time"),
]


@pytest.fixture()
def _clock(monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = iter(range(100))
    monkeypatch.setattr(SimulatedTime, "enabled", False)
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(next(seconds)))
    monkeypatch.setattr(rospy, "is_shutdown", lambda: False)
    monkeypatch.setattr("smach.is_shutdown", lambda: False)


@pytest.mark.parametrize(("state", "others", "option"), ENDLESS)
def test_infinity_is_in_order_and_nan_is_not(state: Any, others: dict[str, Any], option: str) -> None:
    assert state(**others, **{option: INF}) is not None
    with pytest.raises(ValueError, match=f"option '{option}' must be .*found the number nan; write a finite number"):
        state(**others, **{option: NAN})


@pytest.mark.parametrize(("state", "others", "option"), FINITE)
def test_infinity_is_refused_where_the_planner_refuses_it(state: Any, others: dict[str, Any], option: str) -> None:
    with pytest.raises(ValueError, match=f"option '{option}' must be .*found the number inf; lower it to"):
        state(**others, **{option: INF})


def test_a_call_may_have_no_time_at_all() -> None:
    assert CallService("s", timeout=0) is not None
    assert CallAction("a", timeout=0, server_timeout=0) is not None


@pytest.mark.usefixtures("_clock")
def test_an_endless_wait_ends_when_the_time_has_passed_or_when_it_is_stopped() -> None:
    assert Wait(2.0, timeout=INF).execute(None) == "success"
    endless = Wait(INF)
    stopper = threading.Timer(0.1, endless.request_preempt)
    stopper.start()
    assert endless.execute(None) == "fail"
    assert endless.reason == "stopped on request"


@pytest.mark.usefixtures("_clock")
def test_calls_take_an_infinite_timeout() -> None:
    done = SimpleNamespace(get_comm_state=lambda: CommState.DONE)
    client = SimpleNamespace(gh=done, get_state=lambda: GoalStatus.SUCCEEDED)
    assert wait_for_result(client, INF, lambda: False) == GoalStatus.SUCCEEDED

    class Proxy:
        resolved_name = "/service"

        def __call__(self, request: str) -> str:
            return f"answer to {request}"

    assert call_service(Proxy(), "me", INF) == "answer to me"


def test_an_infinite_step_checks_the_points_alone() -> None:
    points = [SimpleNamespace(positions=[0.0], velocities=[]), SimpleNamespace(positions=[1.0], velocities=[])]
    assert sample_path(SimpleNamespace(points=points), INF) == [(0, [0.0]), (1, [1.0])]
