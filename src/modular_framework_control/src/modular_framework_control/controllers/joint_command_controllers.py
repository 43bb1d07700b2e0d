# SPDX-License-Identifier: BSD-3-Clause
"""Controllers that follow position, velocity or effort commands for one or several joints from a topic.

Commands are forwarded if the hardware takes the commanded quantity; otherwise a PID computes the hardware's quantity.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from modular_framework_control.controller_interface.controller import Controller, ControllerError
from modular_framework_control.controller_interface.pid import PidGains, read_pid
from modular_framework_control.hardware_interface.handles import JointHandle
from modular_framework_control.hardware_interface.interfaces import (
    EffortJointInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from modular_framework_control.hardware_interface.joint_limits import limits_of
from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names, read_names

CYCLES_PER_REPORT = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class JointControlSnapshot:
    """State of a PID controller of one joint in one cycle.

    Attributes:
        time_s: Time of the cycle.
        period_s: Time since the previous cycle.
        set_point: Commanded value.
        process_value: Measured value.
        process_value_dot: Derivative of the measured value; 0 if not measured.
        error: Input of the PID.
        command: Command to the joint.
        gains: Gains of the PID.
    """

    time_s: float
    period_s: float
    set_point: float
    process_value: float
    process_value_dot: float
    error: float
    command: float
    gains: PidGains


class JointCommandController(Controller):
    """Base class of command controllers; a submitted command applies to all joints from the next cycle on.

    During a hardware fault, the joints are held, and commands are refused with the fault's reason. When the controller
    stops, the joints come to rest.

    Parameters, below the controller's name: `joints`, or `joint` for controllers of one joint.

    Attributes:
        single: Whether the controller has one joint, and the topic `command` one number.
        joint_names: Joints, in the order of the values of a command.
    """

    single = True

    def __init__(self) -> None:
        self.joint_names: list[str] = []
        self._handles: list[JointHandle] = []
        self._set_points: tuple[float, ...] = ()
        self._fault = ""

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        key = "joint" if self.single else "joints"
        self.joint_names = read_names(controller_nh, key)
        if self.single and len(self.joint_names) != 1:
            raise ParameterError(
                f"parameter {join_names(controller_nh.namespace, key)}: got {self.joint_names!r}; "
                "expected the name of one joint"
            )
        self._handles = [hw.get_handle(name) for name in self.joint_names]
        return True

    def submit(self, values: Sequence[float]) -> None:
        """Submits a command, from any thread.

        Args:
            values: Command per joint, in the unit of the controlled quantity.

        Raises:
            ControllerError: A value is missing or not finite, or the hardware has a fault; the last command stays.
        """
        if self._fault:
            raise ControllerError(self._fault)
        if len(values) != len(self.joint_names) or not all(map(math.isfinite, values)):
            raise ControllerError(
                f"got {list(values)!r}; expected {len(self.joint_names)} finite numbers, for: "
                f"{', '.join(self.joint_names)}"
            )
        self._set_points = tuple(values)

    def starting(self, time_s: float) -> None:
        self._fault = ""
        self._hold_joints()

    def stopping(self, time_s: float) -> None:
        self._hold_joints()

    def on_hardware_fault(self, time_s: float, reason: str) -> None:
        self._fault = f"hardware fault: {reason}"

    def on_hardware_recovered(self, time_s: float) -> None:
        self._hold_joints()
        self._fault = ""

    def update(self, time_s: float, period_s: float) -> None:
        if self._fault:
            self._hold_joints()
        else:
            self._command(self._set_points, period_s)

    def _hold_joints(self) -> None:
        """Holds the joints, also when another thread submits a command at the same time."""
        rest_command = self._rest_command()
        self._set_points = rest_command
        self._command(rest_command, 0.0)

    def _rest_command(self) -> tuple[float, ...]:
        """Returns the command that holds the joints."""
        return (0.0,) * len(self._handles)

    def _command(self, set_points: tuple[float, ...], period_s: float) -> None:
        """Commands the joints; `period_s` is the time since the last call, 0 at a start."""
        for handle, value in zip(self._handles, set_points, strict=True):
            handle.command = value


class PositionJointPositionController(JointCommandController):
    """position_controllers/JointPositionController, position commands [rad|m] for position-controlled joints."""

    interface_class = PositionJointInterface

    def _hold_joints(self) -> None:
        super()._hold_joints()
        for handle in self._handles:
            handle.hold(handle.position)

    def _rest_command(self) -> tuple[float, ...]:
        return tuple(handle.position if math.isfinite(handle.position) else handle.command for handle in self._handles)


class PositionJointGroupPositionController(PositionJointPositionController):
    """position_controllers/JointGroupPositionController."""

    single = False


class VelocityJointVelocityController(JointCommandController):
    """velocity_controllers/JointVelocityController, velocity commands [rad/s|m/s] for velocity-controlled joints."""

    interface_class = VelocityJointInterface


class VelocityJointGroupVelocityController(VelocityJointVelocityController):
    """velocity_controllers/JointGroupVelocityController."""

    single = False


class EffortJointEffortController(JointCommandController):
    """effort_controllers/JointEffortController, effort commands [Nm|N] for effort-controlled joints."""

    interface_class = EffortJointInterface


class EffortJointGroupEffortController(EffortJointEffortController):
    """effort_controllers/JointGroupEffortController."""

    single = False


class GainsController(JointCommandController):
    """Base class of controllers with a PID per joint, which command 0 when they stop.

    Additional parameters: `pid/{p, i, d, i_clamp, ...}` for one joint, `<joint>/pid/...` for each of several joints.

    Attributes:
        on_state: Function called in the control loop every CYCLES_PER_REPORT cycles by controllers of one joint; must
            not block.
    """

    def __init__(self) -> None:
        super().__init__()
        self.on_state: Callable[[JointControlSnapshot], None] | None = None
        self._error = 0.0
        self._cycles = 0

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        super().init(hw, root_nh, controller_nh)
        namespaces = ["pid"] if self.single else [f"{name}/pid" for name in self.joint_names]
        self.pids = {name: read_pid(controller_nh.child(name)) for name in namespaces}
        self._pids = list(self.pids.values())
        return True

    def update(self, time_s: float, period_s: float) -> None:
        super().update(time_s, period_s)
        self._cycles += 1
        if self.single and self.on_state is not None and self._cycles % CYCLES_PER_REPORT == 0:
            value, rate = self._measured_quantity()
            self.on_state(
                JointControlSnapshot(
                    time_s=time_s,
                    period_s=period_s,
                    set_point=self._set_points[0],
                    process_value=value,
                    process_value_dot=rate,
                    error=self._error,
                    command=self._handles[0].command,
                    gains=self._pids[0].gains,
                )
            )

    def stopping(self, time_s: float) -> None:
        for handle in self._handles:
            handle.command = 0.0

    def _measured_quantity(self) -> tuple[float, float]:
        """Returns the controlled quantity of the first joint and its derivative."""
        return self._handles[0].position, self._handles[0].velocity

    def _hold_joints(self) -> None:
        for pid in self._pids:
            pid.reset()
        super()._hold_joints()


class _PidPositionController(GainsController):
    """Position commands [rad|m], bounded by the known limits, for joints that are not position-controlled."""

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        super().init(hw, root_nh, controller_nh)
        self._limits = limits_of(self._handles, root_nh)
        return True

    def _rest_command(self) -> tuple[float, ...]:
        return tuple(handle.position for handle in self._handles)

    def _command(self, set_points: tuple[float, ...], period_s: float) -> None:
        for handle, value, limits, pid in zip(self._handles, set_points, self._limits, self._pids, strict=True):
            if limits.continuous:
                error = math.remainder(value - handle.position, 2.0 * math.pi)
            else:
                error = min(max(value, limits.min_position), limits.max_position) - handle.position
            self._error = error
            handle.command = pid.command(error, -handle.velocity, period_s)


class VelocityJointPositionController(_PidPositionController):
    """velocity_controllers/JointPositionController, position commands for a velocity-controlled joint."""

    interface_class = VelocityJointInterface


class EffortJointPositionController(_PidPositionController):
    """effort_controllers/JointPositionController, position commands for an effort-controlled joint."""

    interface_class = EffortJointInterface


class EffortJointGroupPositionController(EffortJointPositionController):
    """effort_controllers/JointGroupPositionController."""

    single = False


class EffortJointVelocityController(GainsController):
    """effort_controllers/JointVelocityController, velocity commands [rad/s|m/s] for an effort-controlled joint."""

    interface_class = EffortJointInterface

    def __init__(self) -> None:
        super().__init__()
        self._last_error = math.nan

    def _measured_quantity(self) -> tuple[float, float]:
        return self._handles[0].velocity, 0.0

    def _hold_joints(self) -> None:
        self._last_error = math.nan
        super()._hold_joints()

    def _command(self, set_points: tuple[float, ...], period_s: float) -> None:
        error = set_points[0] - self._handles[0].velocity
        has_rate = period_s > 0.0 and math.isfinite(self._last_error)
        rate = (error - self._last_error) / period_s if has_rate else 0.0
        self._last_error = self._error = error
        self._handles[0].command = self._pids[0].command(error, rate, period_s)
