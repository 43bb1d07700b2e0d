# SPDX-License-Identifier: BSD-3-Clause
"""The servos of one EZGripper as one joint: set up, calibrated, read and driven in the unit of the knuckle joint.

From the maker's public library: the motor closes the fingers clockwise. Calibration closes them with little torque
until they stand still and takes that position as zero. From there to fully open the motor turns 2500 ticks, and the
knuckle joint moves from 1.94 rad to 0.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from statistics import fmean

from modular_framework_drivers.ezgripper import mx64
from modular_framework_drivers.ezgripper.dynamixel_bus import DynamixelBus
from modular_framework_drivers.ezgripper.grip import Drive
from modular_framework_drivers.ezgripper.mx64 import Reading, Register, ServoErrors

CLOSED_POSITION = 1.94
"""Of the knuckle joint with the pads together [rad]."""
TRAVEL_TICKS = 2500
SLACK_TICKS = 400
"""How far beyond the ends of the travel a position may be measured [ticks]."""
CALIBRATION_TORQUE = 100
RELAXED_TORQUE = 10
CALIBRATION_TIMEOUT_S = 10.0
STANDS_AFTER_S = 0.3
STANDS_WITHIN_TICKS = 4
LIMIT_REGISTERS = (mx64.CW_ANGLE_LIMIT, mx64.CCW_ANGLE_LIMIT)


class GripperError(Exception):
    """The gripper answers but cannot be used; the text says what to do."""


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
    """One servo: its zero [ticks], and the values that were written to its RAM last."""

    servo_id: int
    zero: int | None = None
    written: dict[Register, int] = field(default_factory=dict)


def joint_from_ticks(ticks: float) -> float:
    """Position of the knuckle joint [rad] for an angle of the shaft from its zero [ticks]."""
    return CLOSED_POSITION * (1.0 - ticks / TRAVEL_TICKS)


def ticks_from_joint(position: float) -> int:
    """Angle of the shaft from its zero [ticks] for a position of the knuckle joint [rad]."""
    return round(TRAVEL_TICKS * (1.0 - position / CLOSED_POSITION))


def with_set_point_near(drive: Drive, position: float, duration_s: float) -> Drive:
    """Brings the set point so near that fingers whose line is cut, since no servo has a watchdog, do not go far.

    Args:
        drive: the command.
        position: measured [rad].
        duration_s: for how long the motor must be able to use its torque before the set point is renewed [s].
    """
    if drive.position is None:
        return drive
    ticks = drive.torque * (mx64.TICKS_PER_TORQUE + mx64.TOP_SPEED_TICKS_S / mx64.TORQUE_MAX * duration_s)
    lead = ticks * CLOSED_POSITION / TRAVEL_TICKS
    return replace(drive, position=min(max(drive.position, position - lead), position + lead))


class GripperServos:
    """All servos of a gripper; to be used by one thread.

    Args:
        bus: the open serial line.
        servo_ids: which servos move the fingers.
        wait: waits for some time [s]; raises to end the wait early.
    """

    def __init__(self, bus: DynamixelBus, servo_ids: Sequence[int], wait: Callable[[float], None]) -> None:
        self._bus, self._wait = bus, wait
        self._servos = [_Servo(servo_id) for servo_id in servo_ids]

    @property
    def calibrated(self) -> bool:
        """Whether every zero is known."""
        return all(servo.zero is not None for servo in self._servos)

    def set_up(self) -> None:
        """Checks the model of each servo and sets its permanent registers.

        Raises:
            BusError: one does not answer.
            GripperError: one is something else than an MX-64 or MX-106.
        """
        for servo in self._servos:
            model = self._bus.model_number(servo.servo_id)
            if model not in mx64.MODELS:
                known = ", ".join(f"{number} ({name})" for number, name in mx64.MODELS.items())
                raise GripperError(
                    f"servo {servo.servo_id} is model {model}; expected {known} with protocol 1.0; check servo_ids"
                )
            for register in LIMIT_REGISTERS:
                self._ensure(servo, register, mx64.MULTI_TURN_LIMIT)
            self._ensure(servo, mx64.MULTI_TURN_OFFSET, 0)
            self._ensure(servo, mx64.RESOLUTION_DIVIDER, 1)

    def calibrate(self) -> None:
        """Closes until the fingers stand still, and takes that position as zero. Nothing may be between them.

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
                raise GripperError(
                    f"calibration: the fingers still moved after {CALIBRATION_TIMEOUT_S:.0f} s of "
                    "closing; check that the tendon is in place and the fingers meet"
                )
            self._wait(0.1)
            passed_s += 0.1

    def _refuse_errors(self, readings: Sequence[Reading]) -> None:
        hottest = max(reading.temperature for reading in readings)
        lowest = min(reading.voltage for reading in readings)
        for reading in readings:
            if reading.errors & mx64.MOTOR_FAULTS:
                raise GripperError(f"calibration: {describe_errors(reading.errors, hottest, lowest)}")

    def find_again(self) -> bool:
        """Returns whether the servos, after a lost link, still have the values that were written last.

        If not, they were without power. Then everything is written again at the next `drive`, and the turns of their
        shafts are counted anew, which needs no motion because the travel is less than one turn.

        Raises:
            BusError: a servo does not answer.
            GripperError: a shaft is outside the travel; its zero is kept, so that no new calibration moves the fingers.
        """
        faithful = all(self._remembers(servo) for servo in self._servos)
        for servo in self._servos:
            if servo.zero is None or faithful:
                continue
            position = self._reading(servo).position
            ticks = (position - servo.zero + SLACK_TICKS) % mx64.TICKS_PER_TURN - SLACK_TICKS
            if ticks > TRAVEL_TICKS + SLACK_TICKS:
                raise GripperError(
                    f"servo {servo.servo_id}: its shaft is not where the fingers can be; free them and "
                    "check the tendon, or start the node again to calibrate them anew"
                )
            servo.zero = position - ticks
            servo.written.clear()
        return faithful

    def _remembers(self, servo: _Servo) -> bool:
        return mx64.TORQUE_ENABLE in servo.written and all(
            mx64.from_bytes(self._bus.read(servo.servo_id, register)[0]) == value % (1 << 8 * register.size)
            for register, value in servo.written.items()
        )

    def lost_power(self) -> bool:
        """Returns whether a motor that was switched on is off, though its servo reports no error.

        Raises:
            BusError: a servo does not answer.
        """
        return any(
            servo.written.get(mx64.TORQUE_ENABLE) and not any(self._bus.read(servo.servo_id, mx64.TORQUE_ENABLE)[0])
            for servo in self._servos
        )

    def forget(self) -> None:
        """Makes the next `drive` write every value; a motor that shut down has lost its torque limit."""
        for servo in self._servos:
            servo.written.clear()

    def read(self) -> GripperReading:
        """Measures.

        Raises:
            BusError: a servo does not answer.
        """
        readings = [self._reading(servo) for servo in self._servos]
        ticks = fmean(
            reading.position - (servo.zero or 0) for servo, reading in zip(self._servos, readings, strict=True)
        )
        speed = fmean(reading.speed for reading in readings)
        errors = ServoErrors.NONE
        for reading in readings:
            errors |= reading.errors
        return GripperReading(
            joint_from_ticks(ticks),
            -speed * CLOSED_POSITION / TRAVEL_TICKS,
            -fmean(reading.load for reading in readings),
            max(reading.temperature for reading in readings),
            min(reading.voltage for reading in readings),
            errors,
        )

    def drive(self, drive: Drive) -> None:
        """Sends a command to the motors; only values that have changed are written.

        Raises:
            BusError: a servo does not answer.
        """
        for servo in self._servos:
            # A lower torque limit is written before the new goal, a higher one after it: the motor exceeds neither.
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
        """Commands every motor to its present position, with the torque it has: one that has shut down stays off.

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
            servo.written.pop(register, None)  # if the answer is lost, the value is unknown
            self._bus.write(servo.servo_id, register, value)
            servo.written[register] = value

    def _ensure(self, servo: _Servo, register: Register, value: int) -> None:
        """Writes a value to the EEPROM only if it is not there yet, because its number of writes is limited."""
        if mx64.from_bytes(self._bus.read(servo.servo_id, register)[0]) != value:
            self._bus.write(servo.servo_id, register, value)


def describe_errors(errors: ServoErrors, temperature: float, voltage: float) -> str:
    """Describes the motor's error bits and what to do."""
    texts = []
    if errors & ServoErrors.OVERHEATING:
        texts.append(
            f"the motor is too hot ({temperature:.0f} degrees C) and has switched itself off; let it cool, "
            "and hold with less torque"
        )
    if errors & ServoErrors.OVERLOAD:
        texts.append("the motor was overloaded and has switched itself off; free the fingers, and use less torque")
    if errors & ServoErrors.VOLTAGE:
        texts.append(f"the supply gives {voltage:.1f} V, which is outside the servo's limits; check the power supply")
    return "; ".join(texts)
