# SPDX-License-Identifier: BSD-3-Clause
"""When the fingers count as arrived or held up, without a motor: positions go in, commands to the motor come out."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_drivers.ezgripper.grip import Drive, Goal, Grip, GripRules, Motion, StandstillDetector
from modular_framework_drivers.ezgripper.gripper_servos import joint_from_ticks, ticks_from_joint
from modular_framework_drivers.ezgripper.gripper_settings import read_gripper_settings
from modular_framework_ros.node_handle import MappingNodeHandle, ParameterError

PERIOD_S = 0.02


class Fingers:
    """Fingers that follow their commands at 1 rad/s, unless an object blocks them."""

    def __init__(self, position: float, goal: float, torque: int = 300) -> None:
        self.position, self.time_s = position, 0.0
        self.low, self.high = -9.0, 9.0
        self.grip = Grip(GripRules(), Goal(1, goal, torque))
        self.drive = self.grip.update(position, 0.0)

    def run(self, duration_s: float) -> Motion:
        for _ in range(round(duration_s / PERIOD_S)):
            self.time_s += PERIOD_S
            towards = self.drive.position if self.drive.position is not None else 9.0 * self.drive.direction
            step = max(-PERIOD_S, min(PERIOD_S, towards - self.position))
            self.position = max(self.low, min(self.high, self.position + step))
            self.drive = self.grip.update(self.position, self.time_s)
        return self.grip.motion

    def go(self, goal: float, torque: int = 300) -> None:
        self.grip.retarget(Goal(self.grip.goal.number + 1, goal, torque), self.position, self.time_s)


def test_free_fingers_arrive_and_then_use_no_more_torque_than_they_may_for_long() -> None:
    fingers = Fingers(0.0, 0.5, 700)
    assert fingers.run(0.3) is Motion.MOVING
    assert fingers.drive == Drive(0.5, 700)
    assert fingers.run(0.4) is Motion.REACHED
    assert fingers.drive == Drive(0.5, 400)


@pytest.mark.parametrize(("start", "goal", "direction"), [(0.2, 1.5, 1), (1.5, 0.2, -1)])
def test_fingers_held_up_squeeze_towards_their_goal(start: float, goal: float, direction: int) -> None:
    fingers = Fingers(start, goal, 700)
    fingers.low, fingers.high = 0.7, 1.0
    assert fingers.run(2.0) is Motion.HOLDING
    assert fingers.drive == Drive(None, 400, direction)


def test_fingers_that_cannot_move_from_the_beginning_are_held_up() -> None:
    fingers = Fingers(0.5, 1.5)
    fingers.high = 0.5
    assert fingers.run(0.2) is Motion.MOVING
    assert fingers.run(0.2) is Motion.HOLDING


def test_a_new_goal_after_a_rest_is_not_held_up_at_once() -> None:
    fingers = Fingers(0.0, 0.5)
    fingers.run(3.0)
    fingers.go(1.0)
    assert fingers.grip.update(fingers.position, fingers.time_s).position == 1.0
    assert fingers.grip.motion is Motion.MOVING
    assert fingers.run(1.0) is Motion.REACHED


def test_goals_that_creep_do_not_hide_that_the_fingers_are_held_up() -> None:
    fingers = Fingers(0.0, 0.0)
    fingers.high = 0.5
    for step in range(100):
        fingers.go(0.01 * step)
        fingers.run(PERIOD_S)
    assert fingers.grip.motion is Motion.HOLDING
    assert fingers.drive == Drive(None, 300, 1)


def test_held_is_held_until_the_goal_is_to_let_go() -> None:
    fingers = Fingers(0.2, 1.5)
    fingers.high = 0.9
    fingers.run(2.0)
    fingers.go(1.9, 200)
    assert fingers.run(0.5) is Motion.HOLDING
    assert fingers.drive == Drive(None, 200, 1)
    fingers.go(fingers.position, 200)  # as a controller does that holds where it measured
    assert fingers.run(0.5) is Motion.HOLDING
    fingers.go(0.4)
    assert fingers.run(1.0) is Motion.REACHED
    assert fingers.position == pytest.approx(0.4, abs=0.03)


def test_what_gives_way_is_followed_and_lost_at_the_goal() -> None:
    fingers = Fingers(0.2, 1.5)
    fingers.high = 0.9
    fingers.run(2.0)
    fingers.high = 1.1
    assert fingers.run(1.0) is Motion.HOLDING
    assert fingers.position == pytest.approx(1.1)
    fingers.high = 9.0
    assert fingers.run(1.0) is Motion.REACHED
    assert fingers.position == pytest.approx(1.5, abs=0.03)


def test_fingers_commanded_to_hold_do_not_go_far_when_what_they_hold_is_taken() -> None:
    fingers = Fingers(0.2, 1.5)
    fingers.high = 0.9
    fingers.run(2.0)
    fingers.go(fingers.position)
    fingers.run(0.5)
    fingers.high = 9.0
    assert fingers.run(1.0) is Motion.REACHED
    assert fingers.position == pytest.approx(0.9, abs=0.06)


def test_fingers_pushed_away_come_back() -> None:
    fingers = Fingers(0.0, 0.5)
    fingers.run(1.0)
    fingers.position = 0.8
    assert fingers.run(PERIOD_S) is Motion.MOVING
    assert fingers.run(1.0) is Motion.REACHED


@given(
    st.lists(st.tuples(st.floats(0.0, 1.94), st.integers(0, 1023), st.floats(0.0, 1.0)), min_size=1, max_size=8),
    st.floats(0.0, 1.94),
)
def test_the_torque_asked_for_is_never_exceeded_and_held_goals_are_short_of_the_goal(
    goals: list[tuple[float, int, float]], obstacle: float
) -> None:
    fingers = Fingers(0.0, 0.0)
    fingers.high = obstacle
    for goal, torque, duration_s in goals:
        fingers.go(goal, torque)
        motion = fingers.run(duration_s)
        assert fingers.drive.torque <= max(torque, 0) or duration_s < PERIOD_S
        if motion is Motion.REACHED:
            assert abs(fingers.position - goal) <= 0.03


@given(st.floats(-0.3, 2.3))
def test_ticks_and_joint_positions_belong_together(position: float) -> None:
    assert joint_from_ticks(ticks_from_joint(position)) == pytest.approx(position, abs=1.94 / 2500)


def standstill_times(velocities: list[float]) -> list[float]:
    """When fingers with these velocities, measured every PERIOD_S, are said to stand [s]."""
    standstill = StandstillDetector(0.05, 0.1)
    return [round(i * PERIOD_S, 6) for i, v in enumerate(velocities) if standstill.update(v, i * PERIOD_S)]


def test_fingers_stand_when_they_have_been_slow_for_a_while() -> None:
    assert standstill_times([1.0, 0.5, *[0.01] * 8]) == [0.14, 0.16, 0.18]


@pytest.mark.parametrize("frequency", [0.7, 1.0, 3.0, 12.0])
def test_fingers_that_swing_do_not_stand_where_they_turn_round(frequency: float) -> None:
    assert not standstill_times([math.cos(2.0 * math.pi * frequency * i * PERIOD_S) for i in range(500)])


def test_open_is_0_and_closed_1_94() -> None:
    assert (ticks_from_joint(0.0), ticks_from_joint(1.94)) == (2500, 0)
    assert (joint_from_ticks(2500), joint_from_ticks(0)) == (0.0, 1.94)


def test_the_parameters_of_the_guide_are_read() -> None:
    settings = read_gripper_settings(
        MappingNodeHandle({"poll_rate": 100, "hold_torque": 200, "start_position": 1.0}, "/hw"),
        MappingNodeHandle(
            {"port_name": "/dev/ttyUSB0", "baudrate": 57600, "servo_ids": [1, 2], "manipulator_name": "EzGripper"}
        ),
    )
    assert (settings.port_name, settings.baudrate, settings.servo_ids) == ("/dev/ttyUSB0", 57600, (1, 2))
    assert (settings.name, settings.poll_period_s, settings.rules.hold_torque) == ("EzGripper", 0.01, 200)


def test_a_gripper_with_a_port_of_its_own_has_the_rest_of_its_connection_beside_it() -> None:
    own = MappingNodeHandle({"port_name": "/dev/ttyUSB1", "servo_ids": [3]}, "/hw")
    settings = read_gripper_settings(own, MappingNodeHandle({"port_name": "/dev/ttyUSB0", "baudrate": 9600}))
    assert (settings.port_name, settings.baudrate, settings.servo_ids) == ("/dev/ttyUSB1", 57600, (3,))


def test_all_faults_of_the_parameters_are_reported_at_once() -> None:
    with pytest.raises(ParameterError) as error:
        read_gripper_settings(
            MappingNodeHandle({"start_position": 3.0, "poll_rate": "fast"}, "/hw"),
            MappingNodeHandle({"baudrate": 12345, "servo_ids": [1, 1]}),
        )
    for part in (
        "parameter '/port_name' is not set; allowed: a text that is not empty (Path of the serial port",
        "parameter '/baudrate' is 12345; allowed: 9600, ",
        "parameter '/servo_ids' is [1, 1]; allowed: a list that is not empty, each a whole number and listed once, at",
        "parameter '/hw/start_position' is 3.0; allowed: a number, at least 0 and at most 1.94",
        "parameter '/hw/poll_rate' is 'fast'",
    ):
        assert part in str(error.value)


@pytest.mark.parametrize("servo_ids", [[], [True], [253], [-1], ["1"], 1, [1, 1]])
def test_servo_ids_are_different_numbers(servo_ids: object) -> None:
    with pytest.raises(ParameterError, match="servo_ids"):
        read_gripper_settings(MappingNodeHandle({}), MappingNodeHandle({"port_name": "p", "servo_ids": servo_ids}))
