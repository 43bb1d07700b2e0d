# SPDX-License-Identifier: BSD-3-Clause
"""The controllers as clients see them: actions, topics and services of a running control loop with fake hardware."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    GripperCommandAction,
    GripperCommandGoal,
    JointTolerance,
    JointTrajectoryControllerState,
)
from control_msgs.srv import QueryTrajectoryState
from controller_manager_msgs.srv import (
    ListControllers,
    ListControllerTypes,
    LoadController,
    ReloadControllerLibraries,
    SwitchController,
    UnloadController,
)
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_ros.action_client import SteadyActionClient

JOINTS = ["shoulder", "elbow"]


def call(name: str, kind: Any, *arguments: Any) -> Any:
    rospy.wait_for_service(f"controller_manager/{name}", 60.0)
    return rospy.ServiceProxy(f"controller_manager/{name}", kind)(*arguments)


def states() -> dict[str, str]:
    return {entry.name: entry.state for entry in call("list_controllers", ListControllers).controller}


def switch(start: list[str], stop: list[str], strictness: int = 2) -> bool:
    return bool(call("switch_controller", SwitchController, start, stop, strictness, False, 0.0).ok)


@pytest.fixture(scope="module")
def robot(ros_session: Any) -> Any:
    for name in ("joint_state_controller", "arm", "gripper"):
        assert call("load_controller", LoadController, name).ok
    assert switch(["joint_state_controller", "arm", "gripper"], [])
    return ros_session


@pytest.fixture
def arm(robot: Any) -> actionlib.ActionClient:
    client = SteadyActionClient("arm/follow_joint_trajectory", FollowJointTrajectoryAction)
    assert client.wait_for_server(rospy.Duration(30.0))
    return client


@pytest.fixture
def gripper(robot: Any) -> actionlib.SimpleActionClient:
    client = SteadyActionClient("gripper/gripper_cmd", GripperCommandAction)
    assert client.wait_for_server(rospy.Duration(30.0))
    return client


def trajectory(*points: tuple[float, list[float]], names: list[str] | None = None) -> JointTrajectory:
    message = JointTrajectory(joint_names=JOINTS if names is None else names)
    for time_s, positions in points:
        zeros = [0.0] * len(positions)
        message.points.append(
            JointTrajectoryPoint(
                positions=positions,
                velocities=zeros,
                accelerations=zeros,
                time_from_start=rospy.Duration.from_sec(time_s),
            )
        )
    return message


def goal(*points: tuple[float, list[float]], names: list[str] | None = None) -> FollowJointTrajectoryGoal:
    return FollowJointTrajectoryGoal(trajectory=trajectory(*points, names=names))


def positions() -> dict[str, float]:
    """Positions once all joints stand still."""
    end = time.monotonic() + 30.0
    while time.monotonic() < end:
        message = rospy.wait_for_message("joint_states", JointState, 30.0)
        if not any(message.velocity):
            return dict(zip(message.name, message.position, strict=True))
    raise AssertionError(f"joints still move: {message}")


def wait_until_shoulder(true_of: Callable[[float], bool]) -> None:
    """Returns when the position of the shoulder is as it should be."""
    end = time.monotonic() + 30.0
    while True:
        message = rospy.wait_for_message("joint_states", JointState, 30.0)
        if true_of(position := message.position[message.name.index("shoulder")]):
            return
        assert time.monotonic() < end, position


def finish(client: actionlib.SimpleActionClient, timeout_s: float = 30.0) -> Any:
    assert client.wait_for_result(rospy.Duration.from_sec(timeout_s)), "no result in time"
    return client.get_result()


def test_a_trajectory_is_followed_to_its_end(arm: actionlib.SimpleActionClient) -> None:
    feedback: list[Any] = []
    arm.send_goal(goal((0.2, [0.1, 0.1]), (0.5, [0.3, 0.2])), feedback_cb=feedback.append)
    result = finish(arm)
    assert arm.get_state() == GoalStatus.SUCCEEDED
    assert result.error_code == FollowJointTrajectoryResult.SUCCESSFUL
    assert positions()["shoulder"] == pytest.approx(0.3, abs=1e-6)
    assert feedback and list(feedback[0].joint_names) == JOINTS


def test_a_path_violation_is_aborted_with_joint_error_and_tolerance(arm: actionlib.SimpleActionClient) -> None:
    target = positions()["elbow"] + 2.0
    arm.send_goal(goal((0.5, [0.3, target])))
    result = finish(arm)
    assert arm.get_state() == GoalStatus.ABORTED
    assert result.error_code == FollowJointTrajectoryResult.PATH_TOLERANCE_VIOLATED
    assert "'elbow'" in result.error_string and "tolerance 0.2" in result.error_string


def test_a_goal_violation_is_aborted_after_goal_time(arm: actionlib.SimpleActionClient) -> None:
    target = positions()["elbow"] - 2.0
    message = goal((0.5, [0.3, target]))
    message.path_tolerance = [JointTolerance(name="elbow", position=-1.0)]
    arm.send_goal(message)
    result = finish(arm)
    assert result.error_code == FollowJointTrajectoryResult.GOAL_TOLERANCE_VIOLATED
    assert "'elbow'" in result.error_string and "goal_time" in result.error_string


@pytest.mark.parametrize(
    ("message", "code", "words"),
    [
        (goal((0.5, [0.0, 0.0]), names=["shoulder", "wrist"]), -2, "unknown joint 'wrist'"),
        (goal((0.5, [0.0]), names=["shoulder"]), -2, "joints missing: elbow"),
        (goal((0.5, [0.0, math.nan])), -1, "position of joint 'elbow' (index 1) is nan; expected a finite number"),
        (goal((0.5, [0.0])), -1, "has 1 positions; expected 2"),
        (goal((0.5, [0.0, 0.0]), (0.4, [0.0, 0.0])), -1, "must increase strictly"),
        (goal((0.0, [0.0, 0.0])), -1, "past"),
    ],
)
def test_a_malformed_goal_is_rejected_with_code_and_reason(
    arm: actionlib.SimpleActionClient, message: FollowJointTrajectoryGoal, code: int, words: str
) -> None:
    arm.send_goal(message)
    result = finish(arm)
    assert arm.get_state() == GoalStatus.REJECTED
    assert result.error_code == code
    assert words in result.error_string
    assert states()["arm"] == "running"


def test_a_new_goal_preempts_the_one_before(arm: actionlib.SimpleActionClient) -> None:
    other = SteadyActionClient("arm/follow_joint_trajectory", FollowJointTrajectoryAction)
    assert other.wait_for_server(rospy.Duration(30.0))
    here = positions()
    arm.send_goal(goal((30.0, [here["shoulder"] + 5.0, here["elbow"]])))
    wait_until_shoulder(lambda position: position > here["shoulder"] + 0.01)
    other.send_goal(goal((0.3, [here["shoulder"], here["elbow"]])))
    finish(arm)
    assert arm.get_state() == GoalStatus.PREEMPTED
    assert finish(other).error_code == 0
    assert other.get_state() == GoalStatus.SUCCEEDED


def test_cancel_ends_the_goal_at_once_and_the_joints_rest(arm: actionlib.SimpleActionClient) -> None:
    here = positions()
    arm.send_goal(goal((10.0, [here["shoulder"] + 1.0, here["elbow"]])))
    wait_until_shoulder(lambda position: position > here["shoulder"] + 0.02)
    arm.cancel_goal()
    finish(arm)
    assert arm.get_state() == GoalStatus.PREEMPTED
    first = positions()["shoulder"]
    time.sleep(0.1)
    assert positions()["shoulder"] == pytest.approx(first, abs=1e-9)
    assert here["shoulder"] < first < here["shoulder"] + 0.9


def test_the_command_topic_moves_and_the_empty_command_stops(robot: Any) -> None:
    publisher = rospy.Publisher("arm/command", JointTrajectory, queue_size=1)
    end = time.monotonic() + 30.0
    while publisher.get_num_connections() == 0:
        assert time.monotonic() < end
        time.sleep(0.02)
    here = positions()
    publisher.publish(trajectory((10.0, [here["shoulder"] - 1.0, here["elbow"]])))
    wait_until_shoulder(lambda position: position < here["shoulder"] - 0.02)
    publisher.publish(JointTrajectory())
    stopped = positions()["shoulder"]
    assert here["shoulder"] - 0.95 < stopped < here["shoulder"] - 0.01
    state = rospy.wait_for_message("arm/state", JointTrajectoryControllerState, 30.0)
    assert list(state.desired.velocities) == [0.0, 0.0]
    assert state.desired.positions[0] == pytest.approx(stopped, abs=1e-9)


def test_query_state_returns_what_will_be_desired(arm: actionlib.SimpleActionClient) -> None:
    here = positions()
    arm.send_goal(goal((1.0, [here["shoulder"] + 0.4, here["elbow"]])))
    wait_until_shoulder(lambda position: position > here["shoulder"])
    query = rospy.ServiceProxy("arm/query_state", QueryTrajectoryState)
    later = query(rospy.Time.now() + rospy.Duration(5.0))
    assert list(later.name) == JOINTS
    assert later.position[0] == pytest.approx(here["shoulder"] + 0.4, abs=1e-9)
    finish(arm)


def test_the_gripper_reaches_a_free_position(gripper: actionlib.SimpleActionClient) -> None:
    command = GripperCommandGoal()
    command.command.position = 0.3
    gripper.send_goal(command)
    result = finish(gripper)
    assert gripper.get_state() == GoalStatus.SUCCEEDED
    assert result.reached_goal and not result.stalled


def test_a_gripper_that_cannot_go_on_is_aborted_as_stalled(gripper: actionlib.SimpleActionClient) -> None:
    command = GripperCommandGoal()
    command.command.position = 0.9
    started = time.monotonic()
    gripper.send_goal(command)
    result = finish(gripper)
    assert gripper.get_state() == GoalStatus.ABORTED
    assert result.stalled and not result.reached_goal
    assert result.position == pytest.approx(0.5)
    assert time.monotonic() - started >= 0.3


@pytest.mark.parametrize("position", [math.nan, 5.0, -1.0, 1e300])
def test_a_gripper_goal_that_is_not_a_number_or_beyond_the_limits_is_rejected(
    gripper: actionlib.SimpleActionClient, position: float
) -> None:
    command = GripperCommandGoal()
    command.command.position = position
    gripper.send_goal(command)
    finish(gripper)
    assert gripper.get_state() == GoalStatus.REJECTED
    assert "position" in gripper.get_goal_status_text()


def test_the_services_follow_the_rules_of_switching(robot: Any) -> None:
    assert not call("load_controller", LoadController, "arm").ok
    assert not call("load_controller", LoadController, "broken").ok
    assert not call("load_controller", LoadController, "absent").ok
    assert call("load_controller", LoadController, "rival").ok
    assert states()["rival"] == "initialized"
    assert not switch(["rival"], []), "elbow is claimed by arm"
    assert not switch(["rival", "absent"], ["arm"])
    assert switch(["rival", "absent"], ["arm"], 1)
    assert (states()["rival"], states()["arm"]) == ("running", "stopped")
    assert not call("unload_controller", UnloadController, "rival").ok
    assert switch(["arm"], ["rival"])
    assert call("unload_controller", UnloadController, "rival").ok
    assert "rival" not in states()


def test_types_and_claimed_joints_are_listed(robot: Any) -> None:
    types = call("list_controller_types", ListControllerTypes)
    assert "position_controllers/JointTrajectoryController" in types.types
    entry = next(entry for entry in call("list_controllers", ListControllers).controller if entry.name == "arm")
    assert entry.type == "position_controllers/JointTrajectoryController"
    assert entry.claimed_resources[0].hardware_interface == "hardware_interface::PositionJointInterface"
    assert sorted(entry.claimed_resources[0].resources) == sorted(JOINTS)
    assert not call("reload_controller_libraries", ReloadControllerLibraries, False).ok


def test_stopping_a_controller_ends_its_goal_and_reloading_unloads_everything(
    arm: actionlib.SimpleActionClient,
) -> None:
    here = positions()
    arm.send_goal(goal((30.0, [here["shoulder"] + 3.0, here["elbow"]])))
    wait_until_shoulder(lambda position: position > here["shoulder"])
    assert switch([], ["arm"])
    assert finish(arm).error_string == "the controller was stopped"
    arm.send_goal(goal((0.3, [here["shoulder"], here["elbow"]])))
    assert "not running" in finish(arm).error_string
    assert call("reload_controller_libraries", ReloadControllerLibraries, True).ok
    assert states() == {}
