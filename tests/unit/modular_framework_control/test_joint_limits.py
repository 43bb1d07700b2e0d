# SPDX-License-Identifier: BSD-3-Clause
"""Whatever a controller commands, the hardware gets what the limits allow: hard and soft, by parameter and by URDF."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_control.hardware_interface.handles import JointHandle, JointStateHandle, PosVelAccJointHandle
from modular_framework_control.hardware_interface.interfaces import (
    PositionJointInterface,
    PosVelAccJointInterface,
    VelocityJointInterface,
)
from modular_framework_control.hardware_interface.joint_limits import (
    EffortJointSaturation,
    JointLimitGuard,
    JointLimits,
    PositionJointSaturation,
    SoftJointLimits,
    VelocityJointSaturation,
    limit_handle,
    limits_with_parameters,
    outside_limits,
    soft_limits_from_urdf,
    soft_limits_with_parameters,
)
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_ros.node_handle import MappingNodeHandle, ParameterError

LIMITS = JointLimits(-1.0, 1.0, 2.0, 5.0)
SOFT = SoftJointLimits(-0.8, 0.8, 10.0, 4.0)
URDF = """<robot name="r">
<joint name="j" type="revolute"><limit lower="-1" upper="1" velocity="2" effort="5"/>
  <safety_controller soft_lower_limit="-0.8" soft_upper_limit="0.8" k_position="10" k_velocity="4"/></joint>
<joint name="wheel" type="continuous"><limit velocity="2" effort="5"/>
  <safety_controller k_velocity="4"/></joint></robot>"""


def handle(position: float = 0.0, velocity: float = 0.0, command: float = 0.0) -> JointHandle:
    return JointHandle(JointStateHandle("j", position, velocity), command)


@given(st.lists(st.floats(), min_size=1, max_size=40), st.floats(-0.8, 0.8))
def test_positions_near_a_soft_end_slow_down_and_never_pass_it(wanted: list[float], start: float) -> None:
    joint = handle(start)
    limiter = PositionJointSaturation(joint, LIMITS, SOFT)
    last = start
    for joint.command in wanted:
        limiter.enforce_limits(0.01)
        way = joint.command - last
        left = SOFT.max_position - last if way > 0.0 else last - SOFT.min_position
        assert abs(way) <= min(LIMITS.max_velocity, SOFT.k_position * left) * 0.01 + 1e-12
        last = joint.command


@pytest.mark.parametrize(("limiter_class", "allowed"), [(VelocityJointSaturation, 0.0), (EffortJointSaturation, -2.0)])
@pytest.mark.parametrize("wanted", [9.0, 0.0, -9.0])
def test_a_joint_whose_position_is_not_a_number_is_braked_within_soft_limits(
    limiter_class: type[Any], allowed: float, wanted: float
) -> None:
    joint = handle(math.nan, 0.5, wanted)
    limiter_class(joint, LIMITS, SOFT).enforce_limits(0.01)
    assert joint.command == pytest.approx(allowed)


@pytest.mark.parametrize("soft", [None, SOFT])
def test_holding_a_position_that_is_not_a_number_keeps_the_last_command(soft: SoftJointLimits | None) -> None:
    joint = handle(0.3, command=0.3)
    limiter = PositionJointSaturation(joint, LIMITS, soft)
    limiter.enforce_limits(0.01)
    joint.state.position = math.nan
    joint.hold(math.nan)
    limiter.enforce_limits(0.01)
    assert joint.command == pytest.approx(0.3)
    joint.command, joint.held = math.nan, True
    limiter.enforce_limits(0.01)
    assert joint.command == pytest.approx(0.3)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("soft", [None, SOFT])
def test_a_joint_outside_its_range_stays_until_a_goal_brings_it_back_no_faster_than_its_velocity_limit(
    side: float, soft: SoftJointLimits | None
) -> None:
    joint = handle(side * 1.5, command=math.nan)
    limiter, seen = PositionJointSaturation(joint, LIMITS, soft), [side * 1.5]
    for joint.command in [math.nan, side * 1.5, side * 9.0] * 10:
        limiter.enforce_limits(0.01)
        assert joint.command == side * 1.5
    for joint.command in [side * 0.5] * 60:
        limiter.enforce_limits(0.01)
        seen.append(joint.command)
    assert max(abs(after - before) for before, after in pairwise(seen)) <= LIMITS.max_velocity * 0.01 + 1e-12
    assert seen[-1] == pytest.approx(side * 0.5)
    for joint.command in [side * 1.5] * 60:
        limiter.enforce_limits(0.01)
    assert side * joint.command <= 1.0, "once inside it does not leave its range again"


def test_a_joint_whose_position_is_held_outside_its_range_stays_there() -> None:
    joint = handle(0.9, command=0.9)
    limiter = PositionJointSaturation(joint, LIMITS)
    limiter.enforce_limits(0.01)
    joint.state.position = 1.3  # moved by hand
    joint.hold(1.3)
    for _ in range(10):
        limiter.enforce_limits(0.01)
        assert joint.command == 1.3


@pytest.mark.parametrize(
    ("interface", "controller"),
    [
        ("PositionJointInterface", "position_controllers/JointTrajectoryController"),
        ("PositionJointInterface", "position_controllers/JointGroupPositionController"),
        ("PosVelJointInterface", "pos_vel_controllers/JointTrajectoryController"),
        ("VelocityJointInterface", "velocity_controllers/JointTrajectoryController"),
        ("EffortJointInterface", "effort_controllers/JointTrajectoryController"),
    ],
)
def test_a_joint_outside_its_range_stays_without_a_controller_and_when_one_starts(
    make_loop: Callable[..., Any], interface: str, controller: str
) -> None:
    loop = make_loop(
        {
            "robot_description": URDF,
            "hw": {"joints": ["j"], "initial_positions": {"j": 2.5}, "command_interface": interface},
            "c": {"type": controller, "joints": ["j"], "gains": {"j": {"p": 10.0, "d": 1.0}}},
        }
    )
    loop.run(1.0)
    joint = loop.robot_hw.interfaces[1].handles[0]
    assert joint.position == 2.5
    loop.spawn("c")
    loop.run(1.0)
    assert joint.position == 2.5
    (text,) = outside_limits(loop.robot_hw).values()
    assert text == "joint 'j' is held at 2.5, outside its range -1 to 1, until a goal brings it back"


@pytest.mark.parametrize(("upper", "within", "beyond"), [(1.94, 1.949, 1.951), (0.04, 0.0403, 0.0405)])
def test_a_measured_position_counts_as_outside_from_the_accuracy_of_hardware_on(
    upper: float, within: float, beyond: float
) -> None:
    limits = JointLimits(0.0, upper)
    assert not limits.is_beyond(within) and not limits.is_beyond(upper - within)
    assert limits.is_beyond(beyond) and limits.is_beyond(upper - beyond)


def test_joints_without_limits_are_named_when_the_controllers_get_their_hardware(
    make_loop: Callable[..., Any], caplog: pytest.LogCaptureFixture
) -> None:
    make_loop({"robot_description": URDF, "hw": {"joints": ["j", "other"]}})
    assert "velocity and position of joint 'other' (hardware_interface/PositionJointInterface)" in caplog.text
    assert "'j'" not in caplog.text
    caplog.clear()
    make_loop({"robot_description": URDF, "hw": {"joints": ["j"], "command_interface": "EffortJointInterface"}})
    assert not caplog.records
    make_loop({"hw": {"joints": ["j"], "command_interface": "EffortJointInterface"}})
    assert "effort of joint 'j' (hardware_interface/EffortJointInterface)" in caplog.text


@pytest.mark.parametrize(
    ("position", "velocity", "command", "expected"),
    [
        (0.0, 0.0, 9.0, 2.0),
        (0.0, 0.0, -9.0, -2.0),
        (0.75, 0.0, 9.0, 0.5),
        (0.85, 0.0, 9.0, 0.0),
        (0.85, 0.0, -9.0, -2.0),
        (-0.75, 0.0, -9.0, -0.5),
        (0.0, 0.0, math.nan, 0.0),
    ],
)
def test_velocities_near_a_soft_end_shrink(position: float, velocity: float, command: float, expected: float) -> None:
    joint = handle(position, velocity, command)
    VelocityJointSaturation(joint, LIMITS, SOFT).enforce_limits(0.01)
    assert joint.command == pytest.approx(expected)


@pytest.mark.parametrize(
    ("position", "velocity", "command", "expected"),
    [
        (0.0, 0.0, 9.0, 0.1),
        (0.0, 0.5, 9.0, 0.6),
        (0.0, 0.5, -9.0, 0.4),
        (0.0, 1.95, 9.0, 2.0),
        (1.0, 0.0, 9.0, 0.0),
        (-1.1, 0.0, -9.0, 0.0),
        (1.0, 0.0, -9.0, -0.1),
    ],
)
def test_velocities_change_no_faster_than_the_acceleration_allows_and_stop_at_the_ends(
    position: float, velocity: float, command: float, expected: float
) -> None:
    joint = handle(position, velocity, command)
    VelocityJointSaturation(joint, JointLimits(-1.0, 1.0, 2.0, max_acceleration=10.0)).enforce_limits(0.01)
    assert joint.command == pytest.approx(expected)


def test_velocities_grow_from_command_to_command_whatever_is_measured() -> None:
    joint = handle()
    limiter = VelocityJointSaturation(joint, JointLimits(max_velocity=2.0, max_acceleration=2.0))
    for cycle in range(1, 101):  # a drive that sticks at small commands, or does not tell its velocity
        joint.command = 1.0
        limiter.enforce_limits(0.01)
        assert joint.command == pytest.approx(min(1.0, 0.02 * cycle))
    joint.state.velocity = 0.5
    limiter.reset()
    joint.command = 1.0
    limiter.enforce_limits(0.01)
    assert joint.command == pytest.approx(0.52), "after a reset from the measured one"


def test_a_velocity_ends_at_the_end_of_the_range_whatever_change_that_takes() -> None:
    joint = handle(command=1.0)
    limiter = VelocityJointSaturation(joint, JointLimits(-1.0, 1.0, 2.0, max_acceleration=100.0))
    limiter.enforce_limits(0.01)
    joint.state.position = 1.0
    limiter.enforce_limits(0.001)
    assert joint.command == 0.0


@pytest.mark.parametrize("limiter_class", [VelocityJointSaturation, EffortJointSaturation])
def test_a_limited_command_is_not_taken_for_a_command_of_a_controller(limiter_class: Any) -> None:
    joint = handle(1.1, 0.5, command=9.0)
    limiter = limiter_class(joint, LIMITS, SOFT)
    limiter.enforce_limits(0.01)
    assert joint.command <= 0.0, "it goes no farther"
    joint.state.position = joint.state.velocity = 0.0
    limiter.enforce_limits(0.01)
    assert joint.command > 0.0, "what the controller commanded is still in force"
    limiter.reset()
    assert joint.command == 9.0
    joint.command = 0.1
    joint.state.position = 0.0
    limiter.enforce_limits(0.01)
    limiter.enforce_limits(0.01)
    assert joint.command == 0.1


def test_a_position_that_is_given_in_place_of_a_command_is_where_the_joint_stays() -> None:
    joint = handle(command=0.5)
    limiter = PositionJointSaturation(joint, LIMITS)
    for _ in range(5):
        limiter.enforce_limits(0.01)
        assert joint.command == 0.02, "whoever commanded 0.5 has stopped and left it alone"


@pytest.mark.parametrize(
    ("interface", "controller", "wanted"),
    [
        ("VelocityJointInterface", "velocity_controllers/JointVelocityController", 1.0),
        ("EffortJointInterface", "effort_controllers/JointEffortController", 5.0),
    ],
)
def test_a_joint_comes_to_rest_after_its_controller_stopped(
    make_loop: Callable[..., Any], interface: str, controller: str, wanted: float
) -> None:
    values = {
        "has_acceleration_limits": True,
        "max_acceleration": 2.0,
        "has_velocity_limits": True,
        "max_velocity": 1.0,
        "has_effort_limits": True,
        "max_effort": 5.0,
    }
    soft = {
        "has_soft_limits": True,
        "soft_lower_limit": -9.0,
        "soft_upper_limit": 9.0,
        "k_position": 10.0,
        "k_velocity": 10.0,
    }
    loop = make_loop(
        {
            "joint_limits": {"j": {**values, **(soft if "Effort" in interface else {})}},
            "hw": {"joints": ["j"], "command_interface": interface},
            "c": {"type": controller, "joint": "j"},
        }
    )
    loop.spawn("c")
    loop.controllers["c"].submit([wanted])
    loop.run(2.0)
    joint = loop.robot_hw.interfaces[1].handles[0]
    assert joint.velocity == pytest.approx(1.0, abs=0.01)
    assert loop.switch([], ["c"]) is None
    loop.run(1.0)
    assert joint.command == 0.0
    if "Velocity" in interface:  # a body without friction goes on
        assert joint.velocity == 0.0


@pytest.mark.parametrize(
    ("position", "velocity", "command", "soft", "expected"),
    [
        (0.0, 0.0, 9.0, None, 5.0),
        (1.01, 0.0, 9.0, None, 0.0),
        (1.01, 0.0, -9.0, None, -5.0),
        (-1.01, 0.0, -9.0, None, 0.0),
        (0.0, 2.1, 9.0, None, 0.0),
        (0.0, -2.1, -9.0, None, 0.0),
        (0.0, 2.1, -9.0, None, -5.0),
        (0.0, 0.0, math.nan, None, 0.0),
        (0.0, 0.0, 9.0, SOFT, 5.0),
        (0.0, 1.5, 9.0, SOFT, 2.0),
        (0.75, 0.0, 9.0, SOFT, 2.0),
        (0.8, 0.5, 9.0, SOFT, -2.0),
    ],
)
def test_efforts_drive_no_joint_out_of_its_range_or_speed(
    position: float, velocity: float, command: float, soft: SoftJointLimits | None, expected: float
) -> None:
    joint = handle(position, velocity, command)
    EffortJointSaturation(joint, LIMITS, soft).enforce_limits(0.01)
    assert joint.command == pytest.approx(expected)


def test_velocity_and_acceleration_beside_a_position_are_bounded_too() -> None:
    joint = PosVelAccJointHandle(JointStateHandle("j", 0.0), 9.0)
    joint.command_velocity, joint.command_acceleration = -9.0, math.nan
    limiter = limit_handle(PosVelAccJointInterface, joint, JointLimits(-1.0, 1.0, 2.0, max_acceleration=3.0))
    limiter.enforce_limits(0.1)
    assert (joint.command, joint.command_velocity, joint.command_acceleration) == (0.2, -2.0, 0.0)


def test_soft_limits_are_read_from_the_description_and_all_replaced_by_parameters() -> None:
    known = soft_limits_from_urdf(URDF)
    assert known["j"] == SOFT
    assert (known["wheel"].min_position, known["wheel"].max_position) == (-math.inf, math.inf)
    values = {
        "has_soft_limits": True,
        "soft_lower_limit": -0.5,
        "soft_upper_limit": 0.5,
        "k_position": 1.0,
        "k_velocity": 2.0,
    }
    root = MappingNodeHandle({"joint_limits": {"j": values}})
    assert soft_limits_with_parameters("j", SOFT, root) == SoftJointLimits(-0.5, 0.5, 1.0, 2.0)
    assert soft_limits_with_parameters("other", SOFT, root) == SOFT
    assert soft_limits_with_parameters("other", None, root) is None


def test_a_limit_said_to_be_absent_is_removed() -> None:
    root = MappingNodeHandle(
        {
            "joint_limits": {
                "j": {
                    "has_position_limits": False,
                    "angle_wraparound": True,
                    "has_velocity_limits": False,
                    "has_effort_limits": False,
                    "has_acceleration_limits": True,
                    "max_acceleration": 3.0,
                    "has_jerk_limits": True,
                    "max_jerk": 9.0,
                }
            }
        }
    )
    assert limits_with_parameters("j", LIMITS, root) == JointLimits(continuous=True, max_acceleration=3.0)


SOFT_VALUES = {"soft_lower_limit": -0.5, "soft_upper_limit": 0.5, "k_position": 1.0, "k_velocity": 2.0}


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (
            {"has_position_limits": True, "max_position": 0.1},
            "min_position, max_position is incomplete (set: max_position)",
        ),
        ({"has_position_limits": True}, "min_position, max_position is incomplete (set: none)"),
        ({"has_velocity_limits": True}, "max_velocity is incomplete (set: none)"),
        (
            {"min_position": -0.1, "max_position": 0.1},
            "min_position, max_position, because has_position_limits is not set",
        ),
        ({"has_soft_limits": True, "k_position": 1.0}, "is incomplete (set: k_position)"),
        (SOFT_VALUES, "k_velocity, because has_soft_limits is not set"),
        ({"has_soft_limits": False, **SOFT_VALUES}, ""),
    ],
)
def test_limits_that_are_not_complete_or_not_in_force_change_nothing(
    values: dict[str, Any], words: str, caplog: pytest.LogCaptureFixture
) -> None:
    root = MappingNodeHandle({"joint_limits": {"j": values}})
    assert limits_with_parameters("j", LIMITS, root) == LIMITS
    assert soft_limits_with_parameters("j", SOFT, root) == SOFT
    assert words in caplog.text and bool(words) == ("/joint_limits/j" in caplog.text)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"has_position_limits": True, "min_position": 2.0, "max_position": 1.0}, "must not exceed"),
        ({"has_position_limits": "yes"}, "/joint_limits/j/has_position_limits: got 'yes'"),
        ({"has_velocity_limits": True, "max_velocity": -1.0}, "/joint_limits/j/max_velocity: got -1.0"),
        (
            {
                "has_soft_limits": True,
                "soft_lower_limit": 1.0,
                "soft_upper_limit": 1.0,
                "k_position": 1.0,
                "k_velocity": 1.0,
            },
            "must be below",
        ),
        (
            {
                "has_soft_limits": True,
                "soft_lower_limit": 0.0,
                "soft_upper_limit": 1.0,
                "k_position": -1.0,
                "k_velocity": 1.0,
            },
            "neither may be negative",
        ),
    ],
)
def test_limits_that_make_no_sense_refuse_the_hardware(
    values: dict[str, Any], words: str, caplog: pytest.LogCaptureFixture
) -> None:
    root = MappingNodeHandle({"joint_limits": {"j": values}, "hw": {"joints": ["j"]}})
    assert MockRobotHW().init(root, root.child("hw")) is False
    assert words in caplog.text


def test_a_number_of_the_description_that_is_none_is_named() -> None:
    with pytest.raises(ParameterError, match="<safety_controller> of joint 'j': k_position"):
        soft_limits_from_urdf(URDF.replace('k_position="10"', 'k_position="ten"'))


@pytest.mark.parametrize(
    ("interface", "controller", "command"),
    [
        ("PositionJointInterface", "position_controllers/JointPositionController", 9.0),
        ("VelocityJointInterface", "velocity_controllers/JointVelocityController", 9.0),
        ("EffortJointInterface", "effort_controllers/JointEffortController", 9.0),
    ],
)
def test_between_controller_and_hardware_the_limits_hold(
    make_loop: Callable[..., Any], interface: str, controller: str, command: float
) -> None:
    loop = make_loop(
        {
            "robot_description": URDF,
            "hw": {"joints": ["j"], "command_interface": interface},
            "c": {"type": controller, "joint": "j"},
        }
    )
    loop.spawn("c")
    loop.controllers["c"].submit([command])
    joint = loop.robot_hw.interfaces[1].handles[0]
    fastest = 0.0
    for _ in range(500):
        loop.step()
        fastest = max(fastest, abs(joint.velocity))
        if interface == "EffortJointInterface":  # a body that brakes with at most 5 overshoots the soft end
            assert joint.position <= 1.0 and abs(joint.command) <= 5.0
        else:
            assert joint.position <= 0.8 + 1e-2
    assert joint.velocity == pytest.approx(0.0, abs=1e-2) and joint.position >= 0.79
    assert 1.0 < fastest <= 2.0 + 5.0 * 0.01 + 1e-9


def test_a_guard_resets_the_joints_it_is_asked_to_reset() -> None:
    robot_hw = MockRobotHW()
    root = MappingNodeHandle(
        {
            "hw": {"joints": ["a", "b"]},
            "joint_limits": {name: {"has_velocity_limits": True, "max_velocity": 1.0} for name in ("a", "b")},
        }
    )
    assert robot_hw.init(root, root.child("hw"))
    guard = JointLimitGuard(robot_hw, root)
    handles = robot_hw.get(PositionJointInterface).handles
    guard.enforce(0.1)
    for joint in handles:
        joint.state.position = joint.command = 3.0
    guard.reset(["a"])
    guard.enforce(0.1)
    assert [joint.command for joint in handles] == [3.0, 0.1]
    assert limit_handle(VelocityJointInterface, handles[0], LIMITS).handle is handles[0]
