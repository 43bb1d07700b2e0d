# SPDX-License-Identifier: BSD-3-Clause
"""The state of an emulated UR controller: arm, modes, registers, and the program that runs on it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Protocol

from modular_framework_drivers.emulators.ur_motion import MAX_SERVO_ERROR, ArmMotion, Drive, MotionCommand

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
    """A program on the controller."""

    name: str

    def cycle(self) -> bool:
        """Runs for one cycle; False when it has ended."""


@dataclass(frozen=True, slots=True)
class Model:
    """A kind of controller.

    Attributes:
        name: as the dashboard says it.
        version: of the software: major, minor, bugfix, build.
        frequency: cycles per second.
    """

    name: str
    version: tuple[int, int, int, int]
    frequency: float


MODELS = {"UR5": Model("UR5", (3, 15, 8, 106339), 125.0), "UR5e": Model("UR5", (5, 12, 4, 1101661), 500.0)}


@dataclass(slots=True)
class Registers:
    """The general purpose registers that programs and RTDE clients talk through."""

    ints: list[int] = field(default_factory=lambda: [0] * REGISTERS)
    doubles: list[float] = field(default_factory=lambda: [0.0] * REGISTERS)


class UrController:
    """Controller and arm.

    Args:
        model: kind of controller.
        positions: joint positions at the beginning [rad].
        unlock_delay_s: how long after a protective stop it cannot be unlocked; 5 s on the real one [s].
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
        """Duration of a cycle [s]."""
        return 1.0 / self.model.frequency

    @property
    def target_positions(self) -> Sequence[float]:
        """Commanded positions of the joints [rad]."""
        command = self.motion.command
        return command.target if command.drive in (Drive.SERVO, Drive.MOVE) else self.motion.positions

    @property
    def streamed(self) -> bool:
        """Whether the joints follow positions that a client streams."""
        return self.motion.command.drive is Drive.SERVO

    @property
    def speed_scaling(self) -> float:
        """Share of its pace at which the program moves the arm, beside the slider: 1, or 0 while it is paused."""
        return 0.0 if self.runtime_state is RuntimeState.PAUSED else 1.0

    @property
    def safety_status_bits(self) -> int:
        """`safety_status_bits` of RTDE."""
        return _SAFETY_BITS[self.safety_mode]

    @property
    def robot_status_bits(self) -> int:
        """`robot_status_bits` of RTDE."""
        powered = self.robot_mode is not RobotMode.POWER_OFF
        return int(powered) | int(self.runtime_state is RuntimeState.PLAYING) << 1

    def cycle(self) -> None:
        """Runs program and arm for one cycle."""
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
        """Runs a program in place of what runs, whose motion ends; False when the arm is not ready for one."""
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
        """Pause the program; False when none plays."""
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
        """Stops as for a collision; the program ends."""
        self.stop_program()
        if self.safety_mode is SafetyMode.NORMAL:
            self.safety_mode = SafetyMode.PROTECTIVE_STOP
            self._stopped_at_s = self.time_s

    def unlock(self) -> bool:
        """Release the protective stop; False while it is too early."""
        if self.time_s - self._stopped_at_s < self._unlock_delay_s:
            return False
        if self.safety_mode is SafetyMode.PROTECTIVE_STOP:
            self.safety_mode = SafetyMode.NORMAL
        return True

    def emergency_stop(self) -> None:
        """Press the red button: power is cut."""
        self.stop_program()
        self.safety_mode = SafetyMode.ROBOT_EMERGENCY_STOP
        self.robot_mode = RobotMode.POWER_OFF

    def release_emergency_stop(self) -> None:
        """Pull the red button; the arm stays without power."""
        if self.safety_mode is SafetyMode.ROBOT_EMERGENCY_STOP:
            self.safety_mode = SafetyMode.NORMAL

    def power_on(self) -> None:
        """Switches the arm on, with its brakes closed."""
        if self.robot_mode is RobotMode.POWER_OFF and self.safety_mode is not SafetyMode.ROBOT_EMERGENCY_STOP:
            self.robot_mode = RobotMode.IDLE

    def power_off(self) -> None:
        """Switches the arm off."""
        self.stop_program()
        self.robot_mode = RobotMode.POWER_OFF

    def brake_release(self) -> None:
        """Makes the arm ready to move; switches it on if need be."""
        self.power_on()
        if self.robot_mode is RobotMode.IDLE:
            self.robot_mode = RobotMode.RUNNING


HOME = (0.0, -1.5707963267948966, 0.0, -1.5707963267948966, 0.0, 0.0)
