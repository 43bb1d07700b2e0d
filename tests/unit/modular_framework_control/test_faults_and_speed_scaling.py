# SPDX-License-Identifier: BSD-3-Clause
"""Controllers during hardware faults, and with speed scaling down to 0."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from modular_framework_control.controller_interface.controller import ControllerError
from modular_framework_control.controllers.gripper_action_controller import GripperGoalHandle
from modular_framework_control.hardware_interface.handles import SpeedScalingHandle
from modular_framework_control.realtime.goal_handle import GoalStatus, RealtimeGoalHandle
from modular_framework_control.trajectory.joint_trajectory import JointTrajectory, TrajectoryPoint
from modular_framework_control.trajectory.trajectory_clock import RATE_RISE_PER_S, TrajectoryClock
from modular_framework_control.trajectory.trajectory_goal import (
    TrajectoryErrorCode,
    TrajectoryGoal,
    TrajectoryGoalHandle,
)
from modular_framework_testing.control.movable_robot_hw import MovableRobotHW

FAMILIES = {
    "position": "PositionJointInterface",
    "velocity": "VelocityJointInterface",
    "effort": "EffortJointInterface",
    "pos_vel": "PosVelJointInterface",
    "pos_vel_acc": "PosVelAccJointInterface",
}
GAINS = {"velocity": {"p": 20.0}, "effort": {"p": 100.0, "d": 20.0}}
ZEROS = (0.0, 0.0)


@pytest.fixture
def start(make_loop: Callable[..., Any]) -> Callable[..., Any]:
    def starter(family: str = "position", controller: str = "JointTrajectoryController", **more: Any) -> Any:
        loop = make_loop(
            {
                "hw": {"joints": ["a", "b"], "command_interface": FAMILIES[family]},
                "c": {
                    "type": f"{family}_controllers/{controller}",
                    "joints": ["a", "b"],
                    "gains": {"a": GAINS.get(family), "b": GAINS.get(family)},
                    **more,
                },
            },
            MovableRobotHW(),
        )
        loop.spawn("c")
        return loop

    return starter


def send(loop: Any, *points: tuple[float, Sequence[float]]) -> TrajectoryGoalHandle:
    goal_handle = TrajectoryGoalHandle()
    rows = tuple(TrajectoryPoint(time_s, tuple(row), ZEROS, ZEROS) for time_s, row in points)
    loop.controllers["c"].submit(TrajectoryGoal(JointTrajectory.of_points(("a", "b"), rows)), goal_handle)
    return goal_handle


def positions(loop: Any) -> list[float]:
    return [joint.position for joint in loop.robot_hw.joints]


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_a_fault_ends_the_goal_in_the_same_cycle_and_says_why(start: Callable[..., Any], family: str) -> None:
    loop = start(family)
    goal_handle = send(loop, (1.0, (1.0, -1.0)))
    loop.run(0.5)
    assert goal_handle.status is GoalStatus.ACTIVE
    loop.robot_hw.reason = "protective stop"
    loop.step()
    assert (goal_handle.status, goal_handle.result) == (GoalStatus.ABORTED, TrajectoryErrorCode.INVALID_GOAL)
    assert goal_handle.text == "hardware fault: protective stop"


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_after_a_fault_the_joints_are_held_where_they_are_then_and_new_goals_begin_there(
    start: Callable[..., Any], family: str
) -> None:
    loop = start(family, constraints={"goal_time": 0.5})
    send(loop, (1.0, (1.0, -1.0)))
    loop.run(0.5)
    loop.robot_hw.reason = "link lost"
    loop.step(3)
    loop.robot_hw.by_hand = [0.25, 0.75]
    loop.run(0.2)
    for joint, place in zip(loop.robot_hw.joints, (0.25, 0.75), strict=True):
        assert joint.command == (0.0 if family in GAINS else place)
    refused = send(loop, (1.0, (0.0, 0.0)))
    loop.step()
    assert (refused.status, refused.text) == (GoalStatus.REJECTED, "hardware fault: link lost")
    loop.robot_hw.by_hand = [0.3, 0.7]
    loop.robot_hw.reason = ""
    loop.step()
    loop.robot_hw.by_hand = None
    loop.run(0.3)
    assert positions(loop) == pytest.approx([0.3, 0.7], abs=1e-3)
    goal_handle = send(loop, (1.0, (0.4, 0.6)))
    loop.run(1.5)
    assert goal_handle.status is GoalStatus.SUCCEEDED
    assert positions(loop) == pytest.approx([0.4, 0.6], abs=0.01)


def test_a_controller_started_during_a_fault_refuses_goals_until_it_is_over(start: Callable[..., Any]) -> None:
    loop = start()
    assert loop.switch([], ["c"]) is None
    loop.robot_hw.reason = "emergency stop"
    assert loop.switch(["c"], []) is None
    refused = send(loop, (0.5, (0.1, 0.1)))
    loop.step(2)
    assert refused.text == "hardware fault: emergency stop"
    loop.robot_hw.reason = ""
    loop.step()
    goal_handle = send(loop, (0.5, (0.1, 0.1)))
    loop.run(0.6)
    assert goal_handle.status is GoalStatus.SUCCEEDED


@pytest.mark.parametrize("family", ["position", "effort"])
def test_a_gripper_drops_its_goal_in_a_fault_and_holds_where_it_is(start: Callable[..., Any], family: str) -> None:
    loop = start(family, "GripperActionController", joint="a", goal_tolerance=0.001)
    goal_handle: GripperGoalHandle = RealtimeGoalHandle()
    loop.robot_hw.by_hand = [0.2]
    loop.controllers["c"].submit(1.0, 0.0, goal_handle)
    loop.step(2)
    joint = loop.robot_hw.joints[0]
    loop.robot_hw.reason, loop.robot_hw.by_hand = "servo 1: overload", [0.4]
    loop.step()
    assert (goal_handle.status, goal_handle.text) == (GoalStatus.ABORTED, "hardware fault: servo 1: overload")
    assert goal_handle.result is not None and not goal_handle.result.stalled and not goal_handle.result.reached_goal
    loop.step(2)
    assert joint.command == (0.4 if family == "position" else 0.0)
    refused: GripperGoalHandle = RealtimeGoalHandle()
    loop.controllers["c"].submit(1.0, 0.0, refused)
    loop.step()
    assert (refused.status, refused.text) == (GoalStatus.REJECTED, "hardware fault: servo 1: overload")
    loop.robot_hw.reason, loop.robot_hw.by_hand = "", None
    loop.run(0.3)
    assert joint.position == pytest.approx(0.4, abs=1e-3)


@pytest.mark.parametrize(
    ("family", "kind", "rest"),
    [("position", "Position", 0.4), ("velocity", "Velocity", 0.0), ("effort", "Effort", 0.0)],
)
def test_commands_before_and_during_a_fault_are_not_followed_after_it(
    start: Callable[..., Any], family: str, kind: str, rest: float
) -> None:
    loop = start(family, f"JointGroup{kind}Controller")
    loop.controllers["c"].submit([0.1, 0.1])
    loop.step(2)
    loop.robot_hw.reason, loop.robot_hw.by_hand = "unplugged", [0.4, 0.4]
    loop.step(2)
    with pytest.raises(ControllerError, match="hardware fault: unplugged"):
        loop.controllers["c"].submit([0.9, 0.9])
    loop.robot_hw.reason = ""
    loop.step(2)
    assert [joint.command for joint in loop.robot_hw.joints] == [rest, rest]
    loop.controllers["c"].submit([0.2, 0.2])
    loop.step()
    assert loop.robot_hw.joints[0].command == 0.2


def test_a_joint_moved_while_no_controller_ran_is_not_sent_back_when_one_starts(start: Callable[..., Any]) -> None:
    loop = start()
    assert loop.switch([], ["c"]) is None
    loop.robot_hw.by_hand = [0.5, 0.6]
    loop.step()
    assert loop.switch(["c"], []) is None
    assert [joint.command for joint in loop.robot_hw.joints] == [0.5, 0.6]


def test_a_controller_that_starts_on_resting_joints_brings_nothing_to_rest(start: Callable[..., Any]) -> None:
    loop = start(stop_trajectory_duration=0.5)
    assert not loop.controllers["c"].moving  # a simulation whose time is held would let time pass for it
    loop.step()
    assert not loop.controllers["c"].moving


def test_a_robot_at_a_tenth_of_its_speed_takes_ten_times_as_long_on_the_same_path(start: Callable[..., Any]) -> None:
    tight = {"trajectory": 0.03, "goal": 0.001}
    loop = start(constraints={"a": tight, "b": tight})
    loop.robot_hw.scaling.factor = 0.1
    loop.run(1.0)
    goal_handle = send(loop, (0.5, (0.4, -0.2)), (1.0, (1.0, 0.3)))
    seen = []
    for _ in range(990):
        loop.step()
        seen.append([joint.command for joint in loop.robot_hw.joints])
    assert goal_handle.status is GoalStatus.ACTIVE
    loop.run(0.2)
    assert goal_handle.status is GoalStatus.SUCCEEDED
    loop.robot_hw.scaling.factor = 1.0
    loop.robot_hw.by_hand = [0.0, 0.0]
    loop.run(1.0)
    assert loop.switch([], ["c"]) is None and loop.switch(["c"], []) is None
    loop.robot_hw.by_hand = None
    send(loop, (0.5, (0.4, -0.2)), (1.0, (1.0, 0.3)))
    for cycle in range(99):
        loop.step()
        assert [joint.command for joint in loop.robot_hw.joints] == pytest.approx(seen[10 * cycle], abs=1e-9)


def test_a_paused_robot_stays_where_it_is_and_goes_on_smoothly(start: Callable[..., Any]) -> None:
    tight = {"trajectory": 0.02, "goal": 0.001}
    loop = start(constraints={"a": tight, "b": tight})
    goal_handle = send(loop, (1.0, (1.0, -1.0)))
    loop.run(0.5)
    loop.robot_hw.scaling.factor = 0.0
    loop.step()
    held = [joint.command for joint in loop.robot_hw.joints]
    loop.run(5.0)
    assert [joint.command for joint in loop.robot_hw.joints] == held
    assert goal_handle.status is GoalStatus.ACTIVE
    loop.robot_hw.scaling.factor = 1.0
    steps = [np.array(held)]
    for _ in range(100):
        loop.step()
        steps.append(np.array([joint.command for joint in loop.robot_hw.joints]))
    velocities = np.diff(steps, axis=0) / loop.period_s
    fastest = 15.0 / 8.0
    assert np.abs(velocities).max() < fastest * 1.001
    assert np.abs(np.diff(velocities, axis=0)).max() < fastest * RATE_RISE_PER_S * loop.period_s * 1.6
    assert goal_handle.status is GoalStatus.SUCCEEDED
    assert steps[-1] == pytest.approx([1.0, -1.0], abs=1e-9)


def test_the_velocity_wanted_of_a_slowed_robot_is_as_much_lower(start: Callable[..., Any]) -> None:
    loop = start("pos_vel_acc")
    loop.robot_hw.scaling.factor = 0.25
    loop.run(0.1)
    send(loop, (1.0, (1.0, 0.0)))
    loop.run(0.5)
    joint = loop.robot_hw.joints[0]
    before = joint.command
    loop.step()
    assert joint.command_velocity == pytest.approx((joint.command - before) / loop.period_s, rel=0.02)
    velocity = joint.command_velocity
    loop.step()
    assert joint.command_acceleration == pytest.approx((joint.command_velocity - velocity) / loop.period_s, rel=0.05)


@pytest.mark.parametrize("factor", [0.0, 0.25, 1.0])
def test_what_a_robot_is_asked_to_do_later_allows_for_how_slowly_it_moves(
    start: Callable[..., Any], factor: float
) -> None:
    loop = start("pos_vel_acc")
    send(loop, (1.0, (1.0, 0.0)))
    loop.run(0.2)
    loop.robot_hw.scaling.factor = factor
    loop.run(0.1)
    foretold = loop.controllers["c"].desired_at(loop.time_s + 0.19)
    loop.run(0.2)
    joint = loop.robot_hw.joints[0]
    assert foretold[:, 0] == pytest.approx([joint.command, joint.command_velocity, joint.command_acceleration])


@pytest.mark.parametrize("factor", [0.0, 0.5])
def test_cancel_of_a_slowed_goal_does_not_move_the_robot_further_than_it_would_roll(
    start: Callable[..., Any], factor: float
) -> None:
    loop = start(stop_trajectory_duration=0.2)
    goal_handle = send(loop, (1.0, (1.0, 0.0)))
    loop.run(0.5)
    loop.robot_hw.scaling.factor = factor
    loop.step(2)
    before, speed = loop.robot_hw.joints[0].command, 15.0 / 8.0 * factor
    loop.controllers["c"].cancel(goal_handle)
    loop.run(0.5)
    loop.robot_hw.scaling.factor = 1.0
    loop.run(0.5)
    assert loop.robot_hw.joints[0].command - before == pytest.approx((0.5 * 0.2 + loop.period_s) * speed, abs=0.002)


def test_goal_time_passes_as_slowly_as_the_robot_moves(start: Callable[..., Any]) -> None:
    loop = start(constraints={"goal_time": 0.2, "a": {"goal": 0.01}})
    goal_handle = send(loop, (0.5, (0.3, 0.0)))
    loop.run(0.5)
    loop.robot_hw.by_hand = [0.2, 0.0]
    loop.robot_hw.scaling.factor = 0.1
    loop.run(1.5)
    assert goal_handle.status is GoalStatus.ACTIVE
    loop.run(0.6)
    assert goal_handle.result is TrajectoryErrorCode.GOAL_TOLERANCE_VIOLATED


def test_a_clock_slows_at_once_speeds_up_gradually_and_never_runs_ahead() -> None:
    handles = [SpeedScalingHandle("one", ["a"]), SpeedScalingHandle("two", ["b"])]
    clock = TrajectoryClock(handles)
    clock.start(100.0)
    clock.advance(100.1)
    assert (clock.now_s, clock.rate) == (100.1, 1.0)
    handles[1].factor = 0.2
    clock.advance(100.2)
    assert clock.now_s == pytest.approx(100.12) and clock.time_at(100.7) == pytest.approx(100.62)
    for nonsense, share in ((-1.0, 0.0), (math.nan, 0.0), (7.0, 0.2)):
        handles[0].factor = nonsense
        clock.start(0.0)
        assert clock.rate == share
    handles[1].factor = 1.0
    clock.advance(0.1)
    assert clock.rate == pytest.approx(0.2 + 0.1 * RATE_RISE_PER_S)
    clock.advance(5.0)
    assert clock.rate == 1.0 and clock.now_s < 5.0
