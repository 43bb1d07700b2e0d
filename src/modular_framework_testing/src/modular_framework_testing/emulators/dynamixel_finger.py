# SPDX-License-Identifier: BSD-3-Clause
"""Simulates the mechanics of an emulated gripper servo: motor, fingers with two end stops, and an optional object.

The model is simple but sufficient for a driver: the speed follows the motor's duty with one time constant, friction
takes up a fraction of the duty, and contacts act like springs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from modular_framework_drivers.ezgripper import mx64
from modular_framework_drivers.ezgripper.mx64 import ServoErrors
from modular_framework_testing.emulators.dynamixel_servo import DynamixelServo

STEP_S = 0.002


@dataclass(frozen=True, slots=True)
class FingerModel:
    """Holds the parameters of the model.

    Attributes:
        closed_ticks: Shaft angle of closed pads [ticks], in any revolution.
        travel_ticks: Travel from closed pads to the stop of the open fingers [ticks].
        shut_ticks: Maximum opening of closed fingers [ticks].
        object_room_ticks: Minimum clearance around an object that appears between the fingers [ticks].
        top_speed: No-load speed at full duty [ticks/s]; 63 revolutions per minute for an MX-64 at 12 V.
        time_constant_s: Time constant of the speed [s].
        torque_mode_gain: Ratio of the no-load speeds in torque control mode and in position control at equal torque
            words; torque control holds the current, so the voltage rises with the speed.
        friction: Maximum duty without motion, in [0, 1].
        stiffness: Stiffness of stops and objects: duty per tick of penetration [1/tick].
        overload_fraction: Minimum duty of an overload, in [0, 1].
        overload_s: Minimum duration of an overload [s].
        room_temperature: Temperature of the room [deg C].
        heating: Temperature rise at full duty without motion [K/s].
        cooling: Fraction of the excess over the room temperature lost per second [1/s].
    """

    closed_ticks: float = -150.0
    travel_ticks: float = 2560.0
    shut_ticks: float = 40.0
    object_room_ticks: float = 100.0
    top_speed: float = 63.0 / 60.0 * 4096.0
    time_constant_s: float = 0.04
    torque_mode_gain: float = 3.0
    friction: float = 0.03
    stiffness: float = 0.01
    overload_fraction: float = 0.7
    overload_s: float = 2.0
    room_temperature: float = 30.0
    heating: float = 0.5
    cooling: float = 0.01


class Finger:
    """Simulates the moving parts of one servo; `advance` writes the measurements to the servo.

    Args:
        servo: Servo whose registers contain the commands.
        model: Parameters of the model.
        opening: Initial opening from the closed fingers [ticks].
    """

    def __init__(self, servo: DynamixelServo, model: FingerModel | None = None, opening: float = 400.0) -> None:
        self.servo, self.model = servo, model or FingerModel()
        self.angle = self.model.closed_ticks + opening
        self.speed = 0.0
        self.temperature = self.model.room_temperature
        self.object_opening: float | None = None
        self.offered_opening: float | None = None
        self._was_shut = False
        self._duty = 0.0
        self._overloaded_s = 0.0
        self._remaining_s = 0.0
        self._publish()

    @property
    def opening(self) -> float:
        """Returns the opening of the fingers from the closed stop [ticks]."""
        return self.angle - self.model.closed_ticks

    def advance(self, duration_s: float) -> None:
        """Simulates a time [s] in steps that are short enough for the stiff contacts."""
        self._remaining_s += duration_s
        while self._remaining_s >= STEP_S:
            self._remaining_s -= STEP_S
            self._step(STEP_S)
        self._take_offered()
        self._publish()

    def _take_offered(self) -> None:
        """Places an offered object between open fingers once they have been closed, as during the calibration."""
        self._was_shut |= self.opening < self.model.shut_ticks
        if (
            self.offered_opening is not None
            and self._was_shut
            and self.opening > self.offered_opening + self.model.object_room_ticks
        ):
            self.object_opening, self.offered_opening = self.offered_opening, None

    def power_cycle(self) -> None:
        """Resets the revolution count after a loss of power: the encoder measures a single revolution."""
        turns = math.floor(self.angle / mx64.TICKS_PER_TURN) * mx64.TICKS_PER_TURN
        self.angle -= turns
        self.model = replace(self.model, closed_ticks=self.model.closed_ticks - turns)
        self.servo.power_cycle()

    def _step(self, period_s: float) -> None:
        model = self.model
        self._duty = self._target_duty()
        pushed = self._duty - self._resistance()
        free = math.copysign(max(0.0, abs(pushed) - model.friction), pushed)
        gain = model.torque_mode_gain if self.servo.get(mx64.TORQUE_CONTROL_MODE) else 1.0
        wanted = max(-1.0, min(1.0, free * gain)) * model.top_speed
        self.speed += (wanted - self.speed) * min(1.0, period_s / model.time_constant_s)
        self.angle += self.speed * period_s
        self._heat(period_s)

    def _target_duty(self) -> float:
        """Returns the duty of the motor, counter-clockwise (opening) positive."""
        servo = self.servo
        limit = servo.get(mx64.TORQUE_LIMIT) / mx64.TORQUE_MAX
        if not servo.get(mx64.TORQUE_ENABLE):
            return 0.0
        if servo.get(mx64.TORQUE_CONTROL_MODE):
            wanted = mx64.from_direction_word(servo.get(mx64.GOAL_TORQUE)) / mx64.TORQUE_MAX
        else:
            error = mx64.from_signed_word(servo.get(mx64.GOAL_POSITION)) - self.angle
            wanted = servo.get(mx64.P_GAIN) / 8.0 * error / mx64.TORQUE_MAX
        return max(-limit, min(limit, wanted))

    def _resistance(self) -> float:
        """Returns the duty taken up by the stops and the object, positive against opening."""
        model, opening = self.model, self.opening
        lower = 0.0 if self.object_opening is None else max(0.0, self.object_opening)
        return model.stiffness * (min(0.0, opening - lower) + max(0.0, opening - model.travel_ticks))

    def _heat(self, period_s: float) -> None:
        model = self.model
        excess = self.temperature - model.room_temperature
        self.temperature += (model.heating * self._duty**2 - model.cooling * excess) * period_s
        pressing = abs(self._duty) > model.overload_fraction and abs(self.speed) < 0.05 * model.top_speed
        in_torque_mode = bool(self.servo.get(mx64.TORQUE_CONTROL_MODE))
        self._overloaded_s = self._overloaded_s + period_s if pressing and not in_torque_mode else 0.0
        if self._overloaded_s > model.overload_s:
            self.servo.shut_down(ServoErrors.OVERLOAD)
        if self.temperature > self.servo.get(mx64.TEMPERATURE_LIMIT):
            self.servo.shut_down(ServoErrors.OVERHEATING)
        else:
            self.servo.errors &= ~ServoErrors.OVERHEATING

    def _publish(self) -> None:
        servo = self.servo
        position = round(self.angle)
        servo.set(mx64.PRESENT_POSITION, position if servo.multi_turn else position % mx64.TICKS_PER_TURN)
        servo.set(mx64.PRESENT_SPEED, mx64.direction_word(round(self.speed / mx64.SPEED_UNIT_TICKS_S)))
        servo.set(mx64.PRESENT_LOAD, mx64.direction_word(round(self._duty * mx64.TORQUE_MAX)))
        servo.set(mx64.PRESENT_TEMPERATURE, round(self.temperature))
        servo.set(mx64.MOVING, abs(self.speed) > mx64.SPEED_UNIT_TICKS_S)
