# SPDX-License-Identifier: BSD-3-Clause
"""Emulated grippers that are at fault when their driver starts."""

from __future__ import annotations

from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path

import serial

from modular_framework_control.realtime.scheduling import run_in_real_time
from modular_framework_drivers.ezgripper import mx64
from modular_framework_testing.emulators.dynamixel_finger import Finger, FingerModel
from modular_framework_testing.emulators.dynamixel_line import DynamixelLine
from modular_framework_testing.emulators.dynamixel_servo import DynamixelServo

GRIPPER_CASES: dict[str, tuple[Callable[[DynamixelLine], object], int, str]] = {
    "no_cable": (DynamixelLine.unplug, 57600, "cannot be opened: No such file or directory; check the cable"),
    "no_gripper_power": (DynamixelLine.power_off, 57600, "at 57600 baud does not respond"),
    "another_baud_rate": (lambda line: None, 115200, "at 115200 baud does not respond"),
    "another_id": (lambda line: line.change_id(7), 57600, "servo 1 on"),
    "another_model": (
        lambda line: line.fingers[0].servo.set(mx64.MODEL_NUMBER, 12),
        57600,
        "servo 1 is model 12; expected 310 (MX-64)",
    ),
    "port_in_use": (
        lambda line: serial.Serial(str(line.link), exclusive=True),
        57600,
        "cannot be opened: another program uses it",
    ),
}
"""Function that spoils a gripper before the start and returns what to keep, baud rate of the driver, and fault text."""


def emulate_grippers(ports: dict[str, Path], test: Connection) -> None:
    """Emulates the gripper of each case in this process until the test closes its end of the connection."""
    lines, kept = [], []
    for name, port in ports.items():
        line = DynamixelLine([Finger(DynamixelServo(), FingerModel())], port)
        line.connect()
        lines.append(line)
        kept.append(GRIPPER_CASES[name][0](line))
    run_in_real_time()  # beside the nodes of this test, late servos would look like silent ones
    test.send("ready")
    test.poll(None)
    kept.clear()
    for line in lines:
        line.close()
