# SPDX-License-Identifier: BSD-3-Clause
"""Reads and checks the parameters of an EZGripper."""

from __future__ import annotations

from dataclasses import dataclass, field

from modular_framework_drivers.ezgripper.grip import GripRules
from modular_framework_ros.node_handle import NodeHandle
from modular_framework_ros.parameter_declarations import parameters_below

FULL_TORQUE = 800
"""Maximum torque at an intensity of 1, as recommended by the manufacturer [servo units]."""

STALE_PERIODS, STALE_S = 5.0, 0.1
"""Age of a stale position: number of polling periods, and minimum age per servo on the line [s]."""


@dataclass(frozen=True, slots=True)
class GripperSettings:
    """Holds the settings of a gripper.

    Attributes:
        port_name: Name of the serial port.
        baudrate: Baud rate of the serial line [bit/s].
        servo_ids: Dynamixel identifiers.
        name: Name of the gripper in messages.
        poll_period_s: Polling period of the servos [s].
        start_position: Position of the knuckle joint after calibration [rad].
        start_torque: Torque of the motion to the start position [servo units].
        link_timeout_s: Time without a response after which a servo is unreachable [s].
        reconnect_period_s: Time between two connection attempts [s].
        fault_pause_s: Pause after a motor has switched itself off [s].
        rules: Thresholds for reached goals and stalled fingers.
    """

    port_name: str
    baudrate: int = 57600
    servo_ids: tuple[int, ...] = (1,)
    name: str = "EzGripper"
    poll_period_s: float = 0.02
    start_position: float = 0.0
    start_torque: int = FULL_TORQUE // 2
    link_timeout_s: float = 0.1
    reconnect_period_s: float = 0.5
    fault_pause_s: float = 2.0
    rules: GripRules = field(default_factory=GripRules)


def read_gripper_settings(gripper_nh: NodeHandle, root_nh: NodeHandle) -> GripperSettings:
    """Returns the settings in the parameters declared in `parameters/EzGripperRobotHW.yaml`.

    Args:
        gripper_nh: Node handle in the namespace of the gripper.
        root_nh: Node handle of port_name, baudrate, servo_ids and manipulator_name if `gripper_nh` has no port_name.

    Raises:
        ParameterError: If parameters are missing or invalid; names each of them.
    """
    prefix = "~" if gripper_nh.has_param("port_name") else ""
    connection = [prefix + key for key in ("port_name", "baudrate", "servo_ids", "manipulator_name")]
    behaviour = ("~poll_rate", "~start_position", "~link_timeout", "~position_tolerance", "~stall_time", "~hold_torque")
    port, baudrate, ids, name, rate, start_position, link_timeout_s, tolerance, stall_s, torque = parameters_below(
        "modular_framework_drivers", "EzGripperRobotHW", gripper_nh, root_nh
    ).values(*connection, *behaviour, required=connection[:1])
    period_s = 1.0 / rate
    return GripperSettings(
        port,
        baudrate,
        tuple(ids),
        name,
        period_s,
        start_position,
        link_timeout_s=link_timeout_s,
        rules=GripRules(
            position_tolerance=tolerance,
            stall_s=stall_s,
            hold_torque=int(torque),
            stale_s=max(STALE_PERIODS * period_s, STALE_S * len(ids)),
        ),
    )
