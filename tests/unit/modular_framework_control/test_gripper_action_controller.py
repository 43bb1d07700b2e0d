# SPDX-License-Identifier: BSD-3-Clause
"""The gripper controller: reached, stalled, canceled, replaced, refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from modular_framework_control.controllers.gripper_action_controller import GripperGoalError, GripperGoalHandle
from modular_framework_control.hardware_interface.interfaces import PositionJointInterface
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.realtime.goal_handle import GoalStatus

URDF = """<robot name="r"><joint name="finger" type="revolute">
<limit lower="0" upper="1" velocity="1.0" effort="1"/></joint></robot>"""
OBJECT = 0.5
"""Where the finger meets an object [rad]."""


class FingerAtAnObject(MockRobotHW):
    """A finger that an object stops."""

    def read(self, time_s: float, period_s: float) -> None:
        super().read(time_s, period_s)
        for joint in self._handles:
            joint.state.position = min(joint.position, OBJECT)


def parameters(**more: Any) -> dict[str, Any]:
    return {
        "robot_description": URDF,
        "hw": {"joints": ["finger"]},
        "gripper": {
            "type": "position_controllers/GripperActionController",
            "joint": "finger",
            "stall_timeout": 0.3,
            "max_effort": 2.0,
            **more,
        },
    }


@pytest.fixture
def loop(make_loop: Callable[..., Any]) -> Any:
    made = make_loop(parameters(), FingerAtAnObject())
    made.spawn("gripper")
    return made


def send(loop: Any, position: float, max_effort: float = 0.0) -> GripperGoalHandle:
    goal_handle = GripperGoalHandle()
    loop.controllers["gripper"].submit(position, max_effort, goal_handle)
    return goal_handle


def handle(loop: Any) -> Any:
    robot_hw: RobotHW = loop.robot_hw
    return robot_hw.get(PositionJointInterface).get_handle("finger")


def test_a_free_gripper_reaches_its_goal(loop: Any) -> None:
    goal_handle = send(loop, 0.4)
    loop.run(0.3)
    assert goal_handle.status is GoalStatus.ACTIVE
    loop.run(0.2)
    assert goal_handle.status is GoalStatus.SUCCEEDED
    assert goal_handle.result is not None and goal_handle.result.reached_goal and not goal_handle.result.stalled


def test_its_state_says_what_is_commanded_at_a_fixed_rate(loop: Any) -> None:
    states: list[Any] = []
    loop.controllers["gripper"].on_state = states.append
    loop.run(0.1)
    send(loop, 0.8)
    loop.run(1.0)
    times_s = [state.time_s for state in states[1:]]
    assert [after - before for before, after in zip(times_s, times_s[1:], strict=False)] == pytest.approx(
        [0.02] * (len(times_s) - 1), abs=1e-3
    )
    assert {state.set_point for state in states} == {0.0, 0.8}
    last = states[-1]
    assert (last.process_value, last.error) == (pytest.approx(OBJECT), pytest.approx(0.8 - OBJECT))


def test_a_blocked_gripper_stalls_after_the_timeout_and_goes_on_squeezing(loop: Any) -> None:
    goal_handle = send(loop, 0.8)
    loop.run(0.5 + 0.25)
    assert goal_handle.status is GoalStatus.ACTIVE
    loop.run(0.2)
    assert goal_handle.status is GoalStatus.ABORTED
    assert goal_handle.result is not None and goal_handle.result.stalled and not goal_handle.result.reached_goal
    assert "joint 'finger' is at rest at 0.5" in goal_handle.text
    loop.manager.update(loop.time_s, 0.01)
    assert handle(loop).command == 0.8


@pytest.mark.parametrize(("value", "status"), [(True, GoalStatus.SUCCEEDED), (False, GoalStatus.ABORTED)])
def test_a_stalled_goal_succeeds_where_stalling_is_allowed(
    make_loop: Callable[..., Any], value: bool, status: GoalStatus
) -> None:
    loop = make_loop(parameters(allow_stalling=value, goal_tolerance=0.02), FingerAtAnObject())
    loop.spawn("gripper")
    goal_handle = send(loop, 0.8)
    loop.run(1.0)
    assert goal_handle.status is status
    assert goal_handle.result is not None and goal_handle.result.stalled and not goal_handle.result.reached_goal
    loop.manager.update(loop.time_s, 0.01)
    assert handle(loop).command == 0.8  # the fingers keep their grip


def test_a_gripper_leaves_an_object_at_once_however_far_beyond_the_object_its_command_was(loop: Any) -> None:
    send(loop, 0.95)
    loop.run(2.0)
    goal_handle = send(loop, 0.4)
    loop.run(0.15)  # 0.1 rad at 1 rad/s; the way back from 0.95 to the object takes longer than the stall timeout
    assert goal_handle.status is GoalStatus.SUCCEEDED, goal_handle.text


def test_a_stall_is_not_seen_before_the_timeout_has_passed_since_the_goal(loop: Any) -> None:
    send(loop, 0.8)
    loop.run(2.0)
    again = send(loop, 0.9)
    loop.run(0.25)
    assert again.status is GoalStatus.ACTIVE
    loop.run(0.1)
    assert again.status is GoalStatus.ABORTED


def test_trembling_in_place_is_a_stall(loop: Any) -> None:
    goal_handle = send(loop, 0.8)
    loop.run(0.6)
    for cycle in range(40):
        loop.robot_hw.read(loop.time_s, 0.01)
        handle(loop).state.velocity = 0.05 * (-1) ** cycle
        loop.manager.update(loop.time_s, 0.01)
        loop.time_s += 0.01
    assert goal_handle.status is GoalStatus.ABORTED


def test_the_effort_of_the_goal_is_passed_on_and_none_means_the_default(loop: Any) -> None:
    send(loop, 0.1, 5.0)
    loop.step()
    assert handle(loop).max_effort == 5.0
    send(loop, 0.2)
    loop.step()
    assert handle(loop).max_effort == 2.0
    send(loop, 0.1, -3.0)  # as the PR2's clients do
    loop.step()
    assert handle(loop).max_effort == 3.0


def test_what_holds_something_does_not_press_harder_when_it_is_canceled(loop: Any) -> None:
    goal_handle = send(loop, 0.8, 0.5)
    loop.run(0.6)
    loop.controllers["gripper"].cancel(goal_handle)
    loop.step(2)
    assert goal_handle.status is GoalStatus.CANCELED and handle(loop).max_effort == 0.5
    assert loop.switch([], ["gripper"]) is None and loop.switch(["gripper"], []) is None
    loop.step()
    assert handle(loop).max_effort == 2.0


def test_a_new_goal_replaces_the_one_before(loop: Any) -> None:
    first = send(loop, 0.4)
    loop.run(0.1)
    second = send(loop, 0.0)
    loop.run(0.3)
    assert first.status is GoalStatus.CANCELED and "preempted" in first.text
    assert second.status is GoalStatus.SUCCEEDED


def test_cancel_stops_where_the_joint_is(loop: Any) -> None:
    goal_handle = send(loop, 0.4)
    loop.run(0.2)
    loop.controllers["gripper"].cancel(goal_handle)
    loop.step(2)
    assert goal_handle.status is GoalStatus.CANCELED
    here = handle(loop).position
    loop.run(0.3)
    assert handle(loop).position == pytest.approx(here, abs=0.011)


def test_a_finger_that_is_measured_at_no_position_stays_where_it_was_and_nothing_starts(loop: Any) -> None:
    goal_handle = send(loop, 0.4)
    loop.run(0.2)
    finger = handle(loop)
    there, finger.state.position = finger.position, math.nan
    loop.manager.update(loop.time_s, 0.01)
    assert goal_handle.status is GoalStatus.ABORTED
    assert "joint 'finger' is measured at nan; expected a position" in goal_handle.text
    assert finger.command == pytest.approx(there) and 0.1 < there < 0.3
    again = send(loop, 0.4)
    loop.manager.update(loop.time_s, 0.01)
    assert again.status is GoalStatus.ABORTED and finger.command == pytest.approx(there)
    loop.step()
    goal_handle = send(loop, 0.4)
    loop.run(0.5)
    assert goal_handle.status is GoalStatus.SUCCEEDED


def test_a_gripper_does_not_start_on_a_finger_that_is_measured_at_no_position(
    loop: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert loop.switch([], ["gripper"]) is None
    state = handle(loop).state
    with monkeypatch.context() as patched:
        patched.setattr(loop.robot_hw, "read", lambda time_s, period_s: setattr(state, "position", math.nan))
        assert "joint 'finger' is measured at nan" in str(loop.switch(["gripper"], []))
    assert math.isfinite(handle(loop).command)


@pytest.mark.parametrize(("position", "effort"), [(math.nan, 0.0), (math.inf, 0.0), (0.1, math.nan)])
def test_a_goal_that_makes_no_sense_is_refused(loop: Any, position: float, effort: float) -> None:
    with pytest.raises(GripperGoalError, match="expected finite numbers"):
        loop.controllers["gripper"].submit(position, effort, GripperGoalHandle())


@pytest.mark.parametrize("position", [5.0, -1.0, 1e300, -1e300, 1.002])
def test_a_goal_beyond_the_limits_is_refused_and_moves_nothing(loop: Any, position: float) -> None:
    loop.step()
    with pytest.raises(GripperGoalError, match=r"position of joint 'finger' is .*; its limits are 0 to 1; give a"):
        send(loop, position)
    loop.run(0.1)
    assert handle(loop).command == handle(loop).position == 0.0


def test_without_limits_a_goal_beyond_reason_is_refused(make_loop: Callable[..., Any]) -> None:
    without = {name: value for name, value in parameters().items() if name != "robot_description"}
    loop = make_loop(without)
    loop.spawn("gripper")
    send(loop, 5.0)
    with pytest.raises(GripperGoalError, match=r"is 1e\+300"):
        send(loop, 1e300)


def test_a_finger_outside_its_range_is_brought_back_by_a_goal(make_loop: Callable[..., Any]) -> None:
    hardware = {"joints": ["finger"], "initial_positions": {"finger": 1.4}}
    loop = make_loop({**parameters(), "hw": hardware})
    loop.spawn("gripper")
    loop.run(0.5)
    assert handle(loop).position == 1.4
    goal_handle = send(loop, 1.2)
    loop.run(0.5)
    assert goal_handle.status is GoalStatus.SUCCEEDED
    with pytest.raises(GripperGoalError, match="its limits are 0 to 1"):
        send(loop, 1.4)


def test_a_stopped_controller_ends_its_goal_and_takes_no_other(loop: Any) -> None:
    goal_handle = send(loop, 0.4)
    loop.step()
    assert loop.switch([], ["gripper"]) is None
    assert goal_handle.status is GoalStatus.CANCELED
    with pytest.raises(GripperGoalError, match="not running"):
        send(loop, 0.1)


def test_two_joints_are_refused(make_loop: Callable[..., Any]) -> None:
    loop = make_loop(parameters(joint=["finger", "thumb"]))
    with pytest.raises(Exception, match="expected the name of one joint"):
        loop.manager.load_controller("gripper")


def test_feedback_comes_at_its_rate(make_loop: Callable[..., Any]) -> None:
    loop = make_loop(parameters(action_monitor_rate=20.0))
    loop.spawn("gripper")
    seen: list[float] = []
    loop.controllers["gripper"].on_feedback = lambda goal_handle, state: seen.append(state.position)
    send(loop, 0.45)
    loop.run(0.4)
    assert len(seen) == pytest.approx(8, abs=1)
    assert seen == sorted(seen)


def test_a_goal_that_comes_while_the_controller_is_stopped_is_rejected_and_not_lost(loop: Any) -> None:
    class Effort(float):
        """The controller is stopped while this is looked at."""

        def __abs__(self) -> float:
            assert loop.switch([], ["gripper"]) is None
            return float(self)

    goal_handle = send(loop, 0.4, Effort(1.0))
    assert (goal_handle.status, goal_handle.text) == (GoalStatus.REJECTED, "the controller was stopped")
    assert loop.switch(["gripper"], []) is None
    before = handle(loop).command
    loop.run(0.1)
    assert handle(loop).command == before


def test_a_goal_whose_taking_up_fails_is_rejected_with_those_behind_it(loop: Any) -> None:
    def fail(goal_handle: GripperGoalHandle) -> None:
        if goal_handle.status is GoalStatus.CANCELED:
            raise ArithmeticError("nobody listens")

    active = GripperGoalHandle(fail)
    loop.controllers["gripper"].submit(0.4, 0.0, active)
    loop.run(0.1)
    taken_up, behind = send(loop, 0.1), send(loop, 0.2)
    loop.step()
    assert active.status is GoalStatus.CANCELED
    assert taken_up.status is behind.status is GoalStatus.REJECTED
    assert "nobody listens" in taken_up.text and "nobody listens" in behind.text


def test_a_gripper_on_its_way_stops_with_its_controller_and_one_that_holds_something_goes_on_squeezing(
    loop: Any,
) -> None:
    moving = send(loop, 0.4)
    loop.run(0.2)
    assert loop.switch([], ["gripper"]) is None
    assert moving.status is GoalStatus.CANCELED
    stopped = handle(loop).position
    loop.run(0.5)
    assert handle(loop).position == pytest.approx(stopped, abs=0.02)
    assert loop.switch(["gripper"], []) is None
    squeezing = send(loop, 0.8)
    loop.run(1.5)
    assert squeezing.status is GoalStatus.ABORTED and handle(loop).position == 0.5
    assert loop.switch([], ["gripper"]) is None
    loop.manager.update(loop.time_s, 0.01)
    assert handle(loop).command == 0.8


def test_a_canceled_gripper_does_not_push_on_against_what_holds_it_up(loop: Any) -> None:
    goal_handle = send(loop, 0.4)
    for _ in range(30):
        loop.step()
        handle(loop).state.position = 0.1
    loop.controllers["gripper"].cancel(goal_handle)
    loop.robot_hw.read(loop.time_s, 0.01)
    handle(loop).state.position = 0.1
    loop.manager.update(loop.time_s, 0.01)
    loop.robot_hw.write(loop.time_s, 0.01)
    assert handle(loop).command == 0.1
