# SPDX-License-Identifier: BSD-3-Clause
"""An arm of Universal Robots as a `RobotHW`: joints commanded by position, over RTDE."""
from __future__ import annotations

import logging
import math
import time

from modular_framework_control.hardware_interface import (
    ForceTorqueSensorHandle,
    ForceTorqueSensorInterface,
    JointHandle,
    JointStateHandle,
    JointStateInterface,
    PositionJointInterface,
    SpeedScalingHandle,
    SpeedScalingInterface,
)
from modular_framework_control.joint_limits import JointLimits, limits_from_urdf, limits_with_parameters
from modular_framework_control.node_handle import NodeHandle, ParameterError, join_names, read_number
from modular_framework_control.robot_hw import RobotHW
from modular_framework_drivers.ur.arm_messages import ArmState
from modular_framework_drivers.ur.command_check import CommandCheck, MotionLimits
from modular_framework_drivers.ur.rtde_link import LinkSettings, RtdeLink

LOGGER = logging.getLogger("rosout.ur_arm")
JOINT_NAMES = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint",
               "wrist_3_joint")
UR_LIMITS = JointLimits(-2.0 * math.pi, 2.0 * math.pi, math.pi)
MAX_ACCELERATION = 40.0           # the most URScript accepts of a joint [rad/s^2]
SAFETY_NORMAL, SAFETY_REDUCED, ROBOT_RUNNING = 1, 2, 7
PROGRAM_STOPPED, PROGRAM_PLAYING = 1, 2
SAFETY_MODES = {3: "protective stop", 4: "recovery mode", 5: "safeguard stop", 6: "emergency stop (system)",
                7: "emergency stop", 8: "safety violation", 9: "safety fault", 10: "joint identification", 11: "undefined"}
ROBOT_MODES = {-1: "has no controller", 0: "is disconnected", 1: "waits for a confirmation of its safety settings",
               2: "is booting", 3: "has no power", 4: "is being powered", 5: "has its brakes closed",
               6: "is in backdrive mode", 8: "updates its firmware"}
_RECOVERY = 2.0                   # how fast the speed factor rises after a pause [1/s]
_PERIOD_SMOOTHING = 0.02


class UrArmHardware(RobotHW):
    """An arm that is commanded by joint positions.

    Parameters, below its own namespace: `robot_ip_address` (required); `robot_id` "": prefix of the joint names, an
    underscore is put between; `speed_scale` [0..1]: what to set the speed slider to, untouched when not given;
    `payload_mass_kg` 0 and `payload_center_of_mass_m` [0, 0, 0]: of the manipulator, in the flange frame;
    `link_timeout` 0.15 [s]: without news for so long the link counts as lost; `servoj_gain` 2000 and
    `servoj_lookahead_time` 0.03 [s]; `max_jump_rad` 0.5: a command further from the last one is refused.
    `control_pc_ip_address` and `robot_program_path` are accepted and not used. In the root namespace:
    `robot_description` and `joint_limits/<joint>/...` (also has_acceleration_limits, max_acceleration).

    The efforts of the joint states are motor currents [A], as in ur_robot_driver.
    """

    def __init__(self) -> None:
        super().__init__()
        self._prefix = ""
        self._handles: list[JointHandle] = []
        self._wrench = ForceTorqueSensorHandle("wrench", "base")
        self._scaling = SpeedScalingHandle("speed_scaling_factor", ())
        self._settings: LinkSettings | None = None
        self._link: RtdeLink | None = None
        self._check: CommandCheck | None = None
        self._servo_time_s = 0.008
        self._refused = ""
        self._fault = "not initialised"
        self._following = False

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        where = join_names(robot_hw_nh.namespace, "")
        try:
            self._prefix = _read_prefix(robot_hw_nh)
            self._settings = read_link_settings(robot_hw_nh)
            names = [self._prefix + name for name in JOINT_NAMES]
            self._check = CommandCheck(_read_limits(names, root_nh), read_number(robot_hw_nh, "max_jump_rad", 0.5))
        except ParameterError as error:
            LOGGER.error("%s in %s: %s", type(self).__name__, where, error)
            return False
        unused = [key for key in ("control_pc_ip_address", "robot_program_path") if robot_hw_nh.get_param(key)]
        if unused:
            LOGGER.info("%s: not used, as RTDE does not need it: %s", where, ", ".join(unused))
        self._register(names)
        self._link = RtdeLink(self._settings)
        self._link.connect()
        self._link.request_program()
        self._fault = self._current_fault()
        return True

    def _register(self, names: list[str]) -> None:
        states, commands = JointStateInterface(), PositionJointInterface()
        for name in names:
            self._handles.append(commands.register_handle(JointHandle(states.register_handle(JointStateHandle(name)))))
        self._wrench = ForceTorqueSensorHandle(self._prefix + "wrench", self._prefix + "base")
        self._scaling = SpeedScalingHandle(self._prefix + "speed_scaling_factor", names, 0.0)
        sensors, scaling = ForceTorqueSensorInterface(), SpeedScalingInterface()
        sensors.register_handle(self._wrench)
        scaling.register_handle(self._scaling)
        for interface in (states, commands, sensors, scaling):
            self.register_interface(interface)

    @property
    def address(self) -> str:
        """Of the arm's controller."""
        return self._settings.address if self._settings is not None else ""

    def read(self, time_s: float, period_s: float) -> None:
        if self._link is None or self._check is None:
            return
        self._link.poll()
        state = self._link.state
        if state is not None:
            self._take(state, period_s)
        self._stop_with_the_program(state)
        following = self._link.commanding and not self._robot_fault()
        if not following or not self._following:
            for handle in self._handles:
                handle.command = handle.position
            self._check.reset([handle.position for handle in self._handles])
            self._refused = ""
        self._following = following
        self._fault = self._current_fault()

    def _take(self, state: ArmState, period_s: float) -> None:
        for handle, position, velocity, current in zip(self._handles, state.positions, state.velocities,
                                                       state.currents, strict=True):
            handle.state.position, handle.state.velocity, handle.state.effort = position, velocity, current
        self._wrench.force = state.wrench[0], state.wrench[1], state.wrench[2]
        self._wrench.torque = state.wrench[3], state.wrench[4], state.wrench[5]
        playing = state.runtime_state == PROGRAM_PLAYING
        factor = min(max(state.speed_fraction * state.speed_scaling, 0.0), 1.0) if playing else 0.0
        self._scaling.factor = min(factor, self._scaling.factor + _RECOVERY * period_s)

    def _stop_with_the_program(self, state: ArmState | None) -> None:
        """A program that was ended, by whomever, is not started again until somebody says so."""
        link = self._link
        if link is None or state is None or not link.commanding:
            return
        fault = self._robot_fault()
        if fault or state.runtime_state == PROGRAM_STOPPED:
            link.drop_program(fault or "the program on the arm was stopped")

    def write(self, time_s: float, period_s: float) -> None:
        if self._link is None or self._check is None or not self._following:
            return
        if period_s > 0.0:
            share = _PERIOD_SMOOTHING if abs(period_s - self._servo_time_s) < 0.5 * self._servo_time_s else 0.1
            self._servo_time_s += share * (min(max(period_s, 0.002), 0.05) - self._servo_time_s)
        refused = self._check.admit([handle.command for handle in self._handles], period_s)
        if refused and refused != self._refused:
            LOGGER.error("command refused: %s", refused)
        self._refused = refused
        if self._link.state is not None and self._link.state.runtime_state == PROGRAM_PLAYING:
            self._link.servo(self._check.sent, self._servo_time_s)

    def fault(self) -> str:
        return self._refused or self._fault

    @property
    def ready(self) -> bool:
        """Whether the arm follows commands."""
        return self._following and not self.fault()

    def close(self) -> None:
        if self._link is not None:
            self._link.close()

    def resume(self, timeout_s: float = 20.0) -> str:
        """Let the arm follow commands again after a fault; waits until it does. Not for the control loop.

        Args:
            timeout_s: how long that may take [s].

        Returns:
            "", or why it could not be done and what to do.
        """
        if self._link is None:
            return "the arm is not initialised"
        if self._following:
            return ""
        trouble = self._link_fault() or self._robot_fault()
        if trouble:
            return trouble
        self._link.request_program()
        deadline_s = time.monotonic() + timeout_s
        while time.monotonic() < deadline_s:
            time.sleep(0.02)
            if self._following:
                return ""
            if self._link.program_failure:
                break
        return self.fault() or f"the program on the arm did not start within {timeout_s:g} s"

    def _current_fault(self) -> str:
        return self._link_fault() or self._robot_fault() or self._program_fault()

    def _link_fault(self) -> str:
        link = self._link
        if link is None or not link.lost:
            return ""
        return f"link to the arm at {self.address} lost: {link.lost}; it is being made again"

    def _robot_fault(self) -> str:
        state = self._link.state if self._link is not None else None
        if state is None:
            return "no state of the arm yet"
        if state.safety_mode not in (SAFETY_NORMAL, SAFETY_REDUCED):
            mode = SAFETY_MODES.get(state.safety_mode, f"safety mode {state.safety_mode}")
            return f"{mode} of the arm at {self.address}; {_REMEDIES.get(state.safety_mode, _LOOK)}, then call resume"
        if state.robot_mode != ROBOT_RUNNING:
            mode = ROBOT_MODES.get(state.robot_mode, f"is in mode {state.robot_mode}")
            return f"the arm at {self.address} {mode}; call dashboard/power_on and dashboard/brake_release, then resume"
        return ""

    def _program_fault(self) -> str:
        link = self._link
        if link is None or link.commanding:
            return ""
        if link.program_failure:
            return f"the arm at {self.address} takes no commands: {link.program_failure}; call resume"
        return f"the arm at {self.address} is being made ready for commands"


_LOOK = "look at its pendant"
_REMEDIES = {3: "find its cause and call dashboard/unlock_protective_stop",
             6: "release it and call dashboard/power_on and dashboard/brake_release",
             7: "release it and call dashboard/power_on and dashboard/brake_release",
             8: "call dashboard/restart_safety", 9: "call dashboard/restart_safety"}


def _read_prefix(nh: NodeHandle) -> str:
    robot_id = nh.get_param("robot_id", "")
    if not isinstance(robot_id, str):
        raise ParameterError(f"parameter {join_names(nh.namespace, 'robot_id')}: got {robot_id!r}; expected a text")
    return f"{robot_id}_" if robot_id else ""


def read_link_settings(nh: NodeHandle) -> LinkSettings:
    """How to reach the arm, from the parameters below `nh`.

    Raises:
        ParameterError: something is missing or not allowed.
    """
    address = nh.get_param("robot_ip_address")
    if not isinstance(address, str) or not address:
        raise ParameterError(f"parameter {join_names(nh.namespace, 'robot_ip_address')}: got {address!r}; expected the "
                             "address of the arm's controller, for example 192.168.56.101")
    scale = _read_bounded(nh, "speed_scale", 1.0, 0.0, 1.0) if nh.has_param("speed_scale") else None
    return LinkSettings(address, read_number(nh, "link_timeout", 0.15, 0.02), scale,
                        read_number(nh, "payload_mass_kg", 0.0), _read_centre(nh),
                        _read_bounded(nh, "servoj_lookahead_time", 0.03, 0.03, 0.2),
                        _read_bounded(nh, "servoj_gain", 2000.0, 100.0, 2000.0))


def _read_bounded(nh: NodeHandle, key: str, default: float, low: float, high: float) -> float:
    value = read_number(nh, key, default, low)
    if value > high:
        raise ParameterError(f"parameter {join_names(nh.namespace, key)}: got {value:g}; expected {low:g} to {high:g}")
    return value


def _read_centre(nh: NodeHandle) -> tuple[float, float, float]:
    value = nh.get_param("payload_center_of_mass_m", [0.0, 0.0, 0.0])
    numbers = [float(number) for number in value if isinstance(number, (int, float))] if isinstance(value, list) else []
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise ParameterError(f"parameter {join_names(nh.namespace, 'payload_center_of_mass_m')}: got {value!r}; "
                             "expected three numbers [m]")
    return numbers[0], numbers[1], numbers[2]


def _read_limits(names: list[str], root_nh: NodeHandle) -> list[MotionLimits]:
    description = root_nh.get_param("robot_description")
    known = limits_from_urdf(description) if isinstance(description, str) else {}
    limits = []
    for name in names:
        limit = limits_with_parameters(name, known.get(name, UR_LIMITS), root_nh)
        acceleration = MAX_ACCELERATION
        if root_nh.get_param(f"joint_limits/{name}/has_acceleration_limits", False):
            acceleration = read_number(root_nh, f"joint_limits/{name}/max_acceleration", MAX_ACCELERATION)
        limits.append(MotionLimits(name, limit.min_position, limit.max_position, min(limit.max_velocity, math.pi),
                                   acceleration))
    return limits
