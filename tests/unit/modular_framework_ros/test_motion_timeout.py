# SPDX-License-Identifier: BSD-3-Clause
"""The timeout of a motion counts the slower of real time and the simulation's clock."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import rospy
from actionlib import CommState
from actionlib_msgs.msg import GoalStatus

from modular_framework_ros import calls
from modular_framework_ros.calls import MotionTimeout

LIMIT_S = 10.0
STEP_S = 0.1
"""Real time between two checks [s]."""


@pytest.fixture
def clocks(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[float], float] | None], list[float]]:
    """Sets the ROS time as a function of real time [s]; returns a list that holds the real time [s]."""

    def set_clocks(ros_time: Callable[[float], float] | None) -> list[float]:
        real_s = [1000.0]
        monkeypatch.setattr(calls.time, "monotonic", lambda: real_s[0])
        monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: ros_time is None)
        monkeypatch.setattr(rospy.rostime, "is_rostime_initialized", lambda: True)
        monkeypatch.setattr(rospy, "get_time", lambda: ros_time(real_s[0] - 1000.0) if ros_time else 0.0)
        return real_s

    return set_clocks


def real_duration_s(real_s: list[float]) -> float:
    """Returns the real time after which a timeout of LIMIT_S is exceeded [s]."""
    timeout = MotionTimeout(LIMIT_S)
    start_s = real_s[0]
    while not timeout.is_exceeded():
        real_s[0] += STEP_S
    return real_s[0] - start_s


@pytest.mark.parametrize(
    ("ros_time", "expected_s"),
    [
        (None, LIMIT_S),
        (lambda t: t, LIMIT_S),
        (lambda t: 0.1 * t, 10.0 * LIMIT_S),
        (lambda t: round(0.01 * t, 2), 100.0 * LIMIT_S),  # a clock with one step per second
        (lambda t: 50.0 * t, LIMIT_S),
        (lambda t: 0.0, LIMIT_S),  # before the simulation starts, or paused
        (lambda t: min(t, 4.0), LIMIT_S),  # paused on the way
        (lambda t: t if t < 4.0 else t - 4.0, LIMIT_S),  # reset of the world
    ],
    ids=["no simulation", "real time", "slow", "very slow", "fast", "stopped", "paused", "reset"],
)
def test_the_timeout_ends_by_the_slower_clock_that_moves(clocks, ros_time, expected_s) -> None:
    assert real_duration_s(clocks(ros_time)) == pytest.approx(expected_s, abs=2.0 * STEP_S, rel=0.02)


def test_a_goal_that_moves_in_a_slow_simulation_is_not_cancelled(clocks, monkeypatch: pytest.MonkeyPatch) -> None:
    real_s = clocks(lambda t: 0.1 * t)

    class Client:
        cancelled = False

        @property
        def gh(self) -> Client:
            real_s[0] += STEP_S
            return self

        @staticmethod
        def get_comm_state() -> int:
            return int(CommState.DONE if rospy.get_time() >= 5.0 else CommState.ACTIVE)  # 5 s of simulated motion

        @staticmethod
        def get_state() -> int:
            return int(GoalStatus.SUCCEEDED)

        def cancel_goal(self) -> None:
            self.cancelled = True

    monkeypatch.setattr(calls.time, "sleep", lambda _: None)
    monkeypatch.setattr(calls, "frozen_nodes", lambda: "")
    monkeypatch.setattr(rospy, "is_shutdown", lambda: False)
    client = Client()
    assert calls.wait_for_result(client, LIMIT_S, lambda: False) == GoalStatus.SUCCEEDED
    assert not client.cancelled
    assert real_s[0] - 1000.0 > 2.0 * LIMIT_S
