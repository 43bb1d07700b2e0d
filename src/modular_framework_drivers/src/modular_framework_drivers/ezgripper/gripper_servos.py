# SPDX-License-Identifier: BSD-3-Clause
"""The servos of one EZGripper as one joint: set up, calibrated, read and driven in the unit of the knuckle joint.

Facts of the maker's public library: the motor closes the fingers clockwise; calibration lets it close with little
torque until it stands, and takes that place as zero; from there to fully open it turns 2500 ticks, while the knuckle
joint goes from 1.94 rad to 0.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import fmean

from modular_framework_drivers.ezgripper import mx64
from modular_framework_drivers.ezgripper.dynamixel_bus import DynamixelBus
from modular_framework_drivers.ezgripper.grip import Drive
from modular_framework_drivers.ezgripper.mx64 import Reading, Register, ServoErrors

CLOSED_POSITION = 1.94
"""Of the knuckle joint with the pads together [rad]."""
TRAVEL_TICKS = 2500
SLACK_TICKS = 400
"""How far beyond its ends the travel may seem to go [ticks]."""
CALIBRATION_TORQUE = 100
RELAXED_TORQUE = 10
CALIBRATION_TIMEOUT_S = 10.0
STANDS_AFTER_S = 0.3
STANDS_WITHIN_TICKS = 4
LIMIT_REGISTERS = (mx64.CW_ANGLE_LIMIT, mx64.CCW_ANGLE_LIMIT)


class GripperError(Exception):
    """The gripper answers, but cannot be used as it is; the text says what to do."""


@dataclass(frozen=True, slots=True)
class GripperReading:
    """The gripper as measured.

    Attributes:
        position: of the knuckle joint [rad].
        velocity: closing positive [rad/s].
        load: share of the motor's torque, closing positive, in [-1, 1].
        temperature: of the hottest motor [deg C].
        voltage: lowest [V].
        errors: all error bits.
    """

    position: float
    velocity: float
    load: float
    temperature: float
    voltage: float
    errors: ServoErrors


@dataclass(slots=True)
class _Servo:
    """What is known of one servo: its zero [ticks], and what was written to its RAM last."""

    servo_id: int
    zero: int | None = None
    written: dict[Register, int] = field(default_factory=dict)


def joint_from_ticks(ticks: float) -> float:
    """Position of the knuckle joint [rad] for an angle of the shaft from its zero [ticks]."""
    return CLOSED_POSITION * (1.0 - ticks / TRAVEL_TICKS)


def ticks_from_joint(position: float) -> int:
    """Angle of the shaft from its zero [ticks] for a position of the knuckle joint [rad]."""
    return round(TRAVEL_TICKS * (1.0 - position / CLOSED_POSITION))


class GripperServos:
    """All servos of a gripper. Not for several threads at once.

    Args:
        bus: the open serial line.
        servo_ids: which servos move the fingers.
        wait: lets some seconds pass; raises when the wait is to be cut short.
    """

    def __init__(self, bus: DynamixelBus, servo_ids: Sequence[int], wait: Callable[[float], None]) -> None:
        self._bus, self._wait = bus, wait
        self._servos = [_Servo(servo_id) for servo_id in servo_ids]

    @property
    def calibrated(self) -> bool:
        """Whether every zero is known."""
        return all(servo.zero is not None for servo in self._servos)

    def set_up(self) -> None:
        """Check the servos' model and bring what stays in their memory into order.

        Raises:
            BusError: one does not answer.
            GripperError: one is something else than an MX-64 or MX-106.
        """
        for servo in self._servos:
            model = self._bus.model_number(servo.servo_id)
            if model not in mx64.MODELS:
                known = ", ".join(f"{number} ({name})" for number, name in mx64.MODELS.items())
                raise GripperError(f"servo {servo.servo_id} is model {model}; expected {known} with protocol 1.0; "
                                   "check servo_ids")
            for register in LIMIT_REGISTERS:
                self._ensure(servo, register, mx64.MULTI_TURN_LIMIT)
            self._ensure(servo, mx64.MULTI_TURN_OFFSET, 0)
            self._ensure(servo, mx64.RESOLUTION_DIVIDER, 1)

    def calibrate(self) -> None:
        """Close until the fingers stand, and take that for the zero. Nothing may be between them.

        Raises:
            BusError: a servo does not answer.
            GripperError: they do not come to a stop, or a motor reports an error.
        """
        for servo in self._servos:
            servo.written.clear()
            self._write(servo, mx64.TORQUE_LIMIT, CALIBRATION_TORQUE)
            self._write(servo, mx64.GOAL_TORQUE, mx64.direction_word(-CALIBRATION_TORQUE))
            self._write(servo, mx64.TORQUE_CONTROL_MODE, 1)
            self._write(servo, mx64.TORQUE_ENABLE, 1)
        self._wait_for_standstill()
        for servo in self._servos:
            self._write(servo, mx64.GOAL_TORQUE, mx64.direction_word(-RELAXED_TORQUE))
        self._wait(0.1)
        for servo in self._servos:
            servo.zero = self._reading(servo).position

    def _wait_for_standstill(self) -> None:
        standstill_s = passed_s = 0.0
        last: list[int] = []
        while standstill_s < STANDS_AFTER_S:
            readings = [self._reading(servo) for servo in self._servos]
            self._refuse_errors(readings)
            now = [reading.position for reading in readings]
            stands = bool(last) and all(abs(a - b) <= STANDS_WITHIN_TICKS for a, b in zip(now, last, strict=True))
            standstill_s = standstill_s + 0.1 if stands else 0.0
            last = now
            if passed_s > CALIBRATION_TIMEOUT_S:
                raise GripperError(f"calibration: the fingers still moved after {CALIBRATION_TIMEOUT_S:.0f} s of "
                                   "closing; check that the tendon is in place and the fingers meet")
            self._wait(0.1)
            passed_s += 0.1

    def _refuse_errors(self, readings: Sequence[Reading]) -> None:
        hottest = max(reading.temperature for reading in readings)
        lowest = min(reading.voltage for reading in readings)
        for reading in readings:
            if reading.errors & mx64.MOTOR_FAULTS:
                raise GripperError(f"calibration: {describe_errors(reading.errors, hottest, lowest)}")

    def find_again(self) -> bool:
        """After a lost link: whether the servos have been doing all along what they were told last.

        When not, they were without power: what they are told is forgotten, and the turns of their shafts are counted
        anew, which needs no motion because the travel is less than one turn.

        Raises:
            BusError: a servo does not answer.
            GripperError: a shaft is where it cannot be; its zero is kept, so that nothing moves to find another.
        """
        faithful = all(self._remembers(servo) for servo in self._servos)
        for servo in self._servos:
            if servo.zero is None or faithful:
                continue
            position = self._reading(servo).position
            ticks = (position - servo.zero + SLACK_TICKS) % mx64.TICKS_PER_TURN - SLACK_TICKS
            if ticks > TRAVEL_TICKS + SLACK_TICKS:
                raise GripperError(f"servo {servo.servo_id}: its shaft is not where the fingers can be; free them and "
                                   "check the tendon, or start the node again to calibrate them anew")
            servo.zero = position - ticks
            servo.written.clear()
        return faithful

    def _remembers(self, servo: _Servo) -> bool:
        return mx64.TORQUE_ENABLE in servo.written and all(
            mx64.from_bytes(self._bus.read(servo.servo_id, register)[0]) == value % (1 << 8 * register.size)
            for register, value in servo.written.items())

    def forget(self) -> None:
        """Write everything anew at the next drive; a motor that shut down has lost its torque limit."""
        for servo in self._servos:
            servo.written.clear()

    def read(self) -> GripperReading:
        """Measure.

        Raises:
            BusError: a servo does not answer.
        """
        readings = [self._reading(servo) for servo in self._servos]
        ticks = fmean(reading.position - (servo.zero or 0)
                      for servo, reading in zip(self._servos, readings, strict=True))
        speed = fmean(reading.speed for reading in readings)
        errors = ServoErrors.NONE
        for reading in readings:
            errors |= reading.errors
        return GripperReading(joint_from_ticks(ticks), -speed * CLOSED_POSITION / TRAVEL_TICKS,
                              -fmean(reading.load for reading in readings),
                              max(reading.temperature for reading in readings),
                              min(reading.voltage for reading in readings), errors)

    def drive(self, drive: Drive) -> None:
        """Tell the motors what to do; only what has changed is sent.

        Raises:
            BusError: a servo does not answer.
        """
        for servo in self._servos:
            # a motor that may do more than before must not yet have its old goal; it never does more than is allowed
            if drive.position is None or drive.torque < servo.written.get(mx64.TORQUE_LIMIT, 0):
                self._write(servo, mx64.TORQUE_LIMIT, drive.torque)
            if drive.position is None:
                self._write(servo, mx64.GOAL_TORQUE, mx64.direction_word(-drive.direction * drive.torque))
            else:
                self._write(servo, mx64.GOAL_POSITION, (servo.zero or 0) + ticks_from_joint(drive.position))
            self._write(servo, mx64.TORQUE_CONTROL_MODE, int(drive.position is None))
            self._write(servo, mx64.TORQUE_LIMIT, drive.torque)
            self._write(servo, mx64.TORQUE_ENABLE, 1)

    def stay(self) -> None:
        """Tell every motor to stay where it is, with the torque it has: one that has shut down stays off.

        Raises:
            BusError: a servo does not answer.
        """
        for servo in self._servos:
            self._write(servo, mx64.GOAL_POSITION, self._reading(servo).position)
            self._write(servo, mx64.TORQUE_CONTROL_MODE, 0)

    def _reading(self, servo: _Servo) -> Reading:
        return mx64.parse_reading(*self._bus.read(servo.servo_id, mx64.READING))

    def _write(self, servo: _Servo, register: Register, value: int) -> None:
        if servo.written.get(register) != value:
            servo.written.pop(register, None)  # when its answer is lost nobody knows whether the servo has done it
            self._bus.write(servo.servo_id, register, value)
            servo.written[register] = value

    def _ensure(self, servo: _Servo, register: Register, value: int) -> None:
        """Write to the EEPROM, which does not live for ever, only what is not there yet."""
        if mx64.from_bytes(self._bus.read(servo.servo_id, register)[0]) != value:
            self._bus.write(servo.servo_id, register, value)


def describe_errors(errors: ServoErrors, temperature: float, voltage: float) -> str:
    """What the motor's error bits mean, and what to do."""
    texts = []
    if errors & ServoErrors.OVERHEATING:
        texts.append(f"the motor is too hot ({temperature:.0f} degrees C) and has switched itself off; let it cool, "
                     "and hold with less torque")
    if errors & ServoErrors.OVERLOAD:
        texts.append("the motor was overloaded and has switched itself off; free the fingers, and use less torque")
    if errors & ServoErrors.VOLTAGE:
        texts.append(f"the supply gives {voltage:.1f} V, which is outside the servo's limits; check the power supply")
    return "; ".join(texts)
