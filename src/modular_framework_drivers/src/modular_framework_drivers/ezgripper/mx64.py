# SPDX-License-Identifier: BSD-3-Clause
"""Defines the register table of a Dynamixel MX-64 (protocol 1.0): registers, units and error bits.

Source: manual of the manufacturer, ROBOTIS e-Manual, "MX-64" and "DYNAMIXEL Protocol 1.0".
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag

MODEL_NUMBER_MX64 = 310
MODELS = {MODEL_NUMBER_MX64: "MX-64", 320: "MX-106"}
"""Servos with which the gripper is sold; the used registers of their tables agree."""
TICKS_PER_TURN = 4096
SPEED_UNIT_TICKS_S = 0.114 / 60.0 * TICKS_PER_TURN
"""Unit of the speed registers, 0.114 revolutions per minute [ticks/s]."""
MAX_SPEED_TICKS_S = 63.0 / 60.0 * TICKS_PER_TURN
"""No-load speed at full torque and 12 V, 63 revolutions per minute [ticks/s]."""
TICKS_PER_TORQUE = 8.0 / 32.0
"""Position error per unit of torque of the position control with the default gain of 32."""
TORQUE_MAX = 1023
"""Maximum value of the torque registers: the full torque of the motor."""
SUSTAINED_TORQUE = 100
"""Torque that the motor can sustain indefinitely, according to the manufacturer."""
WARNING_TEMPERATURE = 70.0
"""Minimum temperature that causes a logged warning [deg C]; the motor switches itself off at 80 deg C."""
CLOCKWISE_BIT = 1 << 10
"""Direction bit of the speed, load and torque registers."""
MULTI_TURN_LIMIT = 4095
"""Value of both angle limits that selects multi-turn mode, which has signed positions."""


@dataclass(frozen=True, slots=True)
class Register:
    """Describes a register of a servo.

    Attributes:
        address: Address of the first byte.
        size: Number of bytes, in little-endian order.
        name: Name in the manual.
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
"""All measurements as one register, for a single read."""


class ServoErrors(IntFlag):
    """Error bits of a status packet."""

    NONE = 0
    VOLTAGE = 1
    ANGLE_LIMIT = 2
    OVERHEATING = 4
    RANGE = 8
    CHECKSUM = 16
    OVERLOAD = 32
    INSTRUCTION = 64


MOTOR_FAULTS = ServoErrors.VOLTAGE | ServoErrors.OVERHEATING | ServoErrors.OVERLOAD
"""Errors of the motor, which persist; the other errors concern a single instruction."""


@dataclass(frozen=True, slots=True)
class Reading:
    """Holds the measurements of a servo.

    Attributes:
        position: Shaft position [ticks], signed in multi-turn mode.
        speed: Shaft speed, counter-clockwise positive [ticks/s].
        load: Fraction of the full torque in [-1, 1], counter-clockwise positive; inferred by the servo.
        voltage: Supply voltage [V].
        temperature: Temperature of the motor [deg C].
        errors: Error bits of the packet.
    """

    position: int
    speed: float
    load: float
    voltage: float
    temperature: float
    errors: ServoErrors


def from_bytes(data: bytes | bytearray) -> int:
    """Returns the unsigned number in little-endian bytes."""
    return int.from_bytes(data, "little")


def from_signed_word(word: int) -> int:
    """Returns a 16-bit word as a signed number, such as a position in multi-turn mode."""
    return word - 0x10000 if word & 0x8000 else word


def from_direction_word(word: int) -> int:
    """Returns a word with a direction bit (speed, load, torque) as a number, counter-clockwise positive."""
    return -(word & (CLOCKWISE_BIT - 1)) if word & CLOCKWISE_BIT else word & (CLOCKWISE_BIT - 1)


def direction_word(value: int) -> int:
    """Returns the word with a direction bit for a speed, load or torque, counter-clockwise positive."""
    return CLOCKWISE_BIT | -value if value < 0 else value


def parse_reading(data: bytes, errors: ServoErrors) -> Reading:
    """Parses the eight bytes of the register READING."""
    return Reading(
        from_signed_word(from_bytes(data[0:2])),
        from_direction_word(from_bytes(data[2:4])) * SPEED_UNIT_TICKS_S,
        from_direction_word(from_bytes(data[4:6])) / TORQUE_MAX,
        data[6] / 10.0,
        float(data[7]),
        errors,
    )
