# SPDX-License-Identifier: BSD-3-Clause
"""Controller for a car-like base with a driven rear wheel and a steered front wheel on the centre line."""

from __future__ import annotations

import math
from typing import Any

from modular_framework_control.hardware_interface.interfaces import PositionJointInterface, VelocityJointInterface
from modular_framework_control.mobile_base.mobile_base_controller import (
    AT_REST,
    BaseVelocity,
    MobileBaseController,
    TwistLimits,
    read_name,
    read_positive,
)
from modular_framework_control.mobile_base.wheel_geometry import WheelGeometry
from modular_framework_ros.node_handle import NodeHandle, ParameterError


class AckermannSteeringController(MobileBaseController):
    """ackermann_steering_controller/AckermannSteeringController.

    As in ros_controllers, a command is a `BaseVelocity` whose `angular` is the steering angle [rad]; limits below
    `angular/z` apply to this angle.

    Parameters, in addition to MobileBaseController: the joints `rear_wheel` rear_wheel_joint and `front_steer`
    front_steer_joint; `wheel_separation_h`, the distance between the axles, and `wheel_radius` [m], by default from the
    robot description (the radius from a cylinder only); `wheel_separation_h_multiplier`, `wheel_radius_multiplier`,
    `steer_pos_multiplier` 1.

    While a joint position is not a number, the odometry stops and the base comes to rest.
    """

    interface_class = VelocityJointInterface

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        super().init(hw, root_nh, controller_nh)
        wheel = read_name(controller_nh, "rear_wheel", "rear_wheel_joint", "joint")
        steer = read_name(controller_nh, "front_steer", "front_steer_joint", "joint")
        base = (
            read_positive(controller_nh, "wheel_separation_h", 1.0)
            if controller_nh.has_param("wheel_separation_h")
            else _wheel_base_of(WheelGeometry(root_nh, "wheel_separation_h"), wheel, steer)
        )
        radius = (
            read_positive(controller_nh, "wheel_radius", 1.0)
            if controller_nh.has_param("wheel_radius")
            else WheelGeometry(root_nh, "wheel_radius").radius(wheel, ("cylinder",))
        )
        self._wheel_base = base * read_positive(controller_nh, "wheel_separation_h_multiplier", 1.0)
        self._radius = radius * read_positive(controller_nh, "wheel_radius_multiplier", 1.0)
        self._steer_factor = read_positive(controller_nh, "steer_pos_multiplier", 1.0)
        self._wheel = hw.get_handle(wheel)
        self._steer = self.robot_hw.get(PositionJointInterface).get_handle(steer)
        self._limits = TwistLimits(self._linear_limits, self._angular_limits)
        return True

    def starting(self, time_s: float) -> None:
        super().starting(time_s)
        self._last_position = self._wheel.position

    def _clear_commands(self) -> None:
        super()._clear_commands()
        self._limits.clear()

    def _follow_wheels(self, time_s: float) -> bool:
        if self._open_loop:
            commanded = self._limits.last
            self.odometry.move_at(commanded.linear, 0.0, commanded.linear * self._curvature(commanded.angular), time_s)
            return True
        position, angle = self._wheel.position, self._steer.position
        if not (math.isfinite(position) and math.isfinite(angle)):
            return False
        if math.isfinite(self._last_position):
            distance = (position - self._last_position) * self._radius
            self.odometry.move(distance, distance * self._curvature(angle), time_s)
        self._last_position = position
        return True

    def _curvature(self, angle: float) -> float:
        """Returns the path curvature of the rear axle's centre [1/m]."""
        return math.tan(angle * self._steer_factor) / self._wheel_base

    def _drive(self, command: Any, time_s: float, period_s: float) -> None:
        requested: BaseVelocity = AT_REST if command is None else command
        limited = self._limits.limit(requested, period_s)
        self._wheel.command = limited.linear / self._radius
        self._steer.command = limited.angular

    def _brake(self) -> None:
        self._wheel.command = 0.0
        if math.isfinite(self._steer.position):
            self._steer.command = self._steer.position


def _wheel_base_of(geometry: WheelGeometry, wheel: str, steer: str) -> float:
    base = abs(float(geometry.between(wheel, steer)[0]))
    if base <= 0.0:
        raise ParameterError(
            f"robot_description: joint '{steer}' is not ahead of joint '{wheel}'; expected a distance "
            "between the axles; set wheel_separation_h, or correct the description"
        )
    return base
