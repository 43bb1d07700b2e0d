# SPDX-License-Identifier: BSD-3-Clause
"""Controller for a base with four driven and steered wheels."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from modular_framework_control.hardware_interface.interfaces import PositionJointInterface, VelocityJointInterface
from modular_framework_control.mobile_base.four_wheel_kinematics import FourWheelGeometry, PlanarTwist, axle_angle
from modular_framework_control.mobile_base.mobile_base_controller import (
    AT_REST,
    BaseVelocity,
    MobileBaseController,
    TwistLimits,
)
from modular_framework_control.mobile_base.speed_limiter import clamp
from modular_framework_control.mobile_base.wheel_geometry import WheelGeometry
from modular_framework_ros.node_handle import (
    NodeHandle,
    ParameterError,
    join_names,
    read_names,
    read_number,
)

MIN_SPEED = 1e-3
"""Minimum linear velocity [m/s]; below, the base stops, because a pure rotation would need large steering angles."""


@dataclass(frozen=True, slots=True)
class SteeringCommand:
    """Command of a speed and of the angles of both axles.

    Attributes:
        speed: Speed of the base's centre [m/s], negative for backwards.
        front_angle: Angle of the front axle's centre [rad].
        rear_angle: Angle of the rear axle's centre [rad].
    """

    speed: float
    front_angle: float
    rear_angle: float

    @property
    def finite(self) -> bool:
        """Whether all values are finite."""
        return all(map(math.isfinite, (self.speed, self.front_angle, self.rear_angle)))


@dataclass(frozen=True, slots=True)
class SteeringSnapshot:
    """Motion of the base, as in four_wheel_steering_msgs.

    Attributes:
        time_s: Time of the cycle.
        values: Speed, acceleration and jerk of the base.
        angles: Angles of front and rear axle [rad].
        angle_velocities: Angular velocities of front and rear steering [rad/s].
    """

    time_s: float
    values: tuple[float, float, float]
    angles: tuple[float, float]
    angle_velocities: tuple[float, float]


class _Rate:
    """Derivative of a value, averaged over a window of cycles."""

    def __init__(self, window: int) -> None:
        self._changes: deque[float] = deque(maxlen=window)
        self._last = math.nan

    def start(self) -> None:
        self._changes.clear()
        self._last = math.nan

    def derivative_at(self, value: float, period_s: float) -> float:
        """Returns the derivative at `value`, `period_s` after the last call."""
        if period_s > 0.0 and math.isfinite(self._last):
            self._changes.append((value - self._last) / period_s)
        self._last = value
        return sum(self._changes) / len(self._changes) if self._changes else 0.0


class FourWheelSteeringController(MobileBaseController):
    """four_wheel_steering_controller/FourWheelSteeringController.

    A command is a `BaseVelocity` (front and rear steer in opposite directions) or a `SteeringCommand`; the last
    command of either type is active.

    Parameters, in addition to MobileBaseController: `front_wheel`, `rear_wheel`, `front_steering`, `rear_steering`, two
    joints each, left joint first; `track`, `wheel_base`, `wheel_radius` and `wheel_steering_y_offset` [m], by default
    from the robot description. Limits of accelerations and of `angular/z` apply to `BaseVelocity` only.

    While a wheel velocity or steering angle is not a number, the odometry stops and the base comes to rest.

    Attributes:
        on_steering: Function called together with `on_odometry`.
    """

    interface_class = VelocityJointInterface

    def __init__(self) -> None:
        super().__init__()
        self.on_steering: Callable[[SteeringSnapshot], None] | None = None

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        super().init(hw, root_nh, controller_nh)
        wheels = _joints(controller_nh, ["front_wheel", "rear_wheel"])
        steerings = _joints(controller_nh, ["front_steering", "rear_steering"])
        self.geometry = _read_geometry(root_nh, controller_nh, wheels, steerings)
        self._wheels = [hw.get_handle(name) for name in wheels]
        positions = self.robot_hw.get(PositionJointInterface)
        self._steerings = [positions.get_handle(name) for name in steerings]
        self._limits = TwistLimits(self._linear_limits, self._angular_limits)
        window = int(read_number(controller_nh, "velocity_rolling_window_size", 10, 1))
        self._rates = [_Rate(window) for _ in range(4)]
        self._twist = PlanarTwist()
        self._steering: SteeringCommand | None = None
        return True

    def starting(self, time_s: float) -> None:
        super().starting(time_s)
        self._last_s = time_s
        for rate in self._rates:
            rate.start()

    def _clear_commands(self) -> None:
        super()._clear_commands()
        self._limits.clear()
        self._twist = PlanarTwist()
        self._steering = None

    def _follow_wheels(self, time_s: float) -> bool:
        twist = self._twist
        if not self._open_loop:
            velocities = [wheel.velocity for wheel in self._wheels]
            angles = [steering.position for steering in self._steerings]
            if not all(map(math.isfinite, (*velocities, *angles))):
                return False
            twist = self.geometry.twist(angles, velocities)
        self.odometry.move_at(twist.linear, twist.lateral, twist.angular, time_s)
        return True

    def _report(self, time_s: float) -> bool:
        velocity, angle = self.odometry, [steering.position for steering in self._steerings]
        axles = axle_angle(angle[0], angle[1]), axle_angle(angle[2], angle[3])
        speed = math.copysign(
            math.hypot(velocity.linear, velocity.lateral),
            velocity.linear if abs(velocity.linear) > MIN_SPEED else velocity.lateral,
        )
        period_s, self._last_s = time_s - self._last_s, time_s
        acceleration = self._rates[0].derivative_at(speed, period_s)
        values = speed, acceleration, self._rates[1].derivative_at(acceleration, period_s)
        turning = self._rates[2].derivative_at(axles[0], period_s), self._rates[3].derivative_at(axles[1], period_s)
        due = super()._report(time_s)
        if due and self.on_steering is not None:
            self.on_steering(SteeringSnapshot(time_s, values, axles, turning))
        return due

    def _drive(self, command: Any, time_s: float, period_s: float) -> None:
        if command is None and self._steering is not None:  # brake without changing the steering
            command = replace(self._steering, speed=0.0)
        self._steering = command if isinstance(command, SteeringCommand) else None
        if self._steering is not None:
            angles = self._steer(self._steering, period_s)
        else:
            velocity: BaseVelocity = self._limits.limit(AT_REST if command is None else command, period_s)
            at_rest = abs(velocity.linear) <= MIN_SPEED
            self._twist = PlanarTwist() if at_rest else PlanarTwist(velocity.linear, 0.0, velocity.angular)
            angles = self.geometry.wheels(self._twist)[0]
        for wheel, value in zip(self._wheels, self.geometry.wheels(self._twist)[1], strict=True):
            wheel.command = value
        for steering, angle in zip(self._steerings, angles, strict=True):
            steering.command = angle

    def _steer(self, command: SteeringCommand, period_s: float) -> list[float]:
        """Returns the steering angles, which do not depend on the speed [rad]."""
        front, rear = (
            clamp(angle, -math.pi / 2.0, math.pi / 2.0) for angle in (command.front_angle, command.rear_angle)
        )
        speed = self._limits.limit_linear(command.speed, period_s)
        self._twist = self.geometry.twist_of_axles(speed, front, rear)
        self._limits.last = BaseVelocity(speed, self._twist.angular)
        return self.geometry.wheels(self.geometry.twist_of_axles(1.0, front, rear))[0]

    def _brake(self) -> None:
        for wheel in self._wheels:
            wheel.command = 0.0
        for steering in self._steerings:
            if math.isfinite(steering.position):
                steering.command = steering.position


def _joints(controller_nh: NodeHandle, keys: list[str]) -> list[str]:
    """Returns the two joints of each parameter."""
    found = []
    for key in keys:
        names = read_names(controller_nh, key)
        if len(names) != 2:
            raise ParameterError(
                f"parameter {join_names(controller_nh.namespace, key)}: got {names}; expected two "
                "joints, left and right"
            )
        found += names
    return found


def _read_geometry(
    root_nh: NodeHandle, controller_nh: NodeHandle, wheels: list[str], steerings: list[str]
) -> FourWheelGeometry:
    def value_of(key: str, from_urdf: Callable[[WheelGeometry], float]) -> float:
        if controller_nh.has_param(key):
            return read_number(controller_nh, key, 0.0)
        return from_urdf(WheelGeometry(root_nh, key))

    geometry = FourWheelGeometry(
        value_of("track", lambda urdf: urdf.distance(wheels[0], wheels[1])),
        value_of("wheel_base", lambda urdf: urdf.distance(wheels[0], wheels[2])),
        value_of("wheel_radius", lambda urdf: urdf.radius(wheels[0])),
        value_of("wheel_steering_y_offset", lambda urdf: urdf.distance(steerings[0], wheels[0])),
    )
    if (
        min(geometry.track, geometry.wheel_base, geometry.wheel_radius) <= 0.0
        or geometry.track <= 2.0 * geometry.steering_offset
    ):
        raise ParameterError(
            f"parameters {join_names(controller_nh.namespace, '')}: the wheels are at {geometry}; "
            "expected track, wheel_base and wheel_radius above 0, and wheel_steering_y_offset below "
            "half the track; set them, or correct robot_description"
        )
    return geometry
