# SPDX-License-Identifier: BSD-3-Clause
"""Controllers of bases that steer like a car or with four wheels, in a loop with fake hardware, and their geometry."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from modular_framework_control.controller_interface.controller import ControllerError
from modular_framework_control.hardware_interface.handles import JointHandle, JointStateHandle
from modular_framework_control.hardware_interface.interfaces import (
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.mobile_base.four_wheel_kinematics import (
    MAX_AXLE_SPEED_RATIO,
    FourWheelGeometry,
    PlanarTwist,
    axle_angle,
)
from modular_framework_control.mobile_base.four_wheel_steering_controller import SteeringCommand
from modular_framework_control.mobile_base.mobile_base_controller import BaseVelocity
from modular_framework_ros.node_handle import NodeHandle

TRACK, WHEEL_BASE, RADIUS, OFFSET = 1.2, 1.9, 0.28, 0.1
GEOMETRY = FourWheelGeometry(TRACK, WHEEL_BASE, RADIUS, OFFSET)
ANGLES = st.floats(-1.2, 1.2)


# ---- geometry of four wheels ----


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.0, 0.3))
def test_the_motion_of_a_base_is_found_again_from_its_wheels(
    linear: float, lateral: float, angular: float, offset: float
) -> None:
    assume(abs(linear) > 1e-3)
    geometry = FourWheelGeometry(TRACK, WHEEL_BASE, RADIUS, offset)
    found = geometry.twist(*geometry.wheels(PlanarTwist(linear, lateral, angular)))
    assert (found.linear, found.lateral, found.angular) == pytest.approx((linear, lateral, angular), abs=1e-9)


@given(st.floats(0.1, 2.0), ANGLES, ANGLES)
def test_all_wheels_stand_across_the_way_to_one_centre(speed: float, front: float, rear: float) -> None:
    assume(abs(math.tan(front) - math.tan(rear)) > 0.05)
    twist = GEOMETRY.twist_of_axles(speed, front, rear)
    centre = np.array([-twist.lateral, twist.linear]) / twist.angular
    for (x, y), angle in zip(GEOMETRY.axes(), GEOMETRY.wheels(twist)[0], strict=True):
        way = centre - np.array([x, y])
        assert way @ np.array([math.cos(angle), math.sin(angle)]) == pytest.approx(0.0, abs=1e-6 * (1 + abs(way).max()))


@given(st.floats(-2.0, 2.0), ANGLES, ANGLES)
def test_axles_steer_as_commanded(speed: float, front: float, rear: float) -> None:
    assume(abs(speed) > 0.1)
    twist = GEOMETRY.twist_of_axles(speed, front, rear)
    half = WHEEL_BASE / 2.0
    assert math.atan((twist.lateral + twist.angular * half) / twist.linear) == pytest.approx(front, abs=1e-9)
    assert math.atan((twist.lateral - twist.angular * half) / twist.linear) == pytest.approx(rear, abs=1e-9)


def test_wheels_of_a_car_like_turn_stand_by_ackermanns_rule() -> None:
    angles, _ = GEOMETRY.wheels(GEOMETRY.twist_of_axles(1.0, 0.4, 0.0))
    half = TRACK / 2.0 - OFFSET
    radius = WHEEL_BASE / math.tan(0.4)
    assert angles == pytest.approx(
        [math.atan(WHEEL_BASE / (radius - half)), math.atan(WHEEL_BASE / (radius + half)), 0.0, 0.0]
    )


def test_in_a_crab_walk_all_wheels_are_parallel_and_as_fast_as_the_base() -> None:
    for angle in (math.pi / 8.0, -0.5, math.pi / 2.0):
        angles, velocities = GEOMETRY.wheels(GEOMETRY.twist_of_axles(0.2, angle, angle))
        assert angles == pytest.approx([angle] * 4)
        assert velocities == pytest.approx([0.2 / RADIUS] * 4)


def test_a_turn_with_both_axles_is_that_of_the_public_test() -> None:
    twist = GEOMETRY.twist_of_axles(math.pi / 2.0, 0.18776, -0.18776)
    assert (twist.linear, twist.lateral, twist.angular) == pytest.approx((math.pi / 2.0, 0.0, math.pi / 10.0), abs=1e-4)
    other = GEOMETRY.twist_of_axles(math.pi / 2.0, -0.21655, 0.15866)
    assert math.hypot(other.linear, other.lateral) == pytest.approx(math.pi / 2.0)
    assert other.angular == pytest.approx(-math.pi / 10.0, abs=1e-3)


@given(st.floats(-math.pi / 2.0, math.pi / 2.0), st.floats(-math.pi / 2.0, math.pi / 2.0))
def test_no_pair_of_angles_makes_an_axle_faster_than_a_small_multiple_of_the_speed(front: float, rear: float) -> None:
    twist = GEOMETRY.twist_of_axles(1.0, front, rear)
    half = WHEEL_BASE / 2.0
    for end in (1.0, -1.0):
        assert math.hypot(twist.linear, twist.lateral + end * half * twist.angular) <= MAX_AXLE_SPEED_RATIO + 1e-9


def test_the_angle_of_an_axle_is_between_those_of_its_wheels() -> None:
    angles, _ = GEOMETRY.wheels(GEOMETRY.twist_of_axles(1.0, 0.3, -0.2))
    assert (axle_angle(*angles[:2]), axle_angle(*angles[2:])) == pytest.approx((0.3, -0.2))
    assert axle_angle(0.0, 0.0) == 0.0
    assert axle_angle(0.2, -0.2) == 0.0


# ---- controllers ----


class Cart(RobotHW):
    """Wheels that turn as fast, and steering joints that stand, as they are commanded."""

    def __init__(self, wheels: Iterable[str], steerings: Iterable[str]) -> None:
        super().__init__()
        self.reason = ""
        states, velocities, positions = JointStateInterface(), VelocityJointInterface(), PositionJointInterface()
        self.wheels = {
            name: velocities.register_handle(JointHandle(states.register_handle(JointStateHandle(name, 0.0)), 0.0))
            for name in wheels
        }
        self.steerings = {
            name: positions.register_handle(JointHandle(states.register_handle(JointStateHandle(name, 0.0)), 0.0))
            for name in steerings
        }
        for interface in (states, velocities, positions):
            self.register_interface(interface)

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        return True

    def fault(self) -> str:
        return self.reason

    def read(self, time_s: float, period_s: float) -> None:
        for wheel in self.wheels.values():
            wheel.state.velocity = wheel.command
            wheel.state.position += wheel.command * period_s
        for steering in self.steerings.values():
            steering.state.position = steering.command


COMMON = {"pose_covariance_diagonal": [0.1] * 6, "twist_covariance_diagonal": [0.1] * 6, "cmd_vel_timeout": 60.0}
URDF = """<robot name="r"><link name="base"/>
<link name="w"><collision><geometry><cylinder radius="0.11" length="0.1"/></geometry></collision></link>
<joint name="rear_wheel_joint" type="continuous"><parent link="base"/><child link="w"/><origin xyz="-0.15 0.1 0"/>
</joint>
<joint name="front_steer_joint" type="revolute"><parent link="base"/><child link="s"/><origin xyz="0.25 0 0"/></joint>
</robot>"""


@pytest.fixture
def car(make_loop: Callable[..., Any]) -> Callable[..., Any]:
    def make(**more: Any) -> Any:
        parameters = {"type": "ackermann_steering_controller/AckermannSteeringController", **COMMON, **more}
        loop = make_loop(
            {"robot_description": parameters.pop("robot_description", URDF), "c": parameters},
            Cart(["rear_wheel_joint"], ["front_steer_joint"]),
        )
        loop.spawn("c")
        return loop

    return make


FOUR = ["front_left", "front_right", "rear_left", "rear_right"]


@pytest.fixture
def rover(make_loop: Callable[..., Any]) -> Callable[..., Any]:
    def make(**more: Any) -> Any:
        parameters = {
            "type": "four_wheel_steering_controller/FourWheelSteeringController",
            **COMMON,
            "front_wheel": FOUR[:2],
            "rear_wheel": FOUR[2:],
            "track": TRACK,
            "wheel_base": WHEEL_BASE,
            "front_steering": ["s_" + name for name in FOUR[:2]],
            "rear_steering": ["s_" + name for name in FOUR[2:]],
            "wheel_radius": RADIUS,
            "wheel_steering_y_offset": OFFSET,
            **more,
        }
        loop = make_loop(
            {"c": {key: value for key, value in parameters.items() if value is not None}},
            Cart(FOUR, ["s_" + name for name in FOUR]),
        )
        loop.spawn("c")
        return loop

    return make


def drive(loop: Any, command: Any, duration_s: float) -> Any:
    """Command the base for some time [s]; returns its odometry."""
    loop.controllers["c"].submit(command)
    loop.run(duration_s)
    return loop.controllers["c"].odometry


@pytest.mark.parametrize("open_loop", [False, True])
def test_a_car_drives_the_circle_of_its_steering_angle(car: Callable[..., Any], open_loop: bool) -> None:
    loop = car(open_loop=open_loop)
    pose = drive(loop, BaseVelocity(0.5, 0.3), 4.0)
    radius = 0.4 / math.tan(0.3)  # axles 0.4 m apart by the description
    assert pose.heading == pytest.approx(0.5 * 4.0 / radius, abs=0.03)
    assert (pose.x, pose.y) == pytest.approx(
        (radius * math.sin(pose.heading), radius * (1 - math.cos(pose.heading))), abs=1e-2
    )
    assert loop.robot_hw.wheels["rear_wheel_joint"].command == pytest.approx(0.5 / 0.11)
    assert (pose.linear, pose.angular) == pytest.approx((0.5, 0.5 / radius))


def test_factors_of_a_car_take_part_in_commands_and_odometry(car: Callable[..., Any]) -> None:
    loop = car(
        wheel_radius=0.2,
        wheel_radius_multiplier=0.5,
        wheel_separation_h=1.0,
        wheel_separation_h_multiplier=0.8,
        steer_pos_multiplier=2.0,
    )
    pose = drive(loop, BaseVelocity(0.5, 0.2), 1.0)
    assert loop.robot_hw.wheels["rear_wheel_joint"].command == pytest.approx(5.0)
    assert (pose.linear, pose.angular) == pytest.approx((0.5, 0.5 * math.tan(0.4) / 0.8))


def test_a_car_stops_when_its_command_is_old_and_at_once_when_it_is_stopped(car: Callable[..., Any]) -> None:
    loop = car(cmd_vel_timeout=0.2)
    hardware = loop.robot_hw
    drive(loop, BaseVelocity(0.5, 0.2), 0.3)
    assert (hardware.wheels["rear_wheel_joint"].command, hardware.steerings["front_steer_joint"].command) == (0.0, 0.0)
    drive(loop, BaseVelocity(0.5, 0.2), 0.1)
    assert loop.switch([], ["c"]) is None
    assert hardware.wheels["rear_wheel_joint"].command == 0.0
    assert hardware.steerings["front_steer_joint"].command == 0.2, "the steering stays where it is"


def test_a_car_whose_steering_is_not_known_comes_to_rest(car: Callable[..., Any]) -> None:
    loop = car()
    before = drive(loop, BaseVelocity(0.5, 0.2), 1.0).x
    controller = loop.controllers["c"]
    loop.robot_hw.steerings["front_steer_joint"].state.position = math.nan
    controller.update(loop.time_s, 0.01)
    assert loop.robot_hw.wheels["rear_wheel_joint"].command == 0.0
    assert controller.odometry.x == before


def test_a_rover_asked_for_a_velocity_turns_with_both_axles(rover: Callable[..., Any]) -> None:
    loop = rover()
    pose = drive(loop, BaseVelocity(0.5, 0.25), 4.0)
    steer = [loop.robot_hw.steerings["s_" + name].command for name in FOUR]
    assert steer[:2] == pytest.approx([-angle for angle in steer[2:]])
    assert steer[0] > steer[1] > 0.0, "the inner wheels steer more"
    assert pose.heading == pytest.approx(1.0, abs=0.02)
    assert (pose.linear, pose.lateral, pose.angular) == pytest.approx((0.5, 0.0, 0.25), abs=1e-9)
    assert (pose.x, pose.y) == pytest.approx(
        (2.0 * math.sin(pose.heading), 2.0 * (1 - math.cos(pose.heading))), abs=1e-2
    )


def test_a_rover_asked_to_turn_on_the_spot_stands(rover: Callable[..., Any]) -> None:
    loop = rover()
    drive(loop, BaseVelocity(0.0, 1.0), 0.2)
    assert {wheel.command for wheel in loop.robot_hw.wheels.values()} == {0.0}
    assert {steering.command for steering in loop.robot_hw.steerings.values()} == {0.0}


@pytest.mark.parametrize("open_loop", [False, True])
def test_a_rover_walks_like_a_crab(rover: Callable[..., Any], open_loop: bool) -> None:
    loop = rover(open_loop=open_loop)
    pose = drive(loop, SteeringCommand(0.2, math.pi / 8.0, math.pi / 8.0), 5.0)
    assert (pose.x, pose.y) == pytest.approx((math.cos(math.pi / 8.0), math.sin(math.pi / 8.0)), abs=0.01)
    assert pose.heading == pytest.approx(0.0, abs=1e-9)


def test_the_last_command_of_either_kind_is_in_force(rover: Callable[..., Any]) -> None:
    loop = rover()
    drive(loop, SteeringCommand(0.2, 0.3, 0.3), 0.5)
    pose = drive(loop, BaseVelocity(0.4, 0.0), 0.5)
    assert (pose.linear, pose.lateral) == pytest.approx((0.4, 0.0))
    pose = drive(loop, SteeringCommand(-0.2, 0.3, 0.3), 0.5)
    assert math.hypot(pose.linear, pose.lateral) == pytest.approx(0.2)
    assert pose.linear < 0.0 and pose.lateral < 0.0


def test_a_rover_whose_command_is_old_comes_to_rest_on_its_curve(rover: Callable[..., Any]) -> None:
    limits = {"x": {"has_acceleration_limits": True, "max_acceleration": 1.0}}
    loop = rover(cmd_vel_timeout=1.0, linear=limits)
    pose = drive(loop, SteeringCommand(0.5, 0.3, 0.0), 1.0)
    curvature = pose.angular / math.hypot(pose.linear, pose.lateral)
    loop.run(0.3)
    assert 0.0 < math.hypot(pose.linear, pose.lateral) < 0.4
    assert pose.angular / math.hypot(pose.linear, pose.lateral) == pytest.approx(curvature)
    loop.run(1.0)
    assert (pose.linear, pose.angular) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_what_a_rover_does_is_reported_with_its_angles_and_accelerations(rover: Callable[..., Any]) -> None:
    limits = {"x": {"has_acceleration_limits": True, "max_acceleration": 0.5}}
    loop = rover(linear=limits, publish_rate=1000.0)
    reported: list[Any] = []
    loop.controllers["c"].on_odometry = lambda _: None
    loop.controllers["c"].on_steering = reported.append
    drive(loop, SteeringCommand(0.5, 0.2, -0.1), 0.5)
    assert reported[-1].angles == pytest.approx((0.2, -0.1))
    assert reported[-1].values[1] == pytest.approx(0.5, rel=1e-3)
    loop.run(1.0)
    assert reported[-1].values == pytest.approx((0.5, 0.0, 0.0), abs=1e-6)
    assert reported[-1].angle_velocities == pytest.approx((0.0, 0.0), abs=1e-9)


def test_both_kinds_of_joints_are_claimed(rover: Callable[..., Any]) -> None:
    (report,) = rover().manager.list_controllers()
    assert {claim.hardware_interface: set(claim.resources) for claim in report.info.claimed_resources} == {
        "hardware_interface/VelocityJointInterface": set(FOUR),
        "hardware_interface/PositionJointInterface": {"s_" + name for name in FOUR},
    }


def test_a_fault_of_the_hardware_leaves_the_steering_where_it_is(rover: Callable[..., Any]) -> None:
    loop = rover()
    drive(loop, SteeringCommand(0.2, 0.3, 0.3), 0.5)
    loop.robot_hw.reason = "bumper"
    loop.step(3)
    assert {wheel.command for wheel in loop.robot_hw.wheels.values()} == {0.0}
    assert loop.robot_hw.steerings["s_front_left"].command == pytest.approx(0.3)


@pytest.mark.parametrize("what", ["a wheel's velocity", "a steering's position"])
def test_a_rover_whose_wheels_are_not_known_comes_to_rest(rover: Callable[..., Any], what: str) -> None:
    loop = rover()
    pose = drive(loop, SteeringCommand(0.2, 0.3, 0.3), 1.0)
    before, hardware = (pose.x, pose.y, pose.heading), loop.robot_hw
    if what == "a wheel's velocity":
        hardware.wheels["rear_left"].state.velocity = math.nan
    else:
        hardware.steerings["s_rear_left"].state.position = math.nan
    loop.controllers["c"].update(loop.time_s, 0.01)
    assert {wheel.command for wheel in hardware.wheels.values()} == {0.0}
    assert all(math.isfinite(steering.command) for steering in hardware.steerings.values())
    assert (pose.x, pose.y, pose.heading) == before


@pytest.mark.parametrize(
    "command",
    [SteeringCommand(math.nan, 0.0, 0.0), SteeringCommand(0.1, math.inf, 0.0), SteeringCommand(0.1, 0.0, math.nan)],
)
def test_a_steering_command_that_is_not_finite_is_refused(rover: Callable[..., Any], command: SteeringCommand) -> None:
    with pytest.raises(ControllerError, match="expected finite numbers"):
        rover().controllers["c"].submit(command)


@pytest.mark.parametrize(
    ("parameters", "fault"),
    [
        ({"front_wheel": FOUR[0]}, "front_wheel: got .*; expected two joints, left and right"),
        ({"rear_steering": None}, "rear_steering: got None"),
        ({"wheel_steering_y_offset": 0.6}, "wheel_steering_y_offset below half the track"),
        ({"wheel_radius": 0.0}, "wheel_radius above 0"),
        ({"track": None}, "robot_description is not set, but needed for track"),
    ],
)
def test_a_rover_that_cannot_be_is_refused(rover: Callable[..., Any], parameters: dict[str, Any], fault: str) -> None:
    with pytest.raises(ControllerError, match=fault):
        rover(**parameters)


@pytest.mark.parametrize(
    ("parameters", "fault"),
    [
        ({"front_steer": 3}, "front_steer: got 3; expected a joint's name"),
        ({"rear_wheel": "front_steer_joint"}, "is not ahead of joint"),
        ({"rear_wheel": "none"}, "unknown joint 'none'"),
        (
            {"robot_description": URDF.replace('<cylinder radius="0.11" length="0.1"/>', '<sphere radius="0.11"/>')},
            "wheel link 'w' is <sphere>; expected <cylinder>, whose radius",
        ),
    ],
)
def test_a_car_that_cannot_be_is_refused(car: Callable[..., Any], parameters: dict[str, Any], fault: str) -> None:
    with pytest.raises(ControllerError, match=fault):
        car(**parameters)
