# SPDX-License-Identifier: BSD-3-Clause
"""The action move_group: its planning options, what it says of the executed motion, and how it is stopped."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from dynamic_reconfigure.client import Client
from moveit_msgs.msg import (
    CollisionObject,
    MoveGroupAction,
    MoveGroupGoal,
    MoveItErrorCodes,
    RobotState,
)
from std_msgs.msg import String

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.planning.planning_wire import (
    ARM,
    OK,
    START,
    FakeArm,
    add,
    box,
    joint_goal,
    report_of,
    request,
)
from modular_framework_testing.ros_session import until

PAN = "shoulder_pan_joint"
GOAL_PAN = START[0] - 1.2
SLOW = {"max_velocity_scaling_factor": 0.1, "max_acceleration_scaling_factor": 0.5}
pytestmark = pytest.mark.usefixtures("clean_scene")


@pytest.fixture(scope="module")
def client(arm: FakeArm) -> Any:
    client = SteadyActionClient("move_group", MoveGroupAction)
    assert client.wait_for_server(rospy.Duration(30.0))
    return client


def goal(pan: float = GOAL_PAN, plan_only: bool = False, **changes: Any) -> MoveGroupGoal:
    message = MoveGroupGoal(request=request(joint_goal(PAN, pan), **changes))
    message.planning_options.plan_only = plan_only
    message.planning_options.planning_scene_diff.is_diff = True
    message.planning_options.planning_scene_diff.robot_state.is_diff = True
    return message


def ask(client: Any, message: MoveGroupGoal, timeout_s: float = 30.0) -> Any:
    client.send_goal(message)
    assert client.wait_for_result(rospy.Duration(timeout_s)), "no result"
    return client.get_result()


def wall_at(pan: float, name: str = "wall") -> CollisionObject:
    """A box the forearm runs into when the shoulder pan joint is there."""
    turn = pan - START[0]
    x, y = -0.11, 0.46  # what the forearm is at in the start state
    place = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ [x, y]
    return box(name, float(place[0]), float(place[1]), 1.3, (0.15, 0.15, 0.5))


def test_the_executed_trajectory_is_what_was_measured(client: Any, arm: FakeArm) -> None:
    result = ask(client, goal())
    assert result.error_code.val == OK and client.get_state() == GoalStatus.SUCCEEDED
    executed = result.executed_trajectory.joint_trajectory
    assert list(executed.joint_names) == ARM and len(executed.points) >= 3
    stamps = [point.time_from_start.to_sec() for point in executed.points]
    assert np.all(np.diff(stamps) > 0.0)
    assert np.allclose(executed.points[0].positions, START, atol=0.05)
    assert np.allclose(executed.points[-1].positions, [arm.positions[name] for name in ARM], atol=1e-6)
    assert arm.positions[PAN] == pytest.approx(GOAL_PAN, abs=1e-6)
    planned = [point.positions for point in result.planned_trajectory.joint_trajectory.points]
    for point in executed.points:
        assert np.abs(np.array(planned) - point.positions).max(axis=1).min() < 0.05, "measured away from the path"


def test_a_motion_to_execute_starts_where_the_robot_is(client: Any, arm: FakeArm) -> None:
    message = goal(start_state=RobotState())
    message.request.start_state.joint_state.name = [PAN]
    message.request.start_state.joint_state.position = [0.0]
    assert ask(client, message).error_code.val == OK
    message = goal(plan_only=True, start_state=message.request.start_state)
    result = ask(client, message)
    assert result.planned_trajectory.joint_trajectory.points[0].positions[0] == pytest.approx(0.0)
    assert not result.executed_trajectory.joint_trajectory.points


@pytest.mark.parametrize("is_diff", [True, False])
def test_the_scene_diff_counts_for_this_goal_alone_whatever_its_flag_says(client: Any, is_diff: bool) -> None:
    assert add(wall_at(START[0] + 1.5, "kept"))
    message = goal(plan_only=True)
    message.planning_options.planning_scene_diff.is_diff = is_diff
    message.planning_options.planning_scene_diff.world.collision_objects = [wall_at(GOAL_PAN)]
    assert ask(client, message).error_code.val == MoveItErrorCodes.GOAL_IN_COLLISION
    message.request.goal_constraints = [joint_goal(PAN, START[0] + 1.5)]
    result, report = report_of(lambda: ask(client, message))
    assert result.error_code.val == MoveItErrorCodes.GOAL_IN_COLLISION and "'kept'" in report["reason"]
    assert ask(client, goal(plan_only=True)).error_code.val == OK


def test_looking_around_is_refused_with_the_reason(client: Any) -> None:
    message = goal()
    message.planning_options.look_around = True
    result, report = report_of(lambda: ask(client, message))
    assert result.error_code.val == MoveItErrorCodes.UNABLE_TO_AQUIRE_SENSOR_DATA
    assert "look_around" in report["reason"] and "look_around" in client.get_goal_status_text()


@pytest.mark.parametrize("delay", [float("nan"), -1.0, float("inf")])
def test_a_replan_delay_that_is_no_time_is_refused(client: Any, delay: float) -> None:
    message = goal(plan_only=True)
    message.planning_options.replan_delay = delay
    result, report = report_of(lambda: ask(client, message))
    assert result.error_code.val == MoveItErrorCodes.FAILURE and "replan_delay" in report["reason"]


def test_a_wall_that_appears_ahead_stops_the_motion(client: Any, arm: FakeArm) -> None:
    client.send_goal(goal(**SLOW))
    arm.until_moving()
    assert add(wall_at(GOAL_PAN))
    assert client.wait_for_result(rospy.Duration(20.0))
    result = client.get_result()
    assert result.error_code.val == MoveItErrorCodes.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE
    assert "'wall'" in client.get_goal_status_text()
    assert arm.cancelled.wait(20.0) and arm.positions[PAN] > GOAL_PAN + 0.3, "stopped before the wall"
    assert len(result.executed_trajectory.joint_trajectory.points) > 1


def test_a_box_that_appears_elsewhere_does_not_stop_the_motion(client: Any, arm: FakeArm) -> None:
    client.send_goal(goal(max_velocity_scaling_factor=0.2))
    arm.until_moving()
    assert add(wall_at(START[0] + 2.0))
    assert client.wait_for_result(rospy.Duration(20.0)) and client.get_result().error_code.val == OK


def test_replanning_goes_around_the_wall_that_appeared(client: Any, arm: FakeArm) -> None:
    message = goal(START[0] - 2.0, **SLOW)
    message.planning_options.replan = True
    message.planning_options.replan_attempts = 3
    client.send_goal(message)
    arm.until_moving()
    middle = wall_at(START[0] - 1.2)
    middle.primitives[0].dimensions = [0.1, 0.1, 0.3]
    assert add(middle)
    assert arm.cancelled.wait(20.0), "the first motion was not stopped"
    # the arm stands still while it plans anew: the second motion may be quick
    assert client.wait_for_result(rospy.Duration(60.0))
    assert client.get_result().error_code.val == OK, client.get_goal_status_text()
    assert arm.positions[PAN] == pytest.approx(START[0] - 2.0, abs=1e-3)


def test_a_failed_plan_is_tried_again_after_the_delay(client: Any) -> None:
    message = goal(plan_only=True, allowed_planning_time=1e-4)
    message.planning_options.replan, message.planning_options.replan_attempts = True, 3
    message.planning_options.replan_delay = 0.3
    message.request.goal_constraints = [joint_goal(PAN, START[0] - 3.0)]
    message.planning_options.planning_scene_diff.world.collision_objects = [wall_at(START[0] - 1.5)]
    begun = time.monotonic()
    result = ask(client, message)
    assert result.error_code.val == MoveItErrorCodes.TIMED_OUT
    assert time.monotonic() - begun > 0.6, "three attempts have two delays between them"


def test_a_cancel_while_moving_stops_the_arm(client: Any, arm: FakeArm) -> None:
    client.send_goal(goal(**SLOW))
    arm.until_moving()
    client.cancel_goal()
    assert client.wait_for_result(rospy.Duration(20.0))
    assert client.get_result().error_code.val == MoveItErrorCodes.PREEMPTED
    assert client.get_state() == GoalStatus.PREEMPTED and arm.cancelled.wait(20.0)


def test_the_word_stop_on_the_topic_stops_the_arm(client: Any, arm: FakeArm) -> None:
    events = rospy.Publisher("trajectory_execution_event", String, queue_size=1)
    until(events.get_num_connections, "the listener to the topic")
    client.send_goal(goal(**SLOW))
    arm.until_moving()
    events.publish("stop")
    assert client.wait_for_result(rospy.Duration(20.0))
    assert client.get_result().error_code.val == MoveItErrorCodes.PREEMPTED
    assert arm.cancelled.wait(20.0) and arm.positions[PAN] > GOAL_PAN + 0.1


def test_a_cancel_while_planning_ends_the_planning(client: Any) -> None:
    message = goal(plan_only=True, allowed_planning_time=60.0)
    message.request.planner_id = "RRTstar"  # goes on improving until its time is over
    message.planning_options.planning_scene_diff.world.collision_objects = [wall_at(START[0] - 0.6)]
    client.send_goal(message)
    until(lambda: client.get_state() == GoalStatus.ACTIVE, "the begin of the planning")
    time.sleep(0.5)
    client.cancel_goal()
    assert client.wait_for_result(rospy.Duration(20.0)), "planning went on"
    assert client.get_result().error_code.val == MoveItErrorCodes.PREEMPTED


def test_execution_is_adjusted_while_the_node_runs(client: Any, arm: FakeArm) -> None:
    settings = Client("/move_group/trajectory_execution", timeout=30.0)
    before = settings.get_configuration(timeout=30.0)
    assert before["execution_velocity_scaling"] == 1.0 and before["allowed_execution_duration_scaling"] == 1.2
    assert settings.update_configuration({"execution_velocity_scaling": 50.0})["execution_velocity_scaling"] == 10.0
    settings.update_configuration({"execution_velocity_scaling": 4.0})
    try:
        result = ask(client, goal(**SLOW))
    finally:
        settings.update_configuration({"execution_velocity_scaling": 1.0})
    planned_s = result.planned_trajectory.joint_trajectory.points[-1].time_from_start.to_sec()
    assert result.error_code.val == OK and arm.positions[PAN] == pytest.approx(GOAL_PAN, abs=1e-6)
    assert arm.durations_s[-1] == pytest.approx(planned_s / 4.0, rel=1e-3), "four times as fast as planned"
