# SPDX-License-Identifier: BSD-3-Clause
"""The register table of a Dynamixel MX-64 (protocol 1.0): registers, units and error bits.

Source: the public manual of the maker, ROBOTIS e-Manual, "MX-64" and "DYNAMIXEL Protocol 1.0".
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag

MODEL_NUMBER_MX64 = 310
MODELS = {MODEL_NUMBER_MX64: "MX-64", 320: "MX-106"}
"""Servos the gripper is sold with; their tables agree in what is used of them."""
TICKS_PER_TURN = 4096
SPEED_UNIT_TICKS_S = 0.114 / 60.0 * TICKS_PER_TURN
"""One unit of the speed registers, 0.114 turns a minute [ticks/s]."""
TOP_SPEED_TICKS_S = 63.0 / 60.0 * TICKS_PER_TURN
"""Speed without load at full torque and 12 V, 63 turns a minute [ticks/s]."""
TICKS_PER_TORQUE = 8.0 / 32.0
"""Distance from the goal position per unit of torque that the position control applies, with its initial gain 32."""
TORQUE_MAX = 1023
"""Largest word of the torque registers: the full torque of the motor."""
UNWATCHED_TORQUE = 100
"""Torque that the motor may apply for any length of time, by its maker."""
WARM = 70.0
"""Temperature from which on a user should know of it [deg C]; the motor switches itself off at 80."""
CLOCKWISE = 1 << 10
"""Bit of the speed, load and torque words that holds the direction."""
MULTI_TURN_LIMIT = 4095
"""Both angle limits at this word: positions go on beyond one turn, signed."""


@dataclass(frozen=True, slots=True)
class Register:
    """A register in a servo's table.

    Attributes:
        address: first byte.
        size: bytes; the low one comes first.
        name: as in the manual.
    """

    address: int
    size: int
    name: str


MODEL_NUMBER = Register(0, 2, "Model Number")
FIRMWARE_VERSION = Register(2, 1, "Firmware Version")
SERVO_ID = Register(3, 1, "ID")
BAUD_RATE = Register(4, 1, "Baud Rate")
RETURN_DELAY_TIME = Register(5, 1, "Return Delay Time")
CW_ANGLE_LIMIT = Register(6, 2, "CW Angle Limit")
CCW_ANGLE_LIMIT = Register(8, 2, "CCW Angle Limit")
TEMPERATURE_LIMIT = Register(11, 1, "Temperature Limit")
MIN_VOLTAGE_LIMIT = Register(12, 1, "Min Voltage Limit")
MAX_VOLTAGE_LIMIT = Register(13, 1, "Max Voltage Limit")
MAX_TORQUE = Register(14, 2, "Max Torque")
STATUS_RETURN_LEVEL = Register(16, 1, "Status Return Level")
ALARM_LED = Register(17, 1, "Alarm LED")
SHUTDOWN = Register(18, 1, "Shutdown")
MULTI_TURN_OFFSET = Register(20, 2, "Multi Turn Offset")
RESOLUTION_DIVIDER = Register(22, 1, "Resolution Divider")
TORQUE_ENABLE = Register(24, 1, "Torque Enable")
P_GAIN = Register(28, 1, "P Gain")
GOAL_POSITION = Register(30, 2, "Goal Position")
MOVING_SPEED = Register(32, 2, "Moving Speed")
TORQUE_LIMIT = Register(34, 2, "Torque Limit")
PRESENT_POSITION = Register(36, 2, "Present Position")
PRESENT_SPEED = Register(38, 2, "Present Speed")
PRESENT_LOAD = Register(40, 2, "Present Load")
PRESENT_VOLTAGE = Register(42, 1, "Present Voltage")
PRESENT_TEMPERATURE = Register(43, 1, "Present Temperature")
REGISTERED = Register(44, 1, "Registered")
MOVING = Register(46, 1, "Moving")
LOCK = Register(47, 1, "Lock")
CURRENT = Register(68, 2, "Current")
TORQUE_CONTROL_MODE = Register(70, 1, "Torque Ctrl Mode Enable")
GOAL_TORQUE = Register(71, 2, "Goal Torque")
GOAL_ACCELERATION = Register(73, 1, "Goal Acceleration")

READING = Register(PRESENT_POSITION.address, 8, "Present Position to Present Temperature")
"""Everything measured, in one go."""


class ServoErrors(IntFlag):
    """Bits of the error byte of a status packet."""

    NONE = 0
    VOLTAGE = 1
    ANGLE_LIMIT = 2
    OVERHEATING = 4
    RANGE = 8
    CHECKSUM = 16
    OVERLOAD = 32
    INSTRUCTION = 64


MOTOR_FAULTS = ServoErrors.VOLTAGE | ServoErrors.OVERHEATING | ServoErrors.OVERLOAD
"""Errors of the motor, which last; the others belong to one instruction."""


@dataclass(frozen=True, slots=True)
class Reading:
    """Measurements of a servo.

    Attributes:
        position: [ticks], signed in multi-turn mode.
        speed: counter-clockwise positive [ticks/s].
        load: share of the motor's torque, counter-clockwise positive, in [-1, 1]; inferred, not measured.
        voltage: [V].
        temperature: [deg C].
        errors: error bits of the packet it came with.
    """

    position: int
    speed: float
    load: float
    voltage: float
    temperature: float
    errors: ServoErrors


def from_bytes(data: bytes | bytearray) -> int:
    """The word of some bytes, low byte first."""
    return int.from_bytes(data, "little")


def signed(word: int) -> int:
    """A word of 16 bits as a signed number (positions in multi-turn mode)."""
    return word - 0x10000 if word & 0x8000 else word


def directed(word: int) -> int:
    """A word with a direction bit (speed, load, torque) as a number, counter-clockwise positive."""
    return -(word & (CLOCKWISE - 1)) if word & CLOCKWISE else word & (CLOCKWISE - 1)


def direction_word(value: int) -> int:
    """The word of a speed, load or torque, counter-clockwise positive."""
    return CLOCKWISE | -value if value < 0 else value


def parse_reading(data: bytes, errors: ServoErrors) -> Reading:
    """Parses the eight bytes of `READING`."""
    return Reading(
        signed(from_bytes(data[0:2])),
        directed(from_bytes(data[2:4])) * SPEED_UNIT_TICKS_S,
        directed(from_bytes(data[4:6])) / TORQUE_MAX,
        data[6] / 10.0,
        float(data[7]),
        errors,
    )
