# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of an EZGripper, checked."""

from __future__ import annotations

from dataclasses import dataclass, field

from modular_framework_drivers.ezgripper.grip import GripRules
from modular_framework_ros.node_handle import NodeHandle
from modular_framework_ros.parameter_declarations import parameters_below

FULL_TORQUE = 800
"""Torque that an intensity of 1 stands for at most, by the maker's advice [units of the servo]."""

STALE_PERIODS, STALE_S = 5.0, 0.1
"""Age at which a measured position is stale: in periods of polling, and at least so much per servo on the line [s]."""


@dataclass(frozen=True, slots=True)
class GripperSettings:
    """Connection and behaviour of a gripper.

    Attributes:
        port_name: serial port.
        baudrate: [bit/s].
        servo_ids: Dynamixel identifiers.
        name: of the gripper, for messages.
        poll_period_s: the servos are asked so often [s].
        start_position: of the knuckle joint after calibration [rad].
        start_torque: to get there [units of the servo].
        link_timeout_s: a servo that has not answered for so long is out of reach [s].
        reconnect_period_s: between two tries to reach a gripper that is not there [s].
        fault_pause_s: a motor that has switched itself off is left alone for so long [s].
        rules: when is arrived, when held up.
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


def read_gripper_settings(own: NodeHandle, root: NodeHandle) -> GripperSettings:
    """The settings of the parameters that `parameters/EzGripperRobotHW.yaml` declares.

    Args:
        own: namespace of the gripper.
        root: namespace of port_name, baudrate, servo_ids and manipulator_name if `own` has no port_name.

    Raises:
        ParameterError: lists all faults.
    """
    place = "~" if own.has_param("port_name") else ""
    connection = [place + key for key in ("port_name", "baudrate", "servo_ids", "manipulator_name")]
    behaviour = ("~poll_rate", "~start_position", "~link_timeout", "~position_tolerance", "~stall_time", "~hold_torque")
    port, baudrate, ids, name, rate, start_position, link_timeout_s, tolerance, stall_s, torque = parameters_below(
        "modular_framework_drivers", "EzGripperRobotHW", own, root
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
