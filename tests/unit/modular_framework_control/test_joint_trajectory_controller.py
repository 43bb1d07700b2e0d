# SPDX-License-Identifier: BSD-3-Clause
"""The trajectory controller in a loop with fake hardware: following, tolerances, stops, splices, refusals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import BPoly

from modular_framework_control.controller_interface.controller import ControllerError
from modular_framework_control.controller_manager.controller_switch import ControllerState
from modular_framework_control.controllers import joint_trajectory_controller
from modular_framework_control.hardware_interface.interfaces import PositionJointInterface
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.realtime.goal_handle import GoalStatus
from modular_framework_control.trajectory.joint_trajectory import JointTrajectory, TrajectoryPoint
from modular_framework_control.trajectory.tolerances import JointTolerance
from modular_framework_control.trajectory.trajectory_goal import (
    GoalRejectedError,
    TrajectoryErrorCode,
    TrajectoryGoal,
    TrajectoryGoalHandle,
)

URDF = """<robot name="r"><joint name="a" type="revolute"><limit lower="-9" upper="9" velocity="90" effort="1"/></joint>
<joint name="b" type="revolute"><limit lower="-9" upper="9" velocity="90" effort="1"/></joint>
<joint name="c" type="continuous"/></robot>"""
ZEROS = (0.0, 0.0, 0.0)


def parameters(**more: Any) -> dict[str, Any]:
    return {
        "robot_description": URDF,
        "hw": {"joints": ["a", "b", "c"]},
        "arm": {
            "type": "position_controllers/JointTrajectoryController",
            "joints": ["a", "b", "c"],
            "constraints": {"goal_time": 0.2, "a": {"goal": 0.01}, "b": {"trajectory": 0.1, "goal": 0.01}},
            **more,
        },
    }


class SluggishRobotHW(MockRobotHW):
    """Fake hardware whose joint b is no faster than 1 rad/s, which its limits do not say."""

    def read(self, time_s: float, period_s: float) -> None:
        before = self._handles[1].position
        super().read(time_s, period_s)
        joint = self._handles[1].state
        joint.velocity = min(max((joint.position - before) / period_s, -1.0), 1.0) if period_s > 0.0 else 0.0
        joint.position = before + joint.velocity * period_s


@pytest.fixture
def start(make_loop: Callable[..., Any]) -> Callable[..., Any]:
    def starter(**more: Any) -> Any:
        loop = make_loop(parameters(**more), SluggishRobotHW())
        loop.spawn("arm")
        return loop

    return starter


@pytest.fixture
def loop(start: Callable[..., Any]) -> Any:
    return start()


def points(*rows: tuple[float, tuple[float, ...]]) -> tuple[TrajectoryPoint, ...]:
    return tuple(TrajectoryPoint(time_s, row, (0.0,) * len(row), (0.0,) * len(row)) for time_s, row in rows)


def send(
    loop: Any,
    *rows: tuple[float, tuple[float, ...]],
    names: tuple[str, ...] = ("a", "b", "c"),
    stamp_s: float = 0.0,
    **more: Any,
) -> TrajectoryGoalHandle:
    goal_handle = TrajectoryGoalHandle()
    trajectory = JointTrajectory.of_points(names, points(*rows), stamp_s)
    loop.controllers["arm"].submit(TrajectoryGoal(trajectory, **more), goal_handle)
    return goal_handle


def command(loop: Any, *rows: tuple[float, tuple[float, ...]], stamp_s: float = 0.0) -> None:
    trajectory = JointTrajectory.of_points(("a", "b", "c"), points(*rows), stamp_s)
    loop.controllers["arm"].submit(TrajectoryGoal(trajectory))


def commands(loop: Any) -> list[float]:
    return [handle.command for handle in loop.robot_hw.get(PositionJointInterface).handles]


def test_a_random_trajectory_of_ten_points_is_tracked_to_a_millionth(make_loop: Callable[..., Any]) -> None:
    loop = make_loop(parameters())
    loop.spawn("arm")
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(0.4, 0.8, 10))
    states = rng.uniform(-0.3, 0.3, (10, 3, 3)) * np.array([1.0, 0.5, 0.5])[:, np.newaxis]
    sent = tuple(TrajectoryPoint(float(t), *map(tuple, state)) for t, state in zip(times, states, strict=True))
    goal_handle = TrajectoryGoalHandle()
    loop.controllers["arm"].submit(TrajectoryGoal(JointTrajectory.of_points(("a", "b", "c"), sent)), goal_handle)
    begun_s = loop.time_s
    knots = np.concatenate([[0.0], times])
    splines = [BPoly.from_derivatives(knots, np.concatenate([[ZEROS], states[:, :, joint]])) for joint in range(3)]
    handles = loop.robot_hw.get(PositionJointInterface).handles
    while loop.time_s - begun_s < times[-1]:
        time_s = loop.time_s
        loop.step()
        loop.robot_hw.read(loop.time_s, loop.period_s)
        for handle, spline in zip(handles, splines, strict=True):
            assert abs(handle.position - float(spline(min(time_s - begun_s, times[-1])))) < 1e-6
    assert goal_handle.status is GoalStatus.ACTIVE


def test_success_is_reported_with_its_code(loop: Any) -> None:
    goal_handle = send(loop, (0.5, (0.3, 0.1, 0.1)))
    loop.run(0.45)
    assert goal_handle.status is GoalStatus.ACTIVE
    loop.run(0.1)
    assert (goal_handle.status, goal_handle.result) == (GoalStatus.SUCCEEDED, TrajectoryErrorCode.SUCCESSFUL)


def test_a_joint_off_its_path_aborts_and_the_arm_stops(loop: Any) -> None:
    goal_handle = send(loop, (0.5, (0.3, 1.5, 0.1)))
    loop.run(0.5)
    assert (goal_handle.status, goal_handle.result) == (GoalStatus.ABORTED, TrajectoryErrorCode.PATH_TOLERANCE_VIOLATED)
    assert "joint 'b': position error 0.1" in goal_handle.text and "tolerance 0.1" in goal_handle.text
    desired = loop.controllers["arm"].desired_at(loop.time_s)
    assert not desired[1:].any() and desired[0, 0] < 0.3


def test_a_joint_short_of_its_goal_aborts_after_goal_time(loop: Any) -> None:
    goal_handle = send(loop, (0.5, (0.3, 1.5, 0.1)), path_tolerance={"b": JointTolerance(-1.0)})
    loop.run(0.65)
    assert goal_handle.status is GoalStatus.ACTIVE
    loop.run(0.1)
    assert (goal_handle.status, goal_handle.result) == (GoalStatus.ABORTED, TrajectoryErrorCode.GOAL_TOLERANCE_VIOLATED)
    assert "joint 'b'" in goal_handle.text and "goal_time 0.2 s" in goal_handle.text


def test_a_late_joint_within_goal_time_succeeds(loop: Any) -> None:
    goal_handle = send(loop, (0.5, (0.3, 0.6, 0.1)), path_tolerance={"b": JointTolerance(-1.0)})
    loop.run(0.75)
    assert goal_handle.status is GoalStatus.SUCCEEDED


def test_the_goal_may_lengthen_goal_time_widen_and_erase_tolerances(loop: Any) -> None:
    free = {"b": JointTolerance(-1.0)}
    longer = send(loop, (0.5, (0.3, 1.5, 0.1)), path_tolerance=free, goal_time_tolerance_s=5.0)
    loop.run(1.7)
    assert longer.status is GoalStatus.SUCCEEDED
    erased = send(loop, (0.5, (0.0, 0.0, 0.1)), path_tolerance=free, goal_tolerance={"b": JointTolerance(-1.0, -1.0)})
    loop.run(0.55)
    assert erased.status is GoalStatus.SUCCEEDED


def test_a_goal_with_no_goal_time_at_all_must_be_there_at_once(loop: Any) -> None:
    goal_handle = send(
        loop, (0.5, (0.3, 0.6, 0.1)), path_tolerance={"b": JointTolerance(-1.0)}, goal_time_tolerance_s=-1.0
    )
    loop.run(0.52)
    assert goal_handle.result is TrajectoryErrorCode.GOAL_TOLERANCE_VIOLATED


def test_a_joint_that_still_moves_has_not_reached_its_goal(start: Callable[..., Any]) -> None:
    loop = start(constraints={"goal_time": 0.05, "stopped_velocity_tolerance": 0.01})
    goal_handle = send(loop, (0.5, (0.0, 1.0, 0.0)))
    loop.run(0.6)
    assert goal_handle.result is TrajectoryErrorCode.GOAL_TOLERANCE_VIOLATED
    assert "joint 'b': velocity error" in goal_handle.text


@pytest.mark.parametrize(
    ("names", "rows", "more", "code", "words"),
    [
        (("a", "b", "x"), [(1.0, ZEROS)], {}, -2, "unknown joint 'x'"),
        (("a", "b"), [(1.0, (0.0, 0.0))], {}, -2, "joints missing: c (allow_partial_joints_goal is false)"),
        (("a", "b", "b"), [(1.0, ZEROS)], {}, -2, "joint 'b' is named twice"),
        ((), [], {}, -2, "joints missing: a, b, c"),
        (
            ("a", "b", "c"),
            [(1.0, (0.0, math.nan, 0.0))],
            {},
            -1,
            "point 0: position of joint 'b' (index 1) is nan; expected a finite number",
        ),
        (("a", "b", "c"), [(1.0, (0.0,))], {}, -1, "has 1 positions; expected 3"),
        (("a", "b", "c"), [(1.0, ZEROS), (1.0, ZEROS)], {}, -1, "must increase strictly"),
        (("a", "b", "c"), [(1.0, ZEROS)], {"path_tolerance": {"a": JointTolerance(math.nan)}}, -1, "is not a number"),
        (("a", "b", "c"), [(1.0, ZEROS)], {"goal_time_tolerance_s": math.nan}, -1, "goal_time_tolerance"),
    ],
)
def test_a_malformed_goal_is_refused_with_code_and_reason(
    loop: Any, names: tuple[str, ...], rows: list[Any], more: dict[str, Any], code: int, words: str
) -> None:
    with pytest.raises(GoalRejectedError) as caught:
        send(loop, *rows, names=names, **more)
    assert caught.value.code == code
    assert words in str(caught.value)
    loop.step(3)
    assert loop.states()["arm"] == "running"


def test_a_tolerance_of_a_joint_that_the_controller_does_not_have_is_left_out_with_a_warning(
    loop: Any, caplog: pytest.LogCaptureFixture
) -> None:
    goal_handle = send(loop, (0.5, (0.3, 0.1, 0.1)), goal_tolerance={"x": JointTolerance(1e-9)})
    loop.run(0.6)
    assert goal_handle.status is GoalStatus.SUCCEEDED
    assert "ignored: goal_tolerance of joint 'x'; joints of the controller: a, b, c" in caplog.text


def test_a_first_point_before_the_beginning_lies_in_the_past_and_is_left_out(loop: Any) -> None:
    goal_handle = send(loop, (-0.1, (5.0, 5.0, 5.0)), (0.5, (0.3, 0.1, 0.1)))
    loop.run(0.6)
    assert goal_handle.status is GoalStatus.SUCCEEDED
    assert commands(loop) == pytest.approx([0.3, 0.1, 0.1])
    late = send(loop, (-0.2, ZEROS), (-0.1, ZEROS))
    loop.step()
    assert late.status is GoalStatus.REJECTED and "in the past" in late.text


@pytest.mark.parametrize(("rows", "stamp_back_s"), [([(0.0, ZEROS)], 0.0), ([(0.5, ZEROS), (1.0, ZEROS)], 1.5)])
def test_a_goal_wholly_in_the_past_is_rejected(loop: Any, rows: list[Any], stamp_back_s: float) -> None:
    stamp_s = loop.time_s - stamp_back_s if stamp_back_s else 0.0
    goal_handle = send(loop, *rows, stamp_s=stamp_s)
    loop.step()
    assert (goal_handle.status, goal_handle.result) == (GoalStatus.REJECTED, TrajectoryErrorCode.INVALID_GOAL)
    assert "in the past" in goal_handle.text


def test_points_in_the_past_are_left_out(loop: Any) -> None:
    goal_handle = send(loop, (0.1, (5.0, 5.0, 5.0)), (1.0, (0.2, 0.1, 0.1)), stamp_s=loop.time_s - 0.5)
    loop.run(0.55)
    assert goal_handle.status is GoalStatus.SUCCEEDED
    assert commands(loop) == pytest.approx([0.2, 0.1, 0.1])


def test_a_stamp_in_the_future_lets_the_old_motion_go_on_until_then(loop: Any) -> None:
    begun_s = loop.time_s
    command(loop, (1.0, (1.0, 0.4, 0.0)))
    loop.run(0.2)
    old = loop.controllers["arm"].desired_at(begun_s + 0.49)
    goal_handle = send(loop, (0.5, (0.0, 0.0, 0.0)), stamp_s=begun_s + 0.5)
    loop.step()
    assert loop.controllers["arm"].desired_at(begun_s + 0.49) == pytest.approx(old)
    seen = [loop.controllers["arm"].desired_at(begun_s + t)[0] for t in np.linspace(0.3, 1.0, 400)]
    assert np.abs(np.diff(seen, axis=0)).max() < 0.01
    loop.run(0.9)
    assert goal_handle.status is GoalStatus.SUCCEEDED
    assert commands(loop) == pytest.approx(ZEROS, abs=1e-9)


def test_a_new_goal_takes_over_without_a_jump_in_position_or_velocity(loop: Any) -> None:
    first = send(loop, (1.0, (1.0, 0.3, 0.2)))
    loop.run(0.5)
    before = loop.controllers["arm"].desired_at(loop.time_s)
    second = send(loop, (0.5, (0.2, 0.1, 0.1)))
    time_s = loop.time_s
    loop.step()
    assert loop.controllers["arm"].desired_at(time_s) == pytest.approx(before, abs=1e-9)
    assert (first.status, second.status) == (GoalStatus.CANCELED, GoalStatus.ACTIVE)
    assert "preempted" in first.text
    loop.run(0.6)
    assert second.status is GoalStatus.SUCCEEDED


@pytest.mark.parametrize("duration_s", [0.0, 0.2])
def test_cancel_comes_to_rest_within_the_stop_duration(start: Callable[..., Any], duration_s: float) -> None:
    loop = start(stop_trajectory_duration=duration_s)
    goal_handle = send(loop, (1.0, (1.0, 0.0, 0.0)))
    loop.run(0.5)
    velocity = loop.controllers["arm"].desired_at(loop.time_s)[1, 0]
    loop.controllers["arm"].cancel(goal_handle)
    canceled_s = loop.time_s
    loop.step()
    assert goal_handle.status is GoalStatus.CANCELED
    at_cancel = loop.controllers["arm"].desired_at(canceled_s)
    end = loop.controllers["arm"].desired_at(canceled_s + duration_s + 1e-6)
    assert at_cancel[1, 0] == pytest.approx(velocity if duration_s else 0.0, rel=0.01)
    assert end[1, 0] == 0.0
    assert end[0, 0] == pytest.approx(at_cancel[0, 0] + 0.5 * velocity * duration_s, abs=1e-3)


def test_cancel_of_a_finished_goal_changes_nothing(loop: Any) -> None:
    first = send(loop, (0.2, (0.1, 0.0, 0.0)))
    loop.run(0.3)
    second = send(loop, (0.3, (0.2, 0.0, 0.0)))
    loop.step()
    loop.controllers["arm"].cancel(first)
    loop.run(0.4)
    assert second.status is GoalStatus.SUCCEEDED


def test_an_empty_goal_stops_and_succeeds_and_an_empty_command_stops(loop: Any) -> None:
    command(loop, (1.0, (1.0, 0.0, 0.0)))
    loop.run(0.5)
    goal_handle = send(loop)
    loop.run(0.1)
    assert goal_handle.status is GoalStatus.SUCCEEDED
    held = commands(loop)
    loop.run(0.3)
    assert commands(loop) == held
    command(loop, (1.0, (0.0, 0.0, 0.0)))
    loop.run(0.5)
    loop.controllers["arm"].submit(TrajectoryGoal(JointTrajectory.of_points((), ())))
    loop.step(2)
    assert not loop.controllers["arm"].desired_at(loop.time_s)[1].any()


def test_a_partial_goal_moves_its_joints_and_lets_the_others_finish(start: Callable[..., Any]) -> None:
    loop = start(allow_partial_joints_goal=True)
    command(loop, (1.0, (0.5, 0.3, 0.2)))
    loop.run(0.5)
    goal_handle = send(loop, (0.3, (0.0,)), names=("a",))
    loop.run(0.4)
    assert goal_handle.status is GoalStatus.ACTIVE, "the motion of the others has not ended"
    loop.run(0.3)
    assert goal_handle.status is GoalStatus.SUCCEEDED
    assert commands(loop) == pytest.approx([0.0, 0.3, 0.2], abs=1e-9)


def test_a_partial_goal_may_have_values_for_more_joints_than_it_names(
    start: Callable[..., Any], caplog: pytest.LogCaptureFixture
) -> None:
    loop = start(allow_partial_joints_goal=True)
    goal_handle = send(loop, (0.5, (0.1, 0.4)), (1.0, (0.2, 0.3)), names=("b",))
    loop.run(1.1)
    assert goal_handle.status is GoalStatus.SUCCEEDED
    assert commands(loop) == pytest.approx([0.0, 0.2, 0.0], abs=1e-9)
    assert "points have 2 values each, only the first 1 are used, for: b" in caplog.text


@pytest.mark.parametrize(
    "points", [[(0.3, (0.4, 0.1)), (0.6, (0.2,))], [(0.3, (0.4,)), (0.6, (0.2, 0.1))], [(0.3, ()), (0.6, ())]]
)
def test_partial_goals_with_points_of_different_or_too_small_sizes_are_refused(
    start: Callable[..., Any], points: list[Any]
) -> None:
    loop = start(allow_partial_joints_goal=True)
    with pytest.raises(GoalRejectedError, match="positions; expected 1"):
        send(loop, *points, names=("b",))


def test_joints_may_be_named_in_any_order(loop: Any) -> None:
    send(loop, (0.5, (0.3, 0.2, 0.1)), names=("c", "b", "a"))
    loop.run(0.6)
    assert commands(loop) == pytest.approx([0.1, 0.2, 0.3])


def test_a_continuous_joint_takes_the_short_way(loop: Any) -> None:
    goal_handle = send(loop, (0.5, (0.0, 0.0, 2.0 * math.pi + 0.1)))
    loop.run(0.6)
    assert goal_handle.status is GoalStatus.SUCCEEDED
    assert commands(loop)[2] == pytest.approx(0.1)


def test_states_and_feedback_come_at_their_rates(start: Callable[..., Any]) -> None:
    loop = start(state_publish_rate=25.0, action_monitor_rate=10.0)
    states: list[Any] = []
    feedback: list[Any] = []
    loop.controllers["arm"].on_state = states.append
    loop.controllers["arm"].on_feedback = lambda goal_handle, snapshot: feedback.append(snapshot)
    send(loop, (0.95, (0.3, 0.1, 0.0)))
    loop.run(1.0)
    assert len(states) == pytest.approx(25, abs=1)
    assert len(feedback) == pytest.approx(10, abs=1)
    assert states[5].error == pytest.approx(states[5].desired[:2] - states[5].actual)


def test_a_stopped_controller_ends_its_goals_and_takes_no_other(loop: Any) -> None:
    goal_handle = send(loop, (1.0, (1.0, 0.0, 0.0)))
    loop.run(0.1)
    assert loop.switch([], ["arm"]) is None
    assert goal_handle.status is GoalStatus.CANCELED
    with pytest.raises(GoalRejectedError, match="not running"):
        send(loop, (1.0, ZEROS))


def test_nothing_is_desired_before_the_first_start(make_loop: Callable[..., Any]) -> None:
    loop = make_loop(parameters())
    loop.manager.load_controller("arm")
    with pytest.raises(ControllerError, match="the controller is not running"):
        loop.controllers["arm"].desired_at(0.0)


def test_after_a_reset_of_time_the_arm_holds_and_its_goal_has_ended(loop: Any) -> None:
    goal_handle = send(loop, (1.0, (1.0, 0.0, 0.0)))
    loop.run(0.5)
    held = commands(loop)
    loop.time_s = 0.0
    loop.run(0.2)
    assert (goal_handle.status, goal_handle.text) == (
        GoalStatus.CANCELED,
        "time went back, or the robot was moved to a new pose",
    )
    assert commands(loop) == pytest.approx(held, abs=0.03)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"joints": []}, "/arm/joints"),
        ({"joints": ["a", "a"]}, "once"),
        ({"joints": ["a", "z"]}, "no joint 'z'"),
        ({"state_publish_rate": "fast"}, "/arm/state_publish_rate: got 'fast'"),
        ({"constraints": {"goal_time": -1.0}}, "/arm/constraints/goal_time"),
        ({"allow_partial_joints_goal": 1}, "expected true or false"),
    ],
)
def test_a_faulty_parameter_is_named(make_loop: Callable[..., Any], more: dict[str, Any], words: str) -> None:
    with pytest.raises(ControllerError) as caught:
        make_loop(parameters(**more)).manager.load_controller("arm")
    assert words in str(caught.value)


def test_a_goal_that_slips_in_while_the_controller_stops_is_not_followed_later(loop: Any) -> None:
    class Names(tuple[str, ...]):
        """Names of joints; while they are read for the first time the controller is stopped."""

        def __iter__(self) -> Iterator[str]:
            if loop.states()["arm"] == "running":
                assert loop.switch([], ["arm"]) is None
            return super().__iter__()

    goal_handle = send(loop, (1.0, (1.0, 0.0, 0.0)), names=Names(("a", "b", "c")))
    assert loop.states()["arm"] == "stopped"
    assert loop.switch(["arm"], []) is None
    loop.run(0.2)
    assert goal_handle.status is GoalStatus.REJECTED
    assert commands(loop) == pytest.approx(ZEROS)


def test_a_goal_that_ends_with_the_cycle_it_arrives_in_does_no_harm(loop: Any) -> None:
    for end_s in (0.0, 1e-12, 1e-7, 1e-5):
        send(loop, (0.5, ZEROS), (1.0 + end_s, ZEROS), stamp_s=loop.time_s - 1.0)
        loop.step(2)
        assert loop.states()["arm"] == "running"


def test_a_goal_that_comes_while_the_controller_is_stopped_is_rejected_and_not_lost(
    loop: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    validate_goal = joint_trajectory_controller.validate_goal

    def stop_meanwhile(*arguments: Any) -> Any:
        assert loop.switch([], ["arm"]) is None
        return validate_goal(*arguments)

    monkeypatch.setattr(joint_trajectory_controller, "validate_goal", stop_meanwhile)
    goal_handle = send(loop, (0.5, (0.3, 0.1, 0.1)))
    assert (goal_handle.status, goal_handle.text) == (GoalStatus.REJECTED, "the controller was stopped")
    assert loop.switch(["arm"], []) is None
    before = commands(loop)
    loop.run(0.2)
    assert commands(loop) == before


def test_a_goal_whose_taking_up_fails_is_rejected_with_those_behind_it(
    loop: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    active = send(loop, (0.5, (0.3, 0.1, 0.1)))
    loop.run(0.1)

    def splice(*_: Any, **__: Any) -> None:
        raise ArithmeticError("no such spline")

    monkeypatch.setattr(joint_trajectory_controller, "splice", splice)
    taken_up, behind = (send(loop, (0.5, (0.3, 0.1, 0.1))) for _ in range(2))
    loop.step()
    assert active.status is GoalStatus.ABORTED
    assert taken_up.status is behind.status is GoalStatus.REJECTED
    assert "no such spline" in taken_up.text and "no such spline" in behind.text
    assert [report.state for report in loop.manager.list_controllers()] == [ControllerState.STOPPED]


def test_a_goal_that_a_reset_ends_says_what_was_reset(loop: Any) -> None:
    goal_handle = send(loop, (1.0, (1.0, 0.0, 0.0)))
    loop.run(0.5)
    loop.manager.update(loop.time_s, 0.01, True, "the world was reset")
    assert (goal_handle.status, goal_handle.text) == (GoalStatus.CANCELED, "the world was reset")
