# SPDX-License-Identifier: BSD-3-Clause
"""Time until a client of the trajectory controller gets a fault of the UR arm, with default settings."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest
from actionlib_msgs.msg import GoalStatus
from ur_arm_on_ros import Arm, launched_arm

REPORTED_WITHIN_S = 0.2
ATTEMPTS = 5


@pytest.fixture(scope="module")
def arm(ros_launch: Callable[..., Any]) -> Arm:
    return launched_arm(ros_launch)


def time_until_reported_s(arm: Arm, command: str, reason: str) -> float:
    """Cause a fault in the midst of a motion; returns how long after it the client has the result [s].

    The arm must be standing soon after, and it must not move when the fault is over.
    """
    done = arm.send([position + 0.2 for position in arm.true_positions()], 2.0)
    time.sleep(0.7)
    begun_s = time.monotonic()
    arm.command(command)
    assert done.wait(10.0)
    reported_s = time.monotonic() - begun_s
    assert arm.client.get_state() == GoalStatus.ABORTED
    assert reason in arm.client.get_result().error_string
    position_at_report = arm.true_positions()
    time.sleep(0.2)
    stood = arm.true_positions()
    assert stood == pytest.approx(position_at_report, abs=0.02)  # its way to rest, from 0.16 rad/s
    arm.well()
    time.sleep(0.2)
    assert arm.true_positions() == pytest.approx(stood, abs=1e-3)
    return reported_s


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ("protective_stop", "protective stop of the arm"),
        ("emergency_stop", "emergency stop of the arm"),
        ("cut", "connection to the arm"),
        ("freeze", "connection to the arm"),
    ],
)
def test_a_client_gets_a_fault_within_a_fifth_of_a_second(arm: Arm, command: str, reason: str) -> None:
    """Other work on the computer can only make it later: what the software takes is the shortest of some times."""
    times_s: list[float] = []
    while not times_s or (min(times_s) >= REPORTED_WITHIN_S and len(times_s) < ATTEMPTS):
        times_s.append(time_until_reported_s(arm, command, reason))
    assert min(times_s) < REPORTED_WITHIN_S, times_s
