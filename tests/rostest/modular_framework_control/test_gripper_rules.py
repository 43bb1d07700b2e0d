# SPDX-License-Identifier: BSD-3-Clause
"""The rules of ros_controllers' gripper controller, one by one, as a client meets them, in simulated time."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import actionlib
import pytest
import rospy
from control_msgs.msg import GripperCommand, GripperCommandAction, GripperCommandGoal

sys.path.insert(0, str(Path(__file__).parent))
from stepped_robot import PERIOD_S, WAIT_S, SteppedRobot  # noqa: E402

JOINTS = {"soft": "knuckle", "strong": "jaw"}
PARTS = {"soft": "by_position", "strong": "by_effort"}
PARAMETERS: dict[str, Any] = {
    "robot_hardware": ["by_position", "by_effort"],
    "joint_limits": {"knuckle": {"has_velocity_limits": True, "max_velocity": 1.0}},
    "by_position": {"type": "by_position", "joints": ["knuckle"]},
    "by_effort": {"type": "by_effort", "joints": ["jaw"], "command_interface": "EffortJointInterface"},
    "soft": {
        "type": "position_controllers/GripperActionController",
        "joint": "knuckle",
        "stall_timeout": 0.3,
        "goal_tolerance": 0.02,
        "action_monitor_rate": 10.0,
    },
    "strong": {
        "type": "effort_controllers/GripperActionController",
        "joint": "jaw",
        "stall_timeout": 0.3,
        "goal_tolerance": 0.02,
        "max_effort": 4.0,
        "gains": {"jaw": {"p": 100.0, "d": 20.0}},
    },
}


class Gripper:
    """What a client of one gripper controller does."""

    def __init__(self, robot: SteppedRobot, name: str) -> None:
        self._robot = robot
        self._action = actionlib.ActionClient(f"{name}/gripper_cmd", GripperCommandAction)
        self.hardware = robot.hardware[PARTS[name]]
        self.joint = JOINTS[name]
        assert robot.wait_for(lambda: self._action.wait_for_server(rospy.Duration(WAIT_S)))

    @property
    def commanded(self) -> Any:
        """The handle of the joint as the hardware sees it."""
        return self.hardware.interfaces[-1].handles[0]

    def send(self, position: float, max_effort: float = 0.0, feedback: Any = None) -> Any:
        """Send a goal and wait until it runs or is refused."""
        handle = self._action.send_goal(GripperCommandGoal(GripperCommand(position, max_effort)), feedback_cb=feedback)
        self._robot.wait_until(
            lambda: (
                handle.get_comm_state() not in (actionlib.CommState.WAITING_FOR_GOAL_ACK, actionlib.CommState.PENDING)
            )
        )
        return handle

    def result(self, handle: Any) -> tuple[str, Any, str]:
        """State, result and text of a goal that has ended."""
        self._robot.wait_until(lambda: handle.get_comm_state() == actionlib.CommState.DONE)
        return (
            actionlib.TerminalState.to_string(handle.get_terminal_state()),
            handle.get_result(),
            handle.get_goal_status_text(),
        )


@pytest.fixture(scope="module")
def robot(ros_session: Any) -> Iterator[SteppedRobot]:
    stepped = SteppedRobot(PARAMETERS, ["soft", "strong"])
    yield stepped
    stepped.close()


@pytest.fixture(scope="module", params=["soft", "strong"])
def gripper(robot: SteppedRobot, request: pytest.FixtureRequest) -> Gripper:
    return Gripper(robot, request.param)


def test_within_the_goal_tolerance_is_reached(robot: SteppedRobot, gripper: Gripper) -> None:
    handle = gripper.send(0.3)
    robot.run(2.0)
    state, result, _ = gripper.result(handle)
    assert (state, result.reached_goal, result.stalled) == ("SUCCEEDED", True, False)
    assert result.position == pytest.approx(0.3, abs=0.02)


def test_something_in_the_way_is_a_stall_and_aborts_after_the_timeout(robot: SteppedRobot, gripper: Gripper) -> None:
    gripper.hardware.blocked = {gripper.joint: 0.5}
    robot.step()
    handle = gripper.send(0.9, 3.0)
    robot.run(0.3)
    assert handle.get_comm_state() == actionlib.CommState.ACTIVE
    robot.step(3)
    state, result, text = gripper.result(handle)
    assert (state, result.reached_goal, result.stalled) == ("ABORTED", False, True)
    assert result.position == 0.5 and f"joint '{gripper.joint}' is at rest at 0.5, +0.4 short of its goal" in text
    robot.run(1.0)
    squeezed = gripper.commanded
    if gripper.joint == "jaw":
        assert squeezed.command == 3.0 and result.effort == pytest.approx(3.0)
    else:
        assert (squeezed.command, squeezed.max_effort) == (0.9, 3.0)


def test_a_goal_without_effort_has_that_of_the_parameter(robot: SteppedRobot, gripper: Gripper) -> None:
    handle = gripper.send(0.9)
    robot.run(0.4)
    assert gripper.result(handle)[0] == "ABORTED"
    if gripper.joint == "jaw":
        assert gripper.commanded.command == 4.0
    else:
        assert gripper.commanded.max_effort == 0.0


def test_a_new_goal_preempts_and_a_cancelled_one_leaves_the_joint_where_it_is(
    robot: SteppedRobot, gripper: Gripper
) -> None:
    first = gripper.send(0.9)
    second = gripper.send(0.8)
    assert gripper.result(first)[0] == "PREEMPTED"
    second.cancel()
    assert gripper.result(second)[0] == "PREEMPTED"
    gripper.hardware.blocked = {}
    robot.run(0.5)
    assert gripper.commanded.position == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(("position", "effort"), [(float("nan"), 0.0), (float("inf"), 0.0), (0.1, float("nan"))])
def test_a_goal_that_makes_no_sense_is_refused_with_what_was_got_and_is_allowed(
    gripper: Gripper, position: float, effort: float
) -> None:
    state, _, text = gripper.result(gripper.send(position, effort))
    assert state == "REJECTED"
    assert f"got position {position}, max_effort {effort}; expected finite numbers" in text


def test_feedback_comes_at_its_rate(robot: SteppedRobot) -> None:
    soft = Gripper(robot, "soft")
    seen: list[Any] = []
    soft.hardware.blocked = {"knuckle": 0.2}
    robot.step()
    handle = soft.send(0.9, 0.0, lambda _, message: seen.append(message))
    robot.run(0.29)
    robot.flush()
    robot.wait_until(lambda: len(seen) >= 3)
    assert len(seen) == 3 and not seen[0].stalled and not seen[0].reached_goal
    handle.cancel()
    assert soft.result(handle)[0] == "PREEMPTED"
    soft.hardware.blocked = {}


def test_a_hardware_fault_aborts_with_its_reason_and_refuses_goals_until_it_is_over(
    robot: SteppedRobot, gripper: Gripper
) -> None:
    gripper.hardware.blocked = {gripper.joint: 0.4}
    handle = gripper.send(0.9)
    robot.step(2)
    gripper.hardware.reason = "servo 1: overload"
    robot.step()
    reason = f"hardware fault: hardware '{PARTS['strong' if gripper.joint == 'jaw' else 'soft']}': servo 1: overload"
    state, result, text = gripper.result(handle)
    assert (state, result.stalled, text) == ("ABORTED", False, reason)
    state, _, text = gripper.result(gripper.send(0.1))
    assert (state, text) == ("REJECTED", reason)
    gripper.hardware.reason = ""
    robot.step()
    gripper.hardware.blocked = {}
    robot.run(10 * PERIOD_S)
    assert gripper.commanded.position == pytest.approx(0.4, abs=0.01)
    handle = gripper.send(0.45)
    robot.run(2.0)
    assert gripper.result(handle)[0] == "SUCCEEDED"
