# SPDX-License-Identifier: BSD-3-Clause
"""The UR arm as the framework runs it: node robot_hw, trajectory controller, action client, and faults of the arm."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from std_msgs.msg import Float64
from ur_arm_on_ros import START, Arm, launched_arm


@pytest.fixture(scope="module")
def running(ros_launch: Callable[..., Any]) -> Arm:
    return launched_arm(ros_launch, link_timeout=2.0)


@pytest.fixture
def arm(running: Arm) -> Arm:
    """The arm, well and following."""
    running.well()
    return running


def test_a_trajectory_is_followed_to_its_end(arm: Arm) -> None:
    assert arm.positions == pytest.approx(START, abs=1e-3)
    target = [position + 0.3 for position in START]
    assert arm.send(target, 1.5).wait(20.0)
    assert arm.client.get_result().error_code == 0, arm.client.get_goal_status_text()
    arm.until(lambda: arm.positions == pytest.approx(target, abs=5e-3), "the arm at its goal")


def test_a_slider_at_a_third_makes_it_three_times_as_long(arm: Arm) -> None:
    target = [position - 0.2 for position in arm.positions]
    paces: list[float] = []
    pace = rospy.Subscriber("speed_scaling_factor", Float64, lambda message: paces.append(message.data))
    arm.until(lambda: paces and paces[-1] == 1.0, "the arm at full pace")
    arm.command("slider", value=1.0 / 3.0)
    arm.until(lambda: paces[-1] == pytest.approx(1.0 / 3.0), "the arm at a third of its pace")
    pace.unregister()
    begun_s = time.monotonic()
    assert arm.send(target, 1.0).wait(20.0)
    assert arm.client.get_result().error_code == 0, arm.client.get_goal_status_text()
    assert 2.8 < time.monotonic() - begun_s < 6.0


def test_a_pause_makes_a_goal_wait(arm: Arm) -> None:
    target = [position + 0.2 for position in arm.positions]
    done = arm.send(target, 1.0)
    assert arm.call("dashboard/pause") == (True, "Pausing program")
    assert not done.wait(1.5)  # longer than the motion takes
    assert arm.call("dashboard/play") == (True, "Starting program")
    assert done.wait(20.0)
    assert arm.client.get_result().error_code == 0, arm.client.get_goal_status_text()


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ("protective_stop", "protective stop of the arm"),
        ("emergency_stop", "emergency stop of the arm"),
        ("cut", "connection to the arm"),
        ("freeze", "connection to the arm"),
    ],
)
def test_a_fault_ends_the_goal_with_its_reason_and_resume_goes_on_where_the_arm_stands(
    arm: Arm, command: str, reason: str
) -> None:
    start = arm.positions
    done = arm.send([position + 0.5 for position in start], 4.0)
    time.sleep(0.7)
    arm.command(command)
    assert done.wait(20.0)
    assert arm.client.get_state() == GoalStatus.ABORTED
    assert reason in arm.client.get_result().error_string
    arm.until(lambda: arm.ready is False, "an arm that is not ready")
    success, text = arm.call("resume")
    assert not success and reason in text
    assert arm.send(start, 1.0).wait(5.0) and reason in arm.client.get_result().error_string
    arm.command("restore")
    if command == "protective_stop":
        assert arm.call("dashboard/unlock_protective_stop") == (True, "Protective stop releasing")
    elif command == "emergency_stop":
        arm.command("release_emergency_stop")
        assert arm.call("dashboard/power_on")[0] and arm.call("dashboard/brake_release")[0]
    arm.until(lambda: arm.call("resume")[0], "an arm that follows again")
    arm.until(lambda: arm.ready is True, "a ready arm")
    stopped = arm.positions
    time.sleep(0.3)
    assert arm.positions == pytest.approx(stopped, abs=1e-3)
    assert arm.send(start, 1.5).wait(20.0)
    assert arm.client.get_result().error_code == 0, arm.client.get_goal_status_text()


def test_a_dashboard_that_does_not_answer_is_reported(arm: Arm) -> None:
    arm.command("cut")
    success, text = arm.call("dashboard/power_on")
    assert not success and f"{arm.address}:29999" in text
    arm.until(lambda: arm.ready is False, "a driver that knows of the cut, before the next test makes the arm well")


def test_the_node_stops_the_arm_and_its_program_at_its_end(arm: Arm) -> None:
    os.system("rosnode kill /robot_hw > /dev/null 2>&1")
    arm.until(
        lambda: "runtime_state=STOPPED" in arm.command("state") and "connections=0" in arm.command("state"),
        "an arm without program and links",
    )
