# SPDX-License-Identifier: BSD-3-Clause
"""Choice of the controllers that execute a motion, and the goals they get."""

from __future__ import annotations

from typing import Any

import pytest
from controller_manager_msgs.msg import ControllerState, HardwareInterfaceResources
from genpy import Duration
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_planning.errors import PlanningError
from modular_framework_planning.messages.execution_messages import MotionPart, gripper_goal, split, trajectory_goal
from modular_framework_planning.move_group.controllers.fake_controllers import positions_at
from modular_framework_planning.move_group.controllers.ros_control import running_claims, spec_of
from modular_framework_planning.trajectory_execution.controllers import (
    ACTION_KINDS,
    FAKE_KINDS,
    ControllerSpec,
    JointTolerance,
    choose_controllers,
    parse_controllers,
)


def spec(name: str, joints: str, **more: Any) -> ControllerSpec:
    return ControllerSpec(name, "follow", "FollowJointTrajectory", tuple(joints.split()), **more)


def chosen(joints: str, *specs: ControllerSpec, may_switch: bool = False) -> list[str]:
    return [item.name for item in choose_controllers(joints.split(), specs, may_switch)]


def test_one_controller_is_better_than_two() -> None:
    assert chosen("a b", spec("one", "a"), spec("two", "b"), spec("both", "a b")) == ["both"]


def test_several_controllers_share_a_motion() -> None:
    assert chosen("a b", spec("one", "a"), spec("two", "b"), spec("other", "c")) == ["one", "two"]


def test_the_default_controller_is_preferred_then_the_running_one_then_the_one_with_few_joints() -> None:
    assert chosen("a", spec("small", "a"), spec("default", "a b", is_default=True)) == ["default"]
    assert chosen("a", spec("big", "a b"), spec("small", "a")) == ["small"]
    assert chosen("a", spec("off", "a", is_active=False), spec("on", "a b"), may_switch=True) == ["on"]


def test_stopped_controllers_are_chosen_only_where_they_can_be_started() -> None:
    off = spec("off", "a", is_active=False)
    assert chosen("a", off, may_switch=True) == ["off"]
    with pytest.raises(PlanningError, match=r"of a are stopped.*off \(stopped\) moves a.*moveit_manage_controllers"):
        chosen("a", off)
    assert chosen("a b", spec("both", "a b", is_active=False), spec("one", "a"), spec("two", "b")) == ["one", "two"]


def test_joints_nobody_moves_are_named_with_what_each_controller_moves() -> None:
    with pytest.raises(PlanningError, match="no controller moves c, d; known controllers: one moves a, b"):
        chosen("a c d", spec("one", "a b"))
    with pytest.raises(PlanningError, match="known controllers: none"):
        chosen("a")


def test_controllers_that_share_joints_do_not_move_them_together() -> None:
    with pytest.raises(PlanningError, match="share joints"):
        chosen("a b c", spec("one", "a b"), spec("two", "b c"))


def test_all_keys_of_a_controller_are_read() -> None:
    specs, faults = parse_controllers(
        [
            {
                "name": "arm",
                "action_ns": "follow",
                "type": "FollowJointTrajectory",
                "joints": ["a", "b"],
                "default": True,
                "allowed_execution_duration_scaling": 2,
                "allowed_goal_duration_margin": 1.5,
                "goal_time_tolerance": 0.3,
                "path_tolerance": {"position": [0.1, 0.2], "velocity": 1},
                "goal_tolerance": [{"name": "b", "position": 0.01}],
            },
            {"name": "jaws", "type": "GripperCommand", "joints": ["l", "r"], "parallel": True, "max_effort": 5},
            {
                "name": "jaw",
                "type": "GripperCommand",
                "joints": ["l", "r"],
                "command_joint": "r",
                "allow_failure": True,
            },
        ],
        ACTION_KINDS,
    )
    assert not faults
    arm, jaws, jaw = specs
    assert (arm.action, arm.is_default, arm.duration_scaling, arm.duration_margin) == ("arm/follow", True, 2.0, 1.5)
    assert arm.path_tolerances == (JointTolerance("a", 0.1, 1.0), JointTolerance("b", 0.2, 1.0))
    assert arm.goal_tolerances == (JointTolerance("b", 0.01),)
    assert (jaws.command_joints, jaws.max_effort, jaws.allow_failure) == (("l", "r"), 5.0, False)
    assert (jaw.command_joints, jaw.allow_failure, jaw.action) == (("r",), True, "jaw")


def test_entries_that_cannot_be_used_are_left_out_and_named() -> None:
    specs, faults = parse_controllers(
        [
            "text",
            {"name": "a"},
            {"name": "b", "joints": ["x"], "type": "Strange"},
            {"name": "c", "joints": "x", "type": "GripperCommand"},
            {"name": "d", "joints": ["x"], "parallel": True, "type": "GripperCommand"},
            {"name": "e", "joints": ["x"], "type": "GripperCommand", "max_effort": "strong"},
            {"name": "good", "joints": ["x"], "type": "GripperCommand"},
        ],
        ACTION_KINDS,
    )
    assert [item.name for item in specs] == ["good"]
    assert [fault.split(":")[0].split()[0] for fault in faults] == [f"controller_list[{n}]" for n in range(6)]
    assert "allowed: FollowJointTrajectory, GripperCommand" in faults[2]
    assert parse_controllers({"name": "a"}, ACTION_KINDS)[1] == [
        "controller_list is a dict; it must be a list with name, joints and type"
    ]


def test_fake_controllers_interpolate_unless_configured_otherwise() -> None:
    specs, faults = parse_controllers(
        [{"name": "a", "joints": ["x"]}, {"name": "b", "joints": ["x"], "type": "last point", "rate": 50}],
        FAKE_KINDS,
        FAKE_KINDS[0],
    )
    assert not faults
    assert [(item.kind, item.rate) for item in specs] == [("interpolate", 0.0), ("last point", 50.0)]


def two_points(**last: Any) -> JointTrajectory:
    return JointTrajectory(
        joint_names=["a", "l", "r"],
        points=[
            JointTrajectoryPoint(positions=[0.0, 0.0, 0.0]),
            JointTrajectoryPoint(positions=[1.0, 0.02, 0.03], time_from_start=Duration(2), **last),
        ],
    )


def test_a_gripper_is_sent_where_its_command_joints_end() -> None:
    jaws = ControllerSpec("jaws", "cmd", "GripperCommand", ("l", "r"), command_joints=("l", "r"), max_effort=5.0)
    jaw = ControllerSpec("jaw", "cmd", "GripperCommand", ("l", "r"), command_joints=("r",))
    (both,), (one,) = split(two_points(), [jaws]), split(two_points(effort=[0.0, 7.0, 8.0]), [jaw])
    assert (gripper_goal(both).command.position, gripper_goal(both).command.max_effort) == (0.05, 5.0)
    assert (gripper_goal(one).command.position, gripper_goal(one).command.max_effort) == (0.03, 8.0)


def test_configured_tolerances_go_with_the_goal_of_the_joints_that_move() -> None:
    arm = spec(
        "arm", "a b", path_tolerances=(JointTolerance("a", 0.1), JointTolerance("b", 0.2)), goal_time_tolerance=0.5
    )
    goal = trajectory_goal(MotionPart(arm, JointTrajectory(joint_names=["a"], points=[JointTrajectoryPoint()])))
    assert [(item.name, item.position) for item in goal.path_tolerance] == [("a", 0.1)]
    assert goal.goal_time_tolerance.to_sec() == 0.5


def loaded(name: str, kind: str, state: str, *joints: str) -> ControllerState:
    return ControllerState(
        name=name,
        type=kind,
        state=state,
        claimed_resources=[HardwareInterfaceResources("hardware_interface::PositionJointInterface", list(joints))],
    )


def test_controllers_of_ros_control_that_take_motions_are_recognised_by_their_type() -> None:
    arm = spec_of(loaded("arm", "position_controllers/JointTrajectoryController", "stopped", "a", "b"), "/robot")
    assert arm is not None
    assert (arm.action, arm.joints, arm.is_active) == ("/robot/arm/follow_joint_trajectory", ("a", "b"), False)
    jaw = spec_of(loaded("jaw", "effort_controllers/GripperActionController", "running", "l"))
    assert jaw is not None
    assert (jaw.action, jaw.kind) == ("/jaw/gripper_cmd", "GripperCommand")
    assert (jaw.command_joints, jaw.is_active) == (("l",), True)
    assert spec_of(loaded("states", "joint_state_controller/JointStateController", "running")) is None


def test_running_controllers_that_hold_a_joint_are_to_be_stopped_first() -> None:
    states = [
        loaded("old", "x", "running", "a"),
        loaded("other", "x", "running", "c"),
        loaded("off", "x", "stopped", "a"),
        loaded("new", "x", "stopped", "a", "b"),
    ]
    assert running_claims(states, {"a", "b"}, {"new"}) == ["old"]


def test_a_fake_robot_moves_on_straight_lines_between_the_points() -> None:
    assert positions_at(two_points(), 0.5) == pytest.approx([0.25, 0.005, 0.0075])
    assert positions_at(two_points(), 9.0) == pytest.approx([1.0, 0.02, 0.03])
