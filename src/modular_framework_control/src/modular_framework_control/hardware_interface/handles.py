# SPDX-License-Identifier: BSD-3-Clause
"""Handles, the plain objects that hardware and controllers share, one per joint, sensor or speed scaling.

The `RobotHW` creates each handle once; hardware and controllers then read and write its attributes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from modular_framework_control.hardware_interface.joint_limit_parameters import JointLimits

Vector = tuple[float, float, float]


class JointStateHandle:
    """Measured state of one joint, written only by `RobotHW.read()`.

    Attributes:
        name: Joint name as in the robot description.
        position: Position [rad|m]; NaN until measured.
        velocity: Velocity [rad/s|m/s].
        effort: Effort [Nm|N].
        stale: Whether these values are older than a few device cycles; controllers then do not evaluate goals.
    """

    __slots__ = ("name", "position", "velocity", "effort", "stale")

    def __init__(self, name: str, position: float = math.nan, velocity: float = 0.0, effort: float = 0.0) -> None:
        self.name = name
        self.position = position
        self.velocity = velocity
        self.effort = effort
        self.stale = False

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, position={self.position:.6g})"


class JointHandle:
    """A joint that can be commanded, with its measured state and one command.

    Attributes:
        state: Handle in the JointStateInterface (shared, not copied).
        command: Position [rad|m], velocity [rad/s|m/s] or effort [Nm|N], depending on the interface; NaN until the
            control loop (`RobotHW.seed_commands`) or a controller sets a command.
        max_effort: Maximum effort for following the command [Nm|N], 0 for the hardware's default; only used by hardware
            with `supports_max_effort`.
        supports_max_effort: Whether the hardware can bound the effort of this joint.
        limits: Limits that the limiter enforces; None if no limits are enforced.
        held: Flag set by `hold`; the limiter continues from the held command and clears the flag.
    """

    __slots__ = ("state", "command", "max_effort", "supports_max_effort", "limits", "held")

    def __init__(self, state: JointStateHandle, command: float = math.nan, supports_max_effort: bool = False) -> None:
        self.state = state
        self.command = command
        self.max_effort = 0.0
        self.supports_max_effort = supports_max_effort
        self.limits: JointLimits | None = None
        self.held = False

    @property
    def name(self) -> str:
        return self.state.name

    @property
    def position(self) -> float:
        return self.state.position

    @property
    def velocity(self) -> float:
        return self.state.velocity

    @property
    def effort(self) -> float:
        return self.state.effort

    def hold(self, position: float) -> None:
        """Commands a position-controlled joint to stop at its current position, regardless of the last command.

        Args:
            position: Measured position [rad|m]; for a continuous joint, within the revolution of its last command. If
                the position is not a number, the last command stays.
        """
        if math.isfinite(position):
            self.command = position
            self.held = True

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, command={self.command:.6g})"


def measurement_fault(handles: Iterable[JointHandle]) -> str:
    """Returns a description of joints whose measured positions are not finite, or ""."""
    faults = [
        f"joint '{handle.name}' is measured at {handle.position}"
        for handle in handles
        if not math.isfinite(handle.position)
    ]
    return f"{', '.join(faults)}; expected a position: check the hardware's measurements" if faults else ""


class PosVelJointHandle(JointHandle):
    """A joint that takes a position with a velocity.

    Attributes:
        command_velocity: Commanded velocity at the position in `command` [rad/s|m/s].
    """

    __slots__ = ("command_velocity",)

    def __init__(self, state: JointStateHandle, command: float = math.nan, supports_max_effort: bool = False) -> None:
        super().__init__(state, command, supports_max_effort)
        self.command_velocity = 0.0


class PosVelAccJointHandle(PosVelJointHandle):
    """A joint that takes a position with a velocity and an acceleration.

    Attributes:
        command_acceleration: Commanded acceleration at the position in `command` [rad/s^2|m/s^2].
    """

    __slots__ = ("command_acceleration",)

    def __init__(self, state: JointStateHandle, command: float = math.nan, supports_max_effort: bool = False) -> None:
        super().__init__(state, command, supports_max_effort)
        self.command_acceleration = 0.0


class ActuatorHandle:
    """One actuator of a transmission, see `RobotTransmissions`.

    `RobotHW.read()` writes the measured values. Commands are computed from the commands of the joints, and are NaN if a
    joint has no command.

    Attributes:
        name: Name as in the <transmission> of the robot description.
        position: Measured position [rad|m]; NaN until measured; joint positions are NaN as well until then.
        velocity: Measured velocity [rad/s|m/s].
        effort: Measured effort [Nm|N].
        command_position: Commanded position [rad|m].
        command_velocity: Commanded velocity [rad/s|m/s].
        command_effort: Commanded effort [Nm|N].
    """

    __slots__ = ("name", "position", "velocity", "effort", "command_position", "command_velocity", "command_effort")

    def __init__(self, name: str) -> None:
        self.name = name
        self.position = math.nan
        self.velocity = self.effort = 0.0
        self.command_position = self.command_velocity = self.command_effort = math.nan

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, position={self.position:.6g})"


class SpeedScalingHandle:
    """Speed scaling of a robot, the value of its speed slider and 0 while the robot is paused or stopped.

    Attributes:
        name: Name of the handle, "speed_scaling_factor" for a single robot.
        joints: Scaled joints.
        factor: Fraction of the planned speed, 0 to 1, written by `RobotHW.read()`.
    """

    __slots__ = ("name", "joints", "factor")

    def __init__(self, name: str, joints: Sequence[str], factor: float = 1.0) -> None:
        self.name = name
        self.joints = tuple(joints)
        self.factor = factor


class ForceTorqueSensorHandle:
    """Measurement of a force-torque sensor.

    Attributes:
        name: Name of the sensor and of its topic.
        frame_id: Frame of force and torque.
        force: Force x, y, z [N]; `RobotHW.read()` assigns a new tuple, so that readers never see mixed values.
        torque: Torque x, y, z [Nm], assigned in the same way.
    """

    __slots__ = ("name", "frame_id", "force", "torque")

    def __init__(self, name: str, frame_id: str) -> None:
        self.name = name
        self.frame_id = frame_id
        self.force: Vector = (0.0, 0.0, 0.0)
        self.torque: Vector = (0.0, 0.0, 0.0)


class ImuSensorHandle:
    """Measurement of an inertial measurement unit.

    Attributes:
        name: Name of the sensor and of its topic.
        frame_id: Frame of all quantities.
        orientation: Quaternion xyzw.
        angular_velocity: Angular velocity x, y, z [rad/s].
        linear_acceleration: Linear acceleration x, y, z [m/s^2].
        orientation_covariance, angular_velocity_covariance, linear_acceleration_covariance: 3x3 matrices, row-major;
            all elements 0 if unknown, first element -1 if the quantity is not measured.
    """

    __slots__ = (
        "name",
        "frame_id",
        "orientation",
        "angular_velocity",
        "linear_acceleration",
        "orientation_covariance",
        "angular_velocity_covariance",
        "linear_acceleration_covariance",
    )

    def __init__(self, name: str, frame_id: str) -> None:
        self.name = name
        self.frame_id = frame_id
        self.orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
        self.angular_velocity: Vector = (0.0, 0.0, 0.0)
        self.linear_acceleration: Vector = (0.0, 0.0, 0.0)
        self.orientation_covariance = self.angular_velocity_covariance = self.linear_acceleration_covariance = (
            0.0,
        ) * 9
