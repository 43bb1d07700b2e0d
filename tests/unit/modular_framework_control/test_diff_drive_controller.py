# SPDX-License-Identifier: BSD-3-Clause
"""The controller of a base with wheels on its left and on its right, in a loop with fake hardware."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from modular_framework_control.controller_interface.controller import ControllerError
from modular_framework_control.hardware_interface.interfaces import VelocityJointInterface
from modular_framework_control.mobile_base.diff_drive_controller import DiffDriveController, WheelState
from modular_framework_control.mobile_base.mobile_base_controller import BaseVelocity, OdometrySnapshot

RADIUS, SEPARATION = 0.1, 0.5
WHEELS = ["left", "right"]


class Base:
    """A controller on fake wheels that turn as fast as they are commanded."""

    def __init__(self, make_loop: Callable[..., Any], wheels: list[str] = WHEELS, **more: Any) -> None:
        half = len(wheels) // 2
        parameters = {
            "type": "diff_drive_controller/DiffDriveController",
            "left_wheel": wheels[:half],
            "right_wheel": wheels[half:],
            "wheel_separation": SEPARATION,
            "wheel_radius": RADIUS,
            "pose_covariance_diagonal": [1, 2, 3, 4, 5, 6.0],
            "twist_covariance_diagonal": [0.1] * 6,
            **more,
        }
        self.loop = make_loop(
            {
                "hw": {"joints": wheels, "command_interface": "VelocityJointInterface"},
                "base": {key: value for key, value in parameters.items() if value is not None},
            }
        )
        self.loop.manager.load_controller("base")
        self.controller: DiffDriveController = self.loop.controllers["base"]
        self.odometry: list[OdometrySnapshot] = []
        self.commands: list[BaseVelocity] = []
        self.wheels: list[list[WheelState]] = []
        self.controller.on_odometry = self.odometry.append
        self.controller.on_command = lambda _, velocity: self.commands.append(velocity)
        self.controller.on_wheels = lambda _, states: self.wheels.append(states)
        assert self.loop.switch(["base"], []) is None

    def joint(self, name: str) -> Any:
        return next(h for h in self.loop.robot_hw.get(VelocityJointInterface).handles if h.name == name)

    def drive(self, linear: float, angular: float, duration_s: float) -> None:
        self.controller.submit(BaseVelocity(linear, angular))
        self.loop.run(duration_s)


@pytest.fixture
def make_base(make_loop: Callable[..., Any]) -> Callable[..., Base]:
    return lambda *arguments, **more: Base(make_loop, *arguments, **more)


def test_wheels_turn_as_the_velocity_of_the_base_demands(make_base: Callable[..., Base]) -> None:
    base = make_base()
    base.drive(0.3, 0.4, 0.05)
    assert [base.joint(name).command for name in WHEELS] == pytest.approx([(0.3 - 0.1) / 0.1, (0.3 + 0.1) / 0.1])


def test_odometry_follows_a_circle(make_base: Callable[..., Base]) -> None:
    base = make_base(cmd_vel_timeout=60.0)
    base.drive(0.5, 0.25, 0.1)
    begun = base.controller.odometry.heading
    base.loop.run(8.0)
    pose = base.controller.odometry
    assert pose.heading - begun == pytest.approx(0.25 * 8.0, abs=1e-6)
    assert (pose.x, pose.y) == pytest.approx((2.0 * math.sin(pose.heading), 2.0 * (1.0 - math.cos(pose.heading))))
    assert (pose.linear, pose.angular) == pytest.approx((0.5, 0.25))


def test_each_side_may_have_several_wheels(make_base: Callable[..., Base]) -> None:
    base = make_base(["l1", "l2", "l3", "r1", "r2", "r3"], cmd_vel_timeout=60.0)
    base.drive(0.2, 0.0, 1.0)
    assert [base.joint(name).command for name in ("l1", "l2", "l3", "r1", "r2", "r3")] == pytest.approx([2.0] * 6)
    assert base.controller.odometry.x == pytest.approx(0.2, abs=0.01)


def test_a_command_that_grows_old_is_no_longer_in_force(make_base: Callable[..., Base]) -> None:
    base = make_base()
    base.drive(1.0, 0.0, 0.5)
    assert base.joint("left").command == pytest.approx(10.0)
    base.loop.step(3)
    assert base.joint("left").command == 0.0
    assert base.controller.odometry.x == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("command", [(math.nan, 0.0), (0.0, math.nan), (math.inf, 0.0)])
def test_a_command_that_is_not_finite_is_refused_and_the_one_before_stays(
    make_base: Callable[..., Base], command: tuple[float, float]
) -> None:
    base = make_base()
    base.drive(0.2, 0.0, 0.1)
    with pytest.raises(ControllerError, match="expected finite numbers"):
        base.controller.submit(BaseVelocity(*command))
    base.loop.step(3)
    assert base.joint("left").command == pytest.approx(2.0)


def test_a_controller_that_does_not_run_takes_no_commands_and_its_wheels_stand(make_base: Callable[..., Base]) -> None:
    base = make_base()
    base.drive(1.0, 0.0, 0.1)
    assert base.loop.switch([], ["base"]) is None
    assert base.joint("left").command == 0.0
    with pytest.raises(ControllerError, match="not running"):
        base.controller.submit(BaseVelocity(1.0, 0.0))
    assert base.loop.switch(["base"], []) is None
    base.loop.step(3)
    assert base.joint("left").command == 0.0, "a command of before the stop is not in force after the start"


def test_a_dropped_command_brings_the_base_to_rest_within_its_limits(make_base: Callable[..., Base]) -> None:
    limits = {"x": {"has_acceleration_limits": True, "max_acceleration": 1.0}}
    base = make_base(linear=limits, cmd_vel_timeout=60.0)
    base.drive(0.5, 0.0, 1.0)
    assert base.commands[-1].linear == pytest.approx(0.5)
    base.controller.drop_command()
    base.loop.run(0.25)
    assert base.commands[-1].linear == pytest.approx(0.25, abs=0.011)
    base.loop.run(0.3)
    assert base.commands[-1].linear == 0.0


def test_the_published_command_is_the_limited_one(make_base: Callable[..., Base]) -> None:
    base = make_base(
        linear={"x": {"has_velocity_limits": True, "max_velocity": 0.4}},
        angular={"z": {"has_velocity_limits": True, "max_velocity": 2.0, "min_velocity": -1.0}},
    )
    base.drive(9.0, -9.0, 0.1)
    assert base.commands[-1] == BaseVelocity(0.4, -1.0)


def test_calibration_factors_take_part_in_commands_and_in_odometry(make_base: Callable[..., Base]) -> None:
    base = make_base(
        cmd_vel_timeout=60.0,
        wheel_separation_multiplier=2.0,
        left_wheel_radius_multiplier=1.25,
        right_wheel_radius_multiplier=0.8,
    )
    base.drive(0.5, 0.5, 4.0)
    assert base.joint("left").velocity == pytest.approx((0.5 - 0.25) / 0.125)
    assert base.joint("right").velocity == pytest.approx((0.5 + 0.25) / 0.08)
    assert (base.controller.odometry.linear, base.controller.odometry.angular) == pytest.approx((0.5, 0.5))


def test_one_factor_for_both_radii_stands_before_those_of_the_sides(make_base: Callable[..., Base]) -> None:
    base = make_base(wheel_radius_multiplier=2.0, left_wheel_radius_multiplier=9.0)
    assert (
        base.controller.settings.left_wheel_radius_multiplier,
        base.controller.settings.right_wheel_radius_multiplier,
    ) == (2.0, 2.0)


def test_factors_that_change_under_way_do_not_move_the_base(make_base: Callable[..., Base]) -> None:
    base = make_base(cmd_vel_timeout=60.0)
    base.drive(0.5, 0.0, 5.0)
    before = base.controller.odometry.x
    base.controller.settings = replace(
        base.controller.settings, left_wheel_radius_multiplier=1.5, right_wheel_radius_multiplier=1.5, publish_rate=0.0
    )
    base.loop.step(1)
    assert base.controller.odometry.x - before < 0.01
    published = len(base.odometry)
    base.loop.run(1.0)
    assert len(base.odometry) <= published + 1


def test_wheels_that_stand_anywhere_at_the_start_have_not_moved_the_base(make_base: Callable[..., Base]) -> None:
    base = make_base()
    assert base.loop.switch([], ["base"]) is None
    for name in WHEELS:
        base.joint(name).state.position = 40.0
    assert base.loop.switch(["base"], []) is None
    base.loop.step(5)
    assert (base.controller.odometry.x, base.controller.odometry.linear) == (0.0, 0.0)


def test_a_wheel_whose_position_is_not_known_leaves_the_odometry_and_stops_the_base(
    make_base: Callable[..., Base],
) -> None:
    base = make_base(cmd_vel_timeout=60.0)
    base.drive(0.5, 0.0, 1.0)
    before = base.controller.odometry.x
    known, base.joint("left").state.position = base.joint("left").position, math.nan
    base.loop.step(3)
    assert base.controller.odometry.x == before
    assert [base.joint(name).command for name in WHEELS] == [0.0, 0.0]
    base.joint("left").state.position = known
    base.loop.run(0.5)
    assert base.controller.odometry.x > before
    assert math.isfinite(base.controller.odometry.heading)


def test_with_open_loop_the_odometry_is_what_was_commanded(make_base: Callable[..., Base]) -> None:
    base = make_base(open_loop=True, cmd_vel_timeout=60.0)
    base.joint("left").state.position = math.nan
    base.drive(0.5, 0.0, 2.0)
    assert base.controller.odometry.x == pytest.approx(1.0, abs=0.02)
    assert base.controller.odometry.linear == 0.5


def test_odometry_is_published_at_its_rate(make_base: Callable[..., Base]) -> None:
    base = make_base(publish_rate=20.0, enable_odom_tf=False)
    base.loop.run(1.0)
    before = len(base.odometry)
    base.loop.run(2.0)
    assert len(base.odometry) - before == 40
    assert not base.odometry[-1].with_tf
    assert base.controller.frames.odom == "odom" and base.controller.frames.base == "base_link"
    assert base.controller.frames.pose_covariance == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


def test_states_of_the_wheels_hold_measured_and_commanded_motion(make_base: Callable[..., Base]) -> None:
    base = make_base(cmd_vel_timeout=60.0)
    base.drive(0.2, 0.0, 1.0)
    left = base.wheels[-1][0]
    assert (left.velocity, left.desired_velocity) == pytest.approx((2.0, 2.0))
    assert left.desired_position - left.position == pytest.approx(0.0, abs=0.05)
    assert max(states[0].desired_acceleration for states in base.wheels) == pytest.approx(2.0 / 0.01)
    assert left.acceleration == left.desired_acceleration == pytest.approx(0.0, abs=1e-9)


def test_while_the_hardware_has_a_fault_the_wheels_stand_and_commands_are_refused(
    make_base: Callable[..., Base], monkeypatch: pytest.MonkeyPatch
) -> None:
    base = make_base(cmd_vel_timeout=60.0)
    base.drive(0.5, 0.0, 0.2)
    monkeypatch.setattr(base.loop.robot_hw, "fault", lambda: "protective stop")
    base.loop.step(2)
    assert base.joint("left").command == 0.0
    with pytest.raises(ControllerError, match="hardware fault: protective stop"):
        base.controller.submit(BaseVelocity(0.5, 0.0))
    monkeypatch.setattr(base.loop.robot_hw, "fault", lambda: "")
    base.loop.step(3)
    assert base.joint("left").command == 0.0, "the command of before the fault is gone"
    base.drive(0.5, 0.0, 0.1)
    assert base.joint("left").command == pytest.approx(5.0)


def test_a_command_that_comes_just_as_the_fault_does_is_gone_when_the_fault_is_over(
    make_base: Callable[..., Base],
) -> None:
    base = make_base(cmd_vel_timeout=60.0)

    class FaultMeanwhile(BaseVelocity):
        """A command; the fault comes while it is checked."""

        @property
        def finite(self) -> bool:
            base.controller.on_hardware_fault(base.loop.time_s, "protective stop")
            return True

    base.controller.submit(FaultMeanwhile(1.0, 0.0))
    base.loop.step()
    base.controller.on_hardware_recovered(base.loop.time_s)
    base.loop.run(0.1)
    assert [base.joint(name).command for name in WHEELS] == [0.0, 0.0]


def test_odometry_comes_at_the_rate_that_is_set_while_the_controller_runs(make_base: Callable[..., Base]) -> None:
    base = make_base(publish_rate=0.0)
    base.loop.run(1.0)
    assert base.odometry == []
    for rate in (20.0, 0.0, 50.0):
        base.controller.settings = replace(base.controller.settings, publish_rate=rate)
        base.odometry.clear()
        base.loop.run(1.0)
        assert len(base.odometry) == pytest.approx(rate, abs=1)


@pytest.mark.parametrize(
    ("parameters", "fault"),
    [
        ({"right_wheel": []}, "expected a list of joint names"),
        ({"left_wheel": None}, "/base/left_wheel: got None"),
        ({"left_wheel": ["left", "right"]}, "equally many joints on both sides"),
        ({"left_wheel": "nobody"}, "no joint 'nobody'; it has: left, right"),
        ({"wheel_radius": 0.0}, "wheel_radius: got 0.0; expected a number above 0"),
        ({"wheel_radius": None}, "robot_description is not set, but needed for wheel_radius"),
        ({"wheel_separation": None}, "needed for wheel_separation"),
        ({"wheel_separation_multiplier": -1.0}, "wheel_separation_multiplier: got -1.0"),
        ({"pose_covariance_diagonal": None}, "pose_covariance_diagonal: got None; expected six numbers"),
        ({"twist_covariance_diagonal": [1, 2, 3]}, "expected six numbers"),
        ({"odom_frame_id": 5}, "odom_frame_id: got 5; expected a frame's name"),
        ({"velocity_rolling_window_size": 0}, "at least 1"),
        ({"open_loop": "no"}, "open_loop: got 'no'; expected true or false"),
    ],
)
def test_parameters_that_make_no_sense_are_refused_with_their_name(
    make_base: Callable[..., Base], parameters: dict[str, Any], fault: str
) -> None:
    with pytest.raises(ControllerError, match=fault):
        make_base(**parameters)
