# SPDX-License-Identifier: BSD-3-Clause
"""Base class for controllers of mobile bases: command timeout, limits and odometry."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from modular_framework_control.controller_interface.controller import Controller, ControllerError
from modular_framework_control.mobile_base.planar_odometry import PlanarOdometry
from modular_framework_control.mobile_base.speed_limiter import SpeedLimiter, read_speed_limiter
from modular_framework_control.realtime.schedule import Schedule
from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names, read_bool, read_number

Diagonal = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class BaseVelocity:
    """Velocity of a base, in the base frame.

    Attributes:
        linear: Velocity along x [m/s].
        angular: Angular velocity about z [rad/s].
    """

    linear: float = 0.0
    angular: float = 0.0

    @property
    def finite(self) -> bool:
        """Whether all values are finite."""
        return math.isfinite(self.linear) and math.isfinite(self.angular)


AT_REST = BaseVelocity()


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometrySnapshot:
    """Pose and velocity of the base.

    Attributes:
        time_s: Time of the cycle.
        x: Position in the odometry frame [m].
        y: Position in the odometry frame [m].
        heading: Heading in the odometry frame [rad].
        linear: Velocity along the base's x axis [m/s].
        lateral: Velocity along the base's y axis [m/s].
        angular: Angular velocity about the z axis [rad/s].
        with_tf: Whether the transform of the base is published.
    """

    time_s: float
    x: float
    y: float
    heading: float
    linear: float
    lateral: float
    angular: float
    with_tf: bool


@dataclass(frozen=True)
class BaseSettings:
    """Settings that can be replaced while the controller runs.

    Attributes:
        publish_rate: Publish rate of the odometry [1/s]; 0 disables publishing.
        enable_odom_tf: Whether the transform of the base is published.
    """

    publish_rate: float = 50.0
    enable_odom_tf: bool = True


@dataclass(frozen=True, slots=True)
class BaseFrames:
    """Constant parts of the odometry message.

    Attributes:
        odom: Odometry frame.
        base: Base frame.
        pose_covariance: Variances of x, y, z [m^2], roll, pitch, yaw [rad^2].
        twist_covariance: Variances of the corresponding velocities.
    """

    odom: str
    base: str
    pose_covariance: Diagonal
    twist_covariance: Diagonal


class MobileBaseController(Controller, ABC):
    """Base class for controllers of wheeled bases.

    Parameters, below the controller's name: `publish_rate` [1/s] 50; `open_loop` false, odometry from commands instead
    of measurements; `cmd_vel_timeout` [s] 0.5, maximum age of a command; `allow_multiple_cmd_vel_publishers` true;
    `velocity_rolling_window_size` 10; `base_frame_id` base_link, `odom_frame_id` odom, `enable_odom_tf` true;
    `pose_covariance_diagonal` and `twist_covariance_diagonal`, six numbers each, required; `linear/x` and `angular/z`,
    limits, see `read_speed_limiter`.

    Attributes:
        settings: Settings that any thread may replace at runtime.
        frames: Constant parts of the odometry message.
        allows_several_publishers: Whether commands may come from several publishers.
        odometry: Odometry of the base.
        on_odometry: Function called in the control loop at `publish_rate`; must not block.
    """

    def __init__(self) -> None:
        self.settings = BaseSettings()
        self.on_odometry: Callable[[OdometrySnapshot], None] | None = None
        self._latest: Any = None
        self._latest_seen: Any = None
        self._seen_s = -math.inf
        self._schedule: Schedule | None = None
        self._refusal = "the controller is not running; start it first"

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        self.settings = self._read_settings(controller_nh)
        self.frames = BaseFrames(
            read_name(controller_nh, "odom_frame_id", "odom", "frame"),
            read_name(controller_nh, "base_frame_id", "base_link", "frame"),
            _diagonal(controller_nh, "pose_covariance_diagonal"),
            _diagonal(controller_nh, "twist_covariance_diagonal"),
        )
        self._open_loop = read_bool(controller_nh, "open_loop", False)
        self._timeout_s = read_number(controller_nh, "cmd_vel_timeout", 0.5)
        self.allows_several_publishers = read_bool(controller_nh, "allow_multiple_cmd_vel_publishers", True)
        self._linear_limits = read_speed_limiter(controller_nh.child("linear/x"))
        self._angular_limits = read_speed_limiter(controller_nh.child("angular/z"))
        window = read_number(controller_nh, "velocity_rolling_window_size", 10, 1)
        self.odometry = PlanarOdometry(int(window))
        return True

    def _read_settings(self, controller_nh: NodeHandle) -> BaseSettings:
        return BaseSettings(
            read_number(controller_nh, "publish_rate", 50.0), read_bool(controller_nh, "enable_odom_tf", True)
        )

    # ---- any thread ----

    def submit(self, command: Any) -> None:
        """Submits a command, which is active from the next cycle until the timeout.

        Args:
            command: Command with a property `finite`; the class depends on the controller.

        Raises:
            ControllerError: The command is not finite, the controller is stopped, or the hardware has a fault.
        """
        if self._refusal:
            raise ControllerError(self._refusal)
        if not command.finite:
            raise ControllerError(f"got {command}; expected finite numbers")
        self._latest = command

    def drop_command(self) -> None:
        """Drops the active command, so that the base comes to rest within its limits."""
        self._latest = None

    # ---- control loop ----

    def starting(self, time_s: float) -> None:
        self._brake()
        self._clear_commands()
        self._schedule = None  # created in the first cycle
        self.odometry.start(time_s)
        self._refusal = ""

    def stopping(self, time_s: float) -> None:
        self._refusal = "the controller is not running; start it first"
        self._brake()
        self._clear_commands()

    def on_hardware_fault(self, time_s: float, reason: str) -> None:
        self._refusal = f"hardware fault: {reason}"
        self._brake()
        self._clear_commands()

    def on_hardware_recovered(self, time_s: float) -> None:
        self._clear_commands()  # a command may have arrived together with the fault
        self._refusal = ""

    def update(self, time_s: float, period_s: float) -> None:
        is_measured = self._follow_wheels(time_s)
        self._report(time_s)
        if self._refusal:
            self._brake()
        else:
            command = self._active_command(time_s)
            self._drive(command if is_measured else None, time_s, period_s)

    def _report(self, time_s: float) -> bool:
        """Publishes the odometry if a message is due; returns whether a message was due."""
        settings, pose = self.settings, self.odometry
        if self._schedule is None or settings.publish_rate != self._schedule.rate:
            self._schedule = Schedule(settings.publish_rate)
            self._schedule.start(time_s)
        if self.on_odometry is None or not self._schedule.take_if_due(time_s):
            return False
        self.on_odometry(
            OdometrySnapshot(
                time_s=time_s,
                x=pose.x,
                y=pose.y,
                heading=pose.heading,
                linear=pose.linear,
                lateral=pose.lateral,
                angular=pose.angular,
                with_tf=settings.enable_odom_tf,
            )
        )
        return True

    def _active_command(self, time_s: float) -> Any:
        """Returns the last command, or None after the timeout."""
        command = self._latest
        if command is not self._latest_seen:
            self._latest_seen, self._seen_s = command, time_s
        return None if time_s - self._seen_s > self._timeout_s else command

    def _clear_commands(self) -> None:
        """Clears all commands, including previous commands for acceleration limits."""
        self._latest = self._latest_seen = None

    @abstractmethod
    def _follow_wheels(self, time_s: float) -> bool:
        """Updates the odometry; returns whether all measurements are valid."""

    @abstractmethod
    def _drive(self, command: Any, time_s: float, period_s: float) -> None:
        """Commands the joints for a command to the base; without a command, the base comes to rest within its limits.

        Args:
            command: Active command, or None.
            time_s: Time of the cycle.
            period_s: Time since the last cycle.
        """

    @abstractmethod
    def _brake(self) -> None:
        """Commands the joints to stop at once."""


class TwistLimits:
    """Limits of linear and angular velocity of a base, with previous commands for acceleration limits.

    Args:
        linear: Limits along x.
        angular: Limits about z.

    Attributes:
        last: Velocity commanded in the last cycle.
    """

    def __init__(self, linear: SpeedLimiter, angular: SpeedLimiter) -> None:
        self._linear, self._angular = linear, angular
        self.clear()

    def clear(self) -> None:
        """Resets the previous commands to rest."""
        self.last = self._before_last = AT_REST

    def limit(self, requested: BaseVelocity, period_s: float) -> BaseVelocity:
        """Returns the limited velocity for this cycle, `period_s` after the last cycle."""
        last, before = self.last, self._before_last
        self._before_last = last
        self.last = BaseVelocity(
            self._linear.limit(requested.linear, last.linear, before.linear, period_s),
            self._angular.limit(requested.angular, last.angular, before.angular, period_s),
        )
        return self.last

    def limit_linear(self, requested: float, period_s: float) -> float:
        """Returns the limited linear velocity for this cycle, without limits on the rotation."""
        last = self.last
        value = self._linear.limit(requested, last.linear, self._before_last.linear, period_s)
        self.last, self._before_last = BaseVelocity(value, last.angular), last
        return value


def read_positive(handle: NodeHandle, key: str, default: float) -> float:
    """Reads a positive number parameter.

    Args:
        handle: Namespace of the parameter.
        key: Name of the parameter.
        default: Value of an unset parameter.

    Raises:
        ParameterError: The value is not a positive number.
    """
    value = read_number(handle, key, default)
    if value <= 0.0:
        raise ParameterError(f"parameter {join_names(handle.namespace, key)}: got {value!r}; expected a number above 0")
    return value


def read_name(handle: NodeHandle, key: str, default: str, noun: str) -> str:
    """Reads a parameter with a name.

    Args:
        handle: Namespace of the parameter.
        key: Name of the parameter.
        default: Value of an unset parameter.
        noun: Kind of named object, for the error message.

    Raises:
        ParameterError: The value is not a string or is empty.
    """
    value = handle.get_param(key, default)
    if not isinstance(value, str) or not value:
        raise ParameterError(f"parameter {join_names(handle.namespace, key)}: got {value!r}; expected a {noun}'s name")
    return value


def _diagonal(handle: NodeHandle, key: str) -> Diagonal:
    values = handle.get_param(key)
    if (
        not isinstance(values, (list, tuple))
        or len(values) != 6
        or any(isinstance(v, bool) or not isinstance(v, (int, float)) or not math.isfinite(v) for v in values)
    ):
        raise ParameterError(
            f"parameter {join_names(handle.namespace, key)}: got {values!r}; expected six "
            "numbers: the variances along x, y, z and about x, y, z"
        )
    x, y, z, roll, pitch, yaw = map(float, values)
    return x, y, z, roll, pitch, yaw
