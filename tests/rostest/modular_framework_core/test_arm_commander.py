# SPDX-License-Identifier: BSD-3-Clause
"""The arm commander: every call is independent, and every failure has a reason."""

from __future__ import annotations

import threading
import time

import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from moveit_msgs.msg import MoveItErrorCodes, RobotTrajectory

from modular_framework_core.commander import arm_commander
from modular_framework_core.commander.arm_commander import ArmCommander, CommanderError
from modular_framework_core.grasping.grasp_messages import generate_pose_stamped_message
from modular_framework_testing.grasping.fake_move_group import FakeMoveGroup


@pytest.fixture(scope="module")
def commander(ros_session):
    lonely = ArmCommander("arm")
    with pytest.raises(CommanderError, match="robot_description"):
        lonely.connect(0.3)
    rospy.set_param("robot_description", "<robot/>")
    fake = FakeMoveGroup()
    with pytest.raises(CommanderError, match="there is no group 'leg'"):
        ArmCommander("leg").connect(0.3)
    made = ArmCommander("arm")
    made.connect(60.0)
    made.fake = fake
    return made


@pytest.fixture(autouse=True)
def fresh(commander) -> None:
    fake = commander.fake
    fake.reach, fake.blocked, fake.plan_error, fake.execution_error, fake.slow = 1.0, 1.0, 0, 0, False
    fake.requests.clear()


def pose(x: float, y: float = 0.0):
    return generate_pose_stamped_message("world", (x, y, 0), (0, 0, 0, 1))


def test_settings_and_targets_arrive_in_the_request(commander) -> None:
    commander.set_max_velocity_scaling_factor(0.5)
    commander.set_planner_id("RRTConnect")
    commander.set_num_planning_attempts(3)
    commander.set_planning_time(2.5)
    result = commander.plan_to_joint_value_target({"jx": 0.4, "f": 1.0}, custom_start_state={"jx": 0.1, "f": 0.03})
    assert result.success
    request = commander.fake.requests[-1]
    assert (request.group_name, request.planner_id, request.num_planning_attempts) == ("arm", "RRTConnect", 3)
    assert (request.allowed_planning_time, request.max_velocity_scaling_factor) == (2.5, 0.5)
    assert request.start_state.is_diff
    assert dict(zip(request.start_state.joint_state.name, request.start_state.joint_state.position, strict=True)) == {
        "jx": 0.1,
        "f": 0.03,
    }
    assert [(c.joint_name, c.position) for c in request.goal_constraints[0].joint_constraints] == [("jx", 0.4)]


@pytest.mark.parametrize(
    ("name", "asked_for"),
    [
        ("RRT", ("ompl", "RRT")),
        ("pilz/LIN", ("pilz", "LIN")),
        ("LIN", ("pilz", "LIN")),
        ("Quick", ("ompl", "Quick")),
        ("anything/mine", ("anything", "mine")),
        ("", ("", "")),
    ],
)
def test_a_planner_is_asked_for_in_the_pipeline_that_has_it(commander, name: str, asked_for: tuple[str, str]) -> None:
    commander.set_planner_id(name)
    assert commander.plan_to_joint_value_target({"jx": 0.4}).success
    request = commander.fake.requests[-1]
    assert (request.pipeline_id, request.planner_id) == asked_for


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("RRTConect", "There is no planner 'RRTConect'; allowed: LIN, Quick,.*; did you mean 'RRTConnect'?"),
        ("pils/LIN", "There is no pipeline 'pils'; allowed: anything, ompl, pilz; did you mean 'pilz'?"),
        ("pilz/RRT", "There is no planner 'pilz/RRT'; allowed: .*pilz/LIN"),
    ],
)
def test_a_planner_that_is_not_there_is_refused_and_nothing_changes(commander, name: str, fault: str) -> None:
    commander.set_planner_id("RRT")
    with pytest.raises(CommanderError, match=fault):
        commander.set_planner_id(name)
    assert commander.plan_to_joint_value_target({"jx": 0.4}).success
    assert commander.fake.requests[-1].planner_id == "RRT"


def test_another_group_is_planned_for_with_settings_of_its_own(commander) -> None:
    commander.set_num_planning_attempts(3)
    hand = commander.of_group("hand")
    assert hand is commander.of_group("hand") and commander.of_group("") is commander.of_group("arm") is commander
    hand.set_planning_time(9.0)
    assert hand.plan_to_joint_value_target({"f": 0.4}).success
    request = commander.fake.requests[-1]
    assert (request.group_name, request.num_planning_attempts, request.allowed_planning_time) == ("hand", 3, 9.0)
    assert [item.joint_name for item in request.goal_constraints[0].joint_constraints] == ["f"]
    assert commander.plan_to_joint_value_target({"jx": 0.4}).success
    assert commander.fake.requests[-1].allowed_planning_time != 9.0
    assert "group 'hand' is not a chain" in hand.plan_to_pose_target(pose(0.3)).reason
    assert "group 'hand' is not a chain" in hand.solve_ik(pose(0.3)).reason
    assert set(commander.positions_of(["jx", "f", "nobody"])) == {"jx", "f"}
    with pytest.raises(CommanderError, match="there is no group 'leg'"):
        commander.of_group("leg")


def test_a_pose_target_is_a_goal_for_the_tip_and_the_next_call_starts_afresh(commander) -> None:
    assert commander.plan_to_pose_target(pose(0.3), custom_start_state={"jx": 0.2})
    goal = commander.fake.requests[-1].goal_constraints[0]
    assert goal.position_constraints[0].link_name == "tip"
    assert goal.position_constraints[0].constraint_region.primitive_poses[0].position.x == 0.3
    assert goal.orientation_constraints[0].link_name == "tip"
    commander.plan_to_joint_value_target({"jx": 0.0})
    request = commander.fake.requests[-1]
    assert not request.start_state.joint_state.name
    assert not request.goal_constraints[0].position_constraints


def test_threads_do_not_mix_their_targets(commander) -> None:
    ends: dict[int, float] = {}

    def plan(number: int) -> None:
        result = commander.plan_to_joint_value_target({"jx": number / 10})
        ends[number] = result.trajectory.joint_trajectory.points[-1].positions[0]

    threads = [threading.Thread(target=plan, args=(number,)) for number in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert ends == {number: number / 10 for number in range(6)}


def test_a_failed_plan_has_the_reported_reason_and_falls_back_on_the_codes_name(commander) -> None:
    commander.fake.wait_for_listeners()
    commander.fake.plan_error, commander.fake.reason = MoveItErrorCodes.GOAL_IN_COLLISION, "'palm' touches 'wall'"
    result = commander.plan_to_joint_value_target({"jx": 0.0})
    assert not result.success
    assert result.error_code == MoveItErrorCodes.GOAL_IN_COLLISION
    assert result.reason == "GOAL_IN_COLLISION: 'palm' touches 'wall'"
    commander.fake.reason = ""
    assert commander.plan_to_joint_value_target({"jx": 0.0}).reason == "GOAL_IN_COLLISION"
    assert "name joints of the group" in commander.plan_to_joint_value_target({"knee": 0.0}).reason


def test_inverse_kinematics_distinguishes_out_of_reach_from_collision(commander) -> None:
    assert commander.get_ik(pose(0.3, 0.2)) == {"jx": 0.3, "jy": 0.2}
    commander.fake.blocked = 0.1
    result = commander.solve_ik(pose(0.3, 0.2))
    assert not result
    assert "'palm' with 'wall'" in result.reason
    commander.fake.reach = 0.1
    assert "out of reach" in commander.solve_ik(pose(0.3, 0.0)).reason
    assert commander.get_ik(pose(0.3)) is None


def test_the_result_of_an_execution_is_true(commander) -> None:
    plan = commander.plan_to_joint_value_target({"jx": 0.0})
    assert commander.execute_plan(plan)
    commander.fake.execution_error = MoveItErrorCodes.CONTROL_FAILED
    result = commander.execute_plan(plan.trajectory)
    assert not result
    assert result.reason == "CONTROL_FAILED: the controller said no"
    assert not commander.execute_plan(RobotTrajectory())


def test_a_stop_cancels_the_motion(commander) -> None:
    plan = commander.plan_to_joint_value_target({"jx": 0.0})
    commander.fake.slow = True
    commander.fake.moving.clear()
    threading.Thread(target=lambda: commander.fake.moving.wait(60.0) and commander.stop(), daemon=True).start()
    result = commander.execute_plan(plan)
    assert not result
    assert result.error_code == MoveItErrorCodes.PREEMPTED
    deadline = time.monotonic() + 30.0
    while not commander.fake.canceled and time.monotonic() < deadline:
        time.sleep(0.02)
    assert commander.fake.canceled


@pytest.mark.parametrize(
    ("method", "value"),
    [
        ("set_max_velocity_scaling_factor", 0.0),
        ("set_max_velocity_scaling_factor", 1.1),
        ("set_num_planning_attempts", 0),
        ("set_planning_time", 0.0),
    ],
)
def test_settings_out_of_range_are_refused(commander, method: str, value: float) -> None:
    with pytest.raises(CommanderError, match="must be"):
        getattr(commander, method)(value)


def test_a_motion_that_does_not_end_because_time_stands_still_says_so(commander, monkeypatch) -> None:
    plan = commander.plan_to_joint_value_target({"jx": 0.4}).trajectory
    monkeypatch.setattr(arm_commander, "wait_for_result", lambda *_: GoalStatus.LOST)
    assert "stands still" not in commander.execute_plan(plan).reason
    monkeypatch.setattr(rospy, "get_time", lambda: 5.0)
    assert "stands still at 5.000 s" in commander.execute_plan(plan).reason
