# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of an EZGripper, checked."""

from __future__ import annotations

from dataclasses import dataclass, field

from modular_framework_drivers.ezgripper.dynamixel_bus import BAUDRATES
from modular_framework_drivers.ezgripper.grip import GripRules
from modular_framework_drivers.ezgripper.gripper_servos import CLOSED_POSITION
from modular_framework_drivers.ezgripper.mx64 import LARGEST_ID, TORQUE_MAX
from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names, read_number

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


def read_gripper_settings(connection: NodeHandle, behaviour: NodeHandle) -> GripperSettings:
    """The settings of the parameters.

    Args:
        connection: namespace of port_name, baudrate, servo_ids and manipulator_name.
        behaviour: namespace of the others: poll_rate [1/s] 50, start_position [rad] 0, hold_torque [0 to 1023] 400,
            position_tolerance [rad] 0.03, stall_time [s] 0.25, link_timeout [s] 0.1.

    Raises:
        ParameterError: lists all faults.
    """
    faults: list[str] = []

    def number(key: str, default: float, largest: float, smallest: float = 0.0) -> float:
        try:
            value = read_number(behaviour, key, default, smallest)
            if value <= largest:
                return value
            faults.append(
                f"parameter {join_names(behaviour.namespace, key)}: got {value:g}; expected a number from "
                f"{smallest:g} to {largest:g}"
            )
        except ParameterError as error:
            faults.append(str(error))
        return default

    port_name = connection.get_param("port_name", "")
    if not isinstance(port_name, str) or not port_name:
        faults.append(_fault(connection, "port_name", port_name, "the path of a serial port, such as /dev/ttyUSB0"))
    baudrate = connection.get_param("baudrate", 57600)
    if baudrate not in BAUDRATES:
        faults.append(_fault(connection, "baudrate", baudrate, f"one of {', '.join(map(str, BAUDRATES))}"))
    servo_ids = connection.get_param("servo_ids", [1])
    if not _are_ids(servo_ids):
        faults.append(_fault(connection, "servo_ids", servo_ids, f"a list of different numbers from 0 to {LARGEST_ID}"))
    period_s = 1.0 / number("poll_rate", 50.0, 200.0, 1.0)
    rules = GripRules(
        position_tolerance=number("position_tolerance", 0.03, 0.5, 0.002),
        stall_s=number("stall_time", 0.25, 5.0, 0.05),
        hold_torque=int(number("hold_torque", 400, TORQUE_MAX)),
        stale_s=max(STALE_PERIODS * period_s, STALE_S * (len(servo_ids) if isinstance(servo_ids, list) else 1)),
    )
    start_position = number("start_position", 0.0, CLOSED_POSITION)
    link_timeout_s = number("link_timeout", 0.1, 10.0)
    if faults:
        raise ParameterError("; ".join(faults))
    name = str(connection.get_param("manipulator_name", "EzGripper"))
    return GripperSettings(
        port_name,
        baudrate,
        tuple(servo_ids),
        name,
        period_s,
        start_position,
        link_timeout_s=link_timeout_s,
        rules=rules,
    )


def _are_ids(value: object) -> bool:
    return (
        isinstance(value, list)
        and bool(value)
        and len(set(map(str, value))) == len(value)
        and all(isinstance(one, int) and not isinstance(one, bool) and 0 <= one <= LARGEST_ID for one in value)
    )


def _fault(handle: NodeHandle, key: str, got: object, expected: str) -> str:
    return f"parameter {join_names(handle.namespace, key)}: got {got!r}; expected {expected}"
