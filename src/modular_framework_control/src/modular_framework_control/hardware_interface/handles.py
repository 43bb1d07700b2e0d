# SPDX-License-Identifier: BSD-3-Clause
"""Handles: plain objects that hardware and controllers share, one per joint, sensor or speed scaling.

The `RobotHW` makes each handle once and keeps it; reading and writing it is reading and writing attributes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from modular_framework_control.hardware_interface.joint_limit_parameters import JointLimits

Vector = tuple[float, float, float]


class JointStateHandle:
    """Measured state of one joint; the `RobotHW` writes it in `read()`, all others only read it.

    Attributes:
        name: joint name as in the robot description.
        position: [rad] or [m]; not a number until it is measured.
        velocity: [rad/s] or [m/s].
        effort: [Nm] or [N].
        stale: whether these values are older than a few cycles of the device; controllers judge no goal by them.
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
    """A joint that can be commanded: the measured state seen through `state`, and one command beside it.

    Attributes:
        state: the handle registered with the JointStateInterface (shared, not copied).
        command: in the unit of the interface: position [rad|m], velocity [rad/s|m/s] or effort [Nm|N]; not a number
            until the control loop or a controller commands something (`RobotHW.seed_commands`).
        max_effort: upper bound of the effort used to follow the command [Nm|N]; 0 means the hardware's default.
            Only hardware with `supports_max_effort` uses it.
        supports_max_effort: set by the RobotHW when it can bound the effort of this joint.
        limits: enforced for this joint, set by the limiter; None: none are enforced.
        held: set by `hold`; the limiter continues from that command, and clears it.
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
        """Commands a position-controlled joint to stop at its present position, whatever the last command was.

        Args:
            position: the measured one [rad|m]; of a continuous joint, in the turn of its last command. If it is not a
                number, the last command stays.
        """
        if math.isfinite(position):
            self.command = position
            self.held = True

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, command={self.command:.6g})"


def unmeasured(handles: Iterable[JointHandle]) -> str:
    """Names the joints whose measured position is not a finite number; "" if there are none."""
    faults = [
        f"joint '{handle.name}' is measured at {handle.position}"
        for handle in handles
        if not math.isfinite(handle.position)
    ]
    return f"{', '.join(faults)}; expected a position: see why the hardware reads none" if faults else ""


class PosVelJointHandle(JointHandle):
    """A joint that takes a position with the velocity there.

    Attributes:
        command_velocity: [rad/s|m/s], beside the position in `command`.
    """

    __slots__ = ("command_velocity",)

    def __init__(self, state: JointStateHandle, command: float = math.nan, supports_max_effort: bool = False) -> None:
        super().__init__(state, command, supports_max_effort)
        self.command_velocity = 0.0


class PosVelAccJointHandle(PosVelJointHandle):
    """A joint that takes a position with the velocity and the acceleration there.

    Attributes:
        command_acceleration: [rad/s^2|m/s^2].
    """

    __slots__ = ("command_acceleration",)

    def __init__(self, state: JointStateHandle, command: float = math.nan, supports_max_effort: bool = False) -> None:
        super().__init__(state, command, supports_max_effort)
        self.command_acceleration = 0.0


class ActuatorHandle:
    """One actuator, beyond the transmission that moves a joint; see `RobotTransmissions`.

    Attributes:
        name: as in the <transmission> of the robot description.
        position: measured [rad] or [m]; the `RobotHW` writes it in `read()`, as velocity and effort.
        velocity: measured [rad/s] or [m/s].
        effort: measured [Nm] or [N].
        command_position: computed from the position commands of the joints [rad] or [m]; NaN while there is none.
        command_velocity: likewise of velocity commands [rad/s] or [m/s].
        command_effort: likewise of effort commands [Nm] or [N].
    """

    __slots__ = ("name", "position", "velocity", "effort", "command_position", "command_velocity", "command_effort")

    def __init__(self, name: str) -> None:
        self.name = name
        self.position = self.velocity = self.effort = 0.0
        self.command_position = self.command_velocity = self.command_effort = math.nan

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, position={self.position:.6g})"


class SpeedScalingHandle:
    """Speed scaling of a robot: the value of its speed slider, 0 while it is paused or stopped.

    Attributes:
        name: of the handle, "speed_scaling_factor" for one robot.
        joints: the joints it is about.
        factor: share of the planned speed, 0 to 1; the `RobotHW` writes it in `read()`.
    """

    __slots__ = ("name", "joints", "factor")

    def __init__(self, name: str, joints: Sequence[str], factor: float = 1.0) -> None:
        self.name = name
        self.joints = tuple(joints)
        self.factor = factor


class ForceTorqueSensorHandle:
    """Measurement of a force-torque sensor.

    Attributes:
        name: of the sensor; it is also the name of its topic.
        frame_id: frame in which force and torque are given.
        force: x, y, z [N]; the `RobotHW` assigns a new array in `read()`, so that readers never see a mix.
        torque: x, y, z [Nm]; likewise.
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
        name: of the sensor; it is also the name of its topic.
        frame_id: frame in which everything is given.
        orientation: quaternion xyzw.
        angular_velocity: x, y, z [rad/s].
        linear_acceleration: x, y, z [m/s^2].
        orientation_covariance, angular_velocity_covariance, linear_acceleration_covariance: 9 numbers, row by row; all
            0 when they are not known, the first -1 when the quantity is not measured.
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
