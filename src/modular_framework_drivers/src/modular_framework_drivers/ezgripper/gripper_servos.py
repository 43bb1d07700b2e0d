# SPDX-License-Identifier: BSD-3-Clause
"""Calibrates, reads and drives the servos of one EZGripper as one knuckle joint.

From the manufacturer's public library: the motor closes the fingers clockwise. Calibration closes the fingers with
little torque until they stand still, which defines the zero position. From the zero position to fully open, the motor
rotates by 2500 ticks, and the knuckle joint moves from 1.94 rad to 0.
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
"""Position of the knuckle joint with closed pads [rad]."""
TRAVEL_TICKS = 2500
TRAVEL_TOLERANCE_TICKS = 400
"""Tolerance of measured positions beyond the ends of the travel [ticks]."""
CALIBRATION_TORQUE = 100
RELAXED_TORQUE = 10
CALIBRATION_TIMEOUT_S = 10.0
MIN_STANDSTILL_S = 0.3
STANDSTILL_TOLERANCE_TICKS = 4
LIMIT_REGISTERS = (mx64.CW_ANGLE_LIMIT, mx64.CCW_ANGLE_LIMIT)


class GripperError(Exception):
    """Raised if the gripper responds but cannot be used; the text contains the remedy."""


@dataclass(frozen=True, slots=True)
class GripperReading:
    """Holds the measurements of a gripper.

    Attributes:
        position: Position of the knuckle joint [rad].
        velocity: Velocity of the knuckle joint, closing positive [rad/s].
        load: Fraction of the full torque in [-1, 1], closing positive.
        temperature: Temperature of the hottest motor [deg C].
        voltage: Minimum supply voltage of the motors [V].
        errors: Error bits of all motors.
    """

    position: float
    velocity: float
    load: float
    temperature: float
    voltage: float
    errors: ServoErrors


@dataclass(slots=True)
class _Servo:
    """Tracks a servo: its zero position [ticks] and the values last written to its RAM."""

    servo_id: int
    zero: int | None = None
    written: dict[Register, int] = field(default_factory=dict)


def joint_from_ticks(ticks: float) -> float:
    """Returns the position of the knuckle joint [rad] for a shaft angle from the zero position [ticks]."""
    return CLOSED_POSITION * (1.0 - ticks / TRAVEL_TICKS)


def ticks_from_joint(position: float) -> int:
    """Returns the shaft angle from the zero position [ticks] for a position of the knuckle joint [rad]."""
    return round(TRAVEL_TICKS * (1.0 - position / CLOSED_POSITION))


def limit_set_point_distance(drive: Drive, position: float, duration_s: float) -> Drive:
    """Limits the distance of the set point, so that fingers stop early if the line is cut: servos have no watchdog.

    Args:
        drive: Command to the motor.
        position: Measured position [rad].
        duration_s: Time for which the motor must have its full torque before the next set point [s].
    """
    if drive.position is None:
        return drive
    ticks = drive.torque * (mx64.TICKS_PER_TORQUE + mx64.MAX_SPEED_TICKS_S / mx64.TORQUE_MAX * duration_s)
    max_offset = ticks * CLOSED_POSITION / TRAVEL_TICKS
    return replace(drive, position=min(max(drive.position, position - max_offset), position + max_offset))


class GripperServos:
    """Drives all servos of a gripper; must be used by a single thread.

    Args:
        bus: Open serial line.
        servo_ids: Identifiers of the servos that move the fingers.
        wait: Callback that waits for a time [s]; raises an exception to end the wait early.
    """

    def __init__(self, bus: DynamixelBus, servo_ids: Sequence[int], wait: Callable[[float], None]) -> None:
        self._bus, self._wait = bus, wait
        self._servos = [_Servo(servo_id) for servo_id in servo_ids]

    @property
    def is_calibrated(self) -> bool:
        """Returns whether the zero positions of all servos are known."""
        return all(servo.zero is not None for servo in self._servos)

    def set_up(self) -> None:
        """Checks the model of each servo and sets its permanent registers.

        Raises:
            BusError: If a servo does not respond.
            GripperError: If a servo is not an MX-64 or MX-106.
        """
        for servo in self._servos:
            model = self._bus.model_number(servo.servo_id)
            if model not in mx64.MODELS:
                known_models = ", ".join(f"{number} ({name})" for number, name in mx64.MODELS.items())
                raise GripperError(
                    f"servo {servo.servo_id} is model {model}; expected {known_models} with protocol 1.0; check the id"
                )
            for register in LIMIT_REGISTERS:
                self._write_if_different(servo, register, mx64.MULTI_TURN_LIMIT)
            self._write_if_different(servo, mx64.MULTI_TURN_OFFSET, 0)
            self._write_if_different(servo, mx64.RESOLUTION_DIVIDER, 1)

    def calibrate(self) -> None:
        """Closes the fingers until they stand still, which defines the zero position; no object may be between them.

        Raises:
            BusError: If a servo does not respond.
            GripperError: If the fingers do not come to a stop or a motor reports an error.
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
        standstill_s = elapsed_s = 0.0
        last_positions: list[int] = []
        while standstill_s < MIN_STANDSTILL_S:
            readings = [self._reading(servo) for servo in self._servos]
            self._check_motor_errors(readings)
            positions = [reading.position for reading in readings]
            stands_still = bool(last_positions) and all(
                abs(a - b) <= STANDSTILL_TOLERANCE_TICKS for a, b in zip(positions, last_positions, strict=True)
            )
            standstill_s = standstill_s + 0.1 if stands_still else 0.0
            last_positions = positions
            if elapsed_s > CALIBRATION_TIMEOUT_S:
                raise GripperError(
                    f"calibration: the fingers still moved after {CALIBRATION_TIMEOUT_S:.0f} s of "
                    "closing; check that the tendon is in place and the fingers meet"
                )
            self._wait(0.1)
            elapsed_s += 0.1

    def _check_motor_errors(self, readings: Sequence[Reading]) -> None:
        hottest = max(reading.temperature for reading in readings)
        lowest = min(reading.voltage for reading in readings)
        for reading in readings:
            if reading.errors & mx64.MOTOR_FAULTS:
                raise GripperError(f"calibration: {describe_errors(reading.errors, hottest, lowest)}")

    def restore_zeros(self) -> bool:
        """Returns whether the servos, after a lost connection, still have the values last written.

        Otherwise, the servos have lost power. In this case, the next `drive` writes all values again, and the
        revolutions of the shafts are determined again, without motion because the travel is below one revolution.

        Raises:
            BusError: If a servo does not respond.
            GripperError: If a shaft is outside the travel; its zero is kept, as a calibration would move the fingers.
        """
        unchanged = all(self._has_written_values(servo) for servo in self._servos)
        for servo in self._servos:
            if servo.zero is None or unchanged:
                continue
            position = self._reading(servo).position
            ticks = (position - servo.zero + TRAVEL_TOLERANCE_TICKS) % mx64.TICKS_PER_TURN - TRAVEL_TOLERANCE_TICKS
            if ticks > TRAVEL_TICKS + TRAVEL_TOLERANCE_TICKS:
                raise GripperError(
                    f"servo {servo.servo_id}: its shaft is outside the travel of the fingers; free the fingers and "
                    "check the tendon, or restart the node to calibrate the fingers again"
                )
            servo.zero = position - ticks
            servo.written.clear()
        return unchanged

    def _has_written_values(self, servo: _Servo) -> bool:
        return mx64.TORQUE_ENABLE in servo.written and all(
            mx64.from_bytes(self._bus.read(servo.servo_id, register)[0]) == value % (1 << 8 * register.size)
            for register, value in servo.written.items()
        )

    def lost_power(self) -> bool:
        """Returns whether a motor is off although its torque was enabled and its servo reports no error.

        Raises:
            BusError: If a servo does not respond.
        """
        return any(
            servo.written.get(mx64.TORQUE_ENABLE) and not any(self._bus.read(servo.servo_id, mx64.TORQUE_ENABLE)[0])
            for servo in self._servos
        )

    def clear_written(self) -> None:
        """Makes the next `drive` write all values, as a motor loses its torque limit when it shuts down."""
        for servo in self._servos:
            servo.written.clear()

    def read(self) -> GripperReading:
        """Returns the measurements of the gripper.

        Raises:
            BusError: If a servo does not respond.
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
        """Sends a command to the motors; writes only changed values.

        Raises:
            BusError: If a servo does not respond.
        """
        for servo in self._servos:
            # A lower torque limit precedes the new goal and a higher limit follows, so the motor exceeds neither limit.
            if drive.position is None or drive.torque < servo.written.get(mx64.TORQUE_LIMIT, 0):
                self._write(servo, mx64.TORQUE_LIMIT, drive.torque)
            if drive.position is None:
                self._write(servo, mx64.GOAL_TORQUE, mx64.direction_word(-drive.direction * drive.torque))
            else:
                self._write(servo, mx64.GOAL_POSITION, (servo.zero or 0) + ticks_from_joint(drive.position))
            self._write(servo, mx64.TORQUE_CONTROL_MODE, int(drive.position is None))
            self._write(servo, mx64.TORQUE_LIMIT, drive.torque)
            self._write(servo, mx64.TORQUE_ENABLE, 1)

    def hold_position(self) -> None:
        """Commands each motor to its current position with its current torque; a motor that is off stays off.

        Raises:
            BusError: If a servo does not respond.
        """
        for servo in self._servos:
            self._write(servo, mx64.GOAL_POSITION, self._reading(servo).position)
            self._write(servo, mx64.TORQUE_CONTROL_MODE, 0)

    def _reading(self, servo: _Servo) -> Reading:
        return mx64.parse_reading(*self._bus.read(servo.servo_id, mx64.READING))

    def _write(self, servo: _Servo, register: Register, value: int) -> None:
        if servo.written.get(register) != value:
            servo.written.pop(register, None)  # if the response is lost, the value is unknown
            self._bus.write(servo.servo_id, register, value)
            servo.written[register] = value

    def _write_if_different(self, servo: _Servo, register: Register, value: int) -> None:
        """Writes a value to the EEPROM only if it differs, because the number of EEPROM writes is limited."""
        if mx64.from_bytes(self._bus.read(servo.servo_id, register)[0]) != value:
            self._bus.write(servo.servo_id, register, value)


def describe_errors(errors: ServoErrors, temperature: float, voltage: float) -> str:
    """Describes the error bits of the motor and the remedies.

    Args:
        errors: Error bits.
        temperature: Temperature of the hottest motor [deg C].
        voltage: Minimum supply voltage [V].
    """
    texts = []
    if errors & ServoErrors.OVERHEATING:
        texts.append(
            f"the motor is too hot ({temperature:.0f} degrees C) and has switched itself off; let it cool, "
            "and hold with a lower torque"
        )
    if errors & ServoErrors.OVERLOAD:
        texts.append("the motor was overloaded and has switched itself off; free the fingers and use a lower torque")
    if errors & ServoErrors.VOLTAGE:
        texts.append(f"the supply voltage of {voltage:.1f} V is outside the servo's limits; check the power supply")
    return "; ".join(texts)
