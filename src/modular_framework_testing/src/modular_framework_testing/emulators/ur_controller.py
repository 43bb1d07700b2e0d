# SPDX-License-Identifier: BSD-3-Clause
"""Holds the state of an emulated UR controller: arm, modes, registers, and the running program."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Protocol

from modular_framework_testing.emulators.ur_motion import MAX_SERVO_ERROR, ArmMotion, Drive, MotionCommand

LOGGER = logging.getLogger("rosout.ur_emulator")
REGISTERS = 48
PROTECTIVE_STOP_DECELERATION = 20.0  # [rad/s^2]


class RobotMode(IntEnum):
    """`robot_mode` of RTDE."""

    POWER_OFF = 3
    POWER_ON = 4
    IDLE = 5
    RUNNING = 7


class SafetyMode(IntEnum):
    """`safety_mode` of RTDE."""

    NORMAL = 1
    PROTECTIVE_STOP = 3
    ROBOT_EMERGENCY_STOP = 7


class RuntimeState(IntEnum):
    """`runtime_state` of RTDE."""

    STOPPED = 1
    PLAYING = 2
    PAUSED = 4


_SAFETY_BITS = {
    SafetyMode.NORMAL: 1 << 0,
    SafetyMode.PROTECTIVE_STOP: 1 << 2 | 1 << 10,
    SafetyMode.ROBOT_EMERGENCY_STOP: 1 << 6 | 1 << 7 | 1 << 10,
}


class Program(Protocol):
    """Interface of a program on the controller."""

    name: str

    def cycle(self) -> bool:
        """Runs for one cycle; returns False once the program has ended."""


@dataclass(frozen=True, slots=True)
class Model:
    """Describes a model of the controller.

    Attributes:
        name: Model name in the dashboard.
        version: Software version: major, minor, bugfix, build.
        frequency: Control frequency [Hz].
    """

    name: str
    version: tuple[int, int, int, int]
    frequency: float


MODELS = {"UR5": Model("UR5", (3, 15, 8, 106339), 125.0), "UR5e": Model("UR5", (5, 12, 4, 1101661), 500.0)}


@dataclass(slots=True)
class Registers:
    """Holds the general purpose registers through which programs and RTDE clients communicate."""

    ints: list[int] = field(default_factory=lambda: [0] * REGISTERS)
    doubles: list[float] = field(default_factory=lambda: [0.0] * REGISTERS)


class UrController:
    """Emulates a controller and its arm.

    Args:
        model: Model of the controller.
        positions: Initial joint positions [rad].
        unlock_delay_s: Minimum time from a protective stop to its release [s]; 5 s on a real controller.
    """

    def __init__(self, model: Model, positions: Sequence[float], unlock_delay_s: float = 5.0) -> None:
        self.model = model
        self.motion = ArmMotion(positions)
        self.inputs = Registers()
        self.outputs = Registers()
        self.robot_mode = RobotMode.RUNNING
        self.safety_mode = SafetyMode.NORMAL
        self.runtime_state = RuntimeState.STOPPED
        self.speed_slider = 1.0
        self.wrench: tuple[float, ...] = (0.0,) * 6
        self.digital_outputs = 0
        self.payload_kg = 0.0
        self.payload_centre_m: tuple[float, ...] = (0.0, 0.0, 0.0)
        self.time_s = 0.0
        self.program: Program | None = None
        self.on_cycle: Callable[[], None] | None = None
        self._unlock_delay_s = unlock_delay_s
        self._stopped_at_s = 0.0

    @property
    def period_s(self) -> float:
        """Returns the period of a cycle [s]."""
        return 1.0 / self.model.frequency

    @property
    def target_positions(self) -> Sequence[float]:
        """Returns the commanded joint positions [rad]."""
        command = self.motion.command
        return command.target if command.drive in (Drive.SERVO, Drive.MOVE) else self.motion.positions

    @property
    def is_streaming(self) -> bool:
        """Returns whether the joints follow positions streamed by a client."""
        return self.motion.command.drive is Drive.SERVO

    @property
    def speed_scaling(self) -> float:
        """Returns the speed scaling factor of the program, besides the slider: 1, or 0 during a pause."""
        return 0.0 if self.runtime_state is RuntimeState.PAUSED else 1.0

    @property
    def safety_status_bits(self) -> int:
        """Returns `safety_status_bits` of RTDE."""
        return _SAFETY_BITS[self.safety_mode]

    @property
    def robot_status_bits(self) -> int:
        """Returns `robot_status_bits` of RTDE."""
        powered = self.robot_mode is not RobotMode.POWER_OFF
        return int(powered) | int(self.runtime_state is RuntimeState.PLAYING) << 1

    def cycle(self) -> None:
        """Runs the program and the arm for one cycle."""
        self.time_s += self.period_s
        if self.program is not None and self.runtime_state is RuntimeState.PLAYING and not self.program.cycle():
            self.stop_program()
        self.motion.step(self.period_s, self.speed_slider * self.speed_scaling)
        if self.motion.servo_error > MAX_SERVO_ERROR:
            LOGGER.warning(
                "the arm is %.3f rad behind its servo target, %.1f rad are allowed: protective stop",
                self.motion.servo_error,
                MAX_SERVO_ERROR,
            )
            self.protective_stop()
        if self.on_cycle is not None:
            self.on_cycle()

    def start_program(self, program: Program) -> bool:
        """Runs a program and ends the previous program and its motion; returns False if the arm is not ready."""
        if self.robot_mode is not RobotMode.RUNNING or self.safety_mode is not SafetyMode.NORMAL:
            LOGGER.warning(
                "program %s not started: robot mode %s, safety mode %s",
                program.name,
                self.robot_mode.name,
                self.safety_mode.name,
            )
            return False
        self.stop_program()
        self.program = program
        self.runtime_state = RuntimeState.PLAYING
        return True

    def stop_program(self) -> None:
        """Ends the program; the arm comes to rest."""
        self.program = None
        self.runtime_state = RuntimeState.STOPPED
        self.motion.set_command(MotionCommand(Drive.STOP, acceleration=PROTECTIVE_STOP_DECELERATION))

    def pause(self) -> bool:
        """Pauses the program; returns False if no program is playing."""
        if self.runtime_state is not RuntimeState.PLAYING:
            return False
        self.runtime_state = RuntimeState.PAUSED
        return True

    def play(self) -> bool:
        """Resumes a paused program; returns False if none is paused."""
        if self.runtime_state is not RuntimeState.PAUSED:
            return False
        self.runtime_state = RuntimeState.PLAYING
        return True

    def protective_stop(self) -> None:
        """Stops the arm as after a collision, and ends the program."""
        self.stop_program()
        if self.safety_mode is SafetyMode.NORMAL:
            self.safety_mode = SafetyMode.PROTECTIVE_STOP
            self._stopped_at_s = self.time_s

    def unlock(self) -> bool:
        """Releases the protective stop; returns False before the unlock delay has passed."""
        if self.time_s - self._stopped_at_s < self._unlock_delay_s:
            return False
        if self.safety_mode is SafetyMode.PROTECTIVE_STOP:
            self.safety_mode = SafetyMode.NORMAL
        return True

    def emergency_stop(self) -> None:
        """Presses the emergency stop button, which cuts the power."""
        self.stop_program()
        self.safety_mode = SafetyMode.ROBOT_EMERGENCY_STOP
        self.robot_mode = RobotMode.POWER_OFF

    def release_emergency_stop(self) -> None:
        """Releases the emergency stop button; the arm remains without power."""
        if self.safety_mode is SafetyMode.ROBOT_EMERGENCY_STOP:
            self.safety_mode = SafetyMode.NORMAL

    def power_on(self) -> None:
        """Switches the arm on with closed brakes."""
        if self.robot_mode is RobotMode.POWER_OFF and self.safety_mode is not SafetyMode.ROBOT_EMERGENCY_STOP:
            self.robot_mode = RobotMode.IDLE

    def power_off(self) -> None:
        """Switches the arm off."""
        self.stop_program()
        self.robot_mode = RobotMode.POWER_OFF

    def brake_release(self) -> None:
        """Releases the brakes, and switches the arm on if necessary."""
        self.power_on()
        if self.robot_mode is RobotMode.IDLE:
            self.robot_mode = RobotMode.RUNNING


HOME = (0.0, -1.5707963267948966, 0.0, -1.5707963267948966, 0.0, 0.0)
