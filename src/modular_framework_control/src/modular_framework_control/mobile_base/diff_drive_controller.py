# SPDX-License-Identifier: BSD-3-Clause
"""Controller for a base with differential drive."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from modular_framework_control.hardware_interface.handles import JointHandle
from modular_framework_control.hardware_interface.interfaces import VelocityJointInterface
from modular_framework_control.mobile_base.mobile_base_controller import (
    AT_REST,
    BaseSettings,
    BaseVelocity,
    MobileBaseController,
    TwistLimits,
    read_positive,
)
from modular_framework_control.mobile_base.wheel_geometry import WheelGeometry
from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names, read_bool, read_names


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelState:
    """State of one wheel in one cycle.

    Attributes:
        position: Measured position [rad].
        velocity: Measured velocity [rad/s].
        acceleration: Derivative of the measured velocity [rad/s^2].
        effort: Measured effort [Nm].
        desired_position: Integral of the commands since the start [rad].
        desired_velocity: Commanded velocity [rad/s].
        desired_acceleration: Derivative of the command [rad/s^2].
    """

    position: float
    velocity: float
    acceleration: float
    effort: float
    desired_position: float
    desired_velocity: float
    desired_acceleration: float


@dataclass(frozen=True)
class DiffDriveSettings(BaseSettings):
    """Settings of differential drive, with factors that calibrate the geometry.

    Attributes:
        left_wheel_radius_multiplier: Factor on `wheel_radius` for the left wheels.
        right_wheel_radius_multiplier: Factor on `wheel_radius` for the right wheels.
        wheel_separation_multiplier: Factor on `wheel_separation`.
    """

    left_wheel_radius_multiplier: float = 1.0
    right_wheel_radius_multiplier: float = 1.0
    wheel_separation_multiplier: float = 1.0


class _Wheel:
    """A wheel joint with the last velocities, for accelerations."""

    def __init__(self, handle: JointHandle) -> None:
        self.handle = handle
        self.start()

    def start(self) -> None:
        self._velocity = self.handle.velocity
        self._desired_position, self._desired_velocity = self.handle.position, 0.0

    def step(self, period_s: float) -> WheelState:
        """Returns the state after a command, `period_s` after the last call."""
        handle = self.handle
        rate = 1.0 / period_s if period_s > 0.0 else 0.0
        self._desired_position += handle.command * period_s
        state = WheelState(
            position=handle.position,
            velocity=handle.velocity,
            acceleration=(handle.velocity - self._velocity) * rate,
            effort=handle.effort,
            desired_position=self._desired_position,
            desired_velocity=handle.command,
            desired_acceleration=(handle.command - self._desired_velocity) * rate,
        )
        self._velocity, self._desired_velocity = handle.velocity, handle.command
        return state


class DiffDriveController(MobileBaseController):
    """diff_drive_controller/DiffDriveController; a command is a `BaseVelocity`.

    Parameters, in addition to MobileBaseController: `left_wheel` and `right_wheel`, one joint or equally long lists of
    joints; `wheel_separation` [m] and `wheel_radius` [m], by default from the robot description;
    `wheel_separation_multiplier` 1; `wheel_radius_multiplier`, or `left_wheel_radius_multiplier` and
    `right_wheel_radius_multiplier`, 1; `publish_cmd` false; `publish_wheel_joint_controller_state` false.

    While the position of a wheel is not a number, the odometry stops and the base comes to rest.

    Attributes:
        settings: Settings that can change at runtime.
        wheel_names: Joints, left joints first.
        publishes_command: Whether commanded velocities are published.
        publishes_wheels: Whether wheel states are published.
        on_command: Function called in every control cycle with the time [s] and the commanded velocity.
        on_wheels: Function called in every control cycle with the time [s] and the wheel states, as in `wheel_names`.
    """

    interface_class = VelocityJointInterface
    settings: DiffDriveSettings

    def __init__(self) -> None:
        super().__init__()
        self.on_command: Callable[[float, BaseVelocity], None] | None = None
        self.on_wheels: Callable[[float, list[WheelState]], None] | None = None

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        super().init(hw, root_nh, controller_nh)
        left, right = read_names(controller_nh, "left_wheel"), read_names(controller_nh, "right_wheel")
        if len(left) != len(right) or set(left) & set(right):
            raise ParameterError(
                f"parameters {join_names(controller_nh.namespace, 'left_wheel')} and right_wheel: got "
                f"{left} and {right}; expected equally many joints on both sides, each named once"
            )
        self.wheel_names = [*left, *right]
        self.publishes_command = read_bool(controller_nh, "publish_cmd", False)
        self.publishes_wheels = read_bool(controller_nh, "publish_wheel_joint_controller_state", False)
        self._separation = (
            read_positive(controller_nh, "wheel_separation", 1.0)
            if controller_nh.has_param("wheel_separation")
            else _separation_of(WheelGeometry(root_nh, "wheel_separation"), left[0], right[0])
        )
        self._radius = (
            read_positive(controller_nh, "wheel_radius", 1.0)
            if controller_nh.has_param("wheel_radius")
            else WheelGeometry(root_nh, "wheel_radius").radius(left[0])
        )
        self._left = [_Wheel(hw.get_handle(name)) for name in left]
        self._right = [_Wheel(hw.get_handle(name)) for name in right]
        self._limits = TwistLimits(self._linear_limits, self._angular_limits)
        return True

    def _read_settings(self, controller_nh: NodeHandle) -> DiffDriveSettings:
        basic = super()._read_settings(controller_nh)
        both = controller_nh.has_param("wheel_radius_multiplier")
        left, right = (
            read_positive(controller_nh, "wheel_radius_multiplier" if both else f"{side}_wheel_radius_multiplier", 1.0)
            for side in ("left", "right")
        )
        return DiffDriveSettings(
            basic.publish_rate,
            basic.enable_odom_tf,
            left,
            right,
            read_positive(controller_nh, "wheel_separation_multiplier", 1.0),
        )

    def starting(self, time_s: float) -> None:
        super().starting(time_s)
        for wheel in (*self._left, *self._right):
            wheel.start()
        self._last_positions = self._positions()

    def _clear_commands(self) -> None:
        super()._clear_commands()
        self._limits.clear()

    def _geometry(self) -> tuple[float, float, float]:
        """Returns the radii of left and right wheels, and the wheel separation [m]."""
        settings = self.settings
        return (
            self._radius * settings.left_wheel_radius_multiplier,
            self._radius * settings.right_wheel_radius_multiplier,
            self._separation * settings.wheel_separation_multiplier,
        )

    def _positions(self) -> tuple[float, float]:
        """Returns the mean positions of left and right wheels [rad]."""
        count = len(self._left)
        return (
            sum(wheel.handle.position for wheel in self._left) / count,
            sum(wheel.handle.position for wheel in self._right) / count,
        )

    def _follow_wheels(self, time_s: float) -> bool:
        if self._open_loop:
            self.odometry.move_at(self._limits.last.linear, 0.0, self._limits.last.angular, time_s)
            return True
        positions = self._positions()
        if not all(map(math.isfinite, positions)):
            return False
        left_radius, right_radius, separation = self._geometry()
        if all(map(math.isfinite, self._last_positions)):
            left = (positions[0] - self._last_positions[0]) * left_radius
            right = (positions[1] - self._last_positions[1]) * right_radius
            self.odometry.move((left + right) / 2.0, (right - left) / separation, time_s)
        self._last_positions = positions
        return True

    def _drive(self, command: Any, time_s: float, period_s: float) -> None:
        velocity = self._limits.limit(AT_REST if command is None else command, period_s)
        left_radius, right_radius, separation = self._geometry()
        difference = velocity.angular * separation / 2.0
        self._command((velocity.linear - difference) / left_radius, (velocity.linear + difference) / right_radius)
        if self.on_command is not None:
            self.on_command(time_s, velocity)
        if self.on_wheels is not None:
            self.on_wheels(time_s, [wheel.step(period_s) for wheel in (*self._left, *self._right)])

    def _brake(self) -> None:
        self._command(0.0, 0.0)

    def _command(self, left: float, right: float) -> None:
        for wheel in self._left:
            wheel.handle.command = left
        for wheel in self._right:
            wheel.handle.command = right


def _separation_of(geometry: WheelGeometry, left: str, right: str) -> float:
    separation = geometry.distance(left, right)
    if separation <= 0.0:
        raise ParameterError(
            f"robot_description: joints '{left}' and '{right}' are at the same position; expected a distance "
            "between the wheels; set wheel_separation, or correct the description"
        )
    return separation
