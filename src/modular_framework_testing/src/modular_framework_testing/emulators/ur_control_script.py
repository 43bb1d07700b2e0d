# SPDX-License-Identifier: BSD-3-Clause
"""Emulates the program that ur-rtde uploads to a controller, without interpreting URScript.

In every cycle, ur-rtde's control script reads a command from an integer register and its arguments from the adjacent
registers. Streamed commands run in every cycle. Any other command runs once, when the register changes from NONE to the
command; then the script reports completion in its state register and waits until the command is cleared. The numbers of
the commands and the registers are those of ur-rtde 1.6.
"""

from __future__ import annotations

import logging
import re
from enum import IntEnum

from modular_framework_testing.emulators.ur_controller import UrController
from modular_framework_testing.emulators.ur_motion import JOINTS, Drive, MotionCommand

LOGGER = logging.getLogger("rosout.ur_emulator")
_MARK = "RTDE Control Script Loaded"
_OFFSET = re.compile(r"reg_offset_int = # int register offset\s*(\d+)")
_HEADING = re.compile(r"^(?:def|sec) +(\w+)", re.MULTILINE)
READY, DONE = 1, 2


class Command(IntEnum):
    """Emulated commands of the control script."""

    NONE = 0
    MOVEJ = 1
    ZERO_FT_SENSOR = 8
    SPEEDJ = 9
    SERVOJ = 11
    SPEED_STOP = 15
    SERVO_STOP = 16
    SET_PAYLOAD = 17
    GET_STEPTIME = 26
    SET_TCP = 29
    PROTECTIVE_STOP = 31
    STOPL = 33
    STOPJ = 34
    SET_WATCHDOG = 35
    JOINTS_WITHIN_LIMITS = 37
    KICK_WATCHDOG = 99
    STOP_SCRIPT = 255


_STREAMED = (Command.SPEEDJ, Command.SERVOJ, Command.GET_STEPTIME)


class UnknownProgramError(Exception):
    """Raised if an uploaded program is not ur-rtde's control script."""


class ControlScript:
    """Emulates the running control script.

    Args:
        controller: Controller that runs the script.
        offset: Index of the first used register.
    """

    def __init__(self, controller: UrController, offset: int = 0) -> None:
        self.name = "rtde_control"
        self._controller = controller
        self._offset = offset
        self._executing = False
        self._moving = False
        self._watchdog_s = 0.0
        self._last_command_s = controller.time_s
        self._report(READY)

    @classmethod
    def from_text(cls, controller: UrController, text: str) -> ControlScript:
        """Returns the script in an uploaded text.

        Raises:
            UnknownProgramError: If the text is another program, as the emulator does not interpret URScript.
        """
        heading = _HEADING.search(text)
        if _MARK not in text:
            name = heading.group(1) if heading else text[:40]
            raise UnknownProgramError(f"program {name!r} is not run: only the control script of ur-rtde is known")
        offset = _OFFSET.search(text)
        return cls(controller, int(offset.group(1)) if offset else 0)

    def cycle(self) -> bool:
        """Runs one cycle of the script; returns False once the script has ended."""
        if self._moving:
            if not self._controller.motion.is_finished:
                return True
            self._moving = False
            self._controller.motion.set_command(MotionCommand(Drive.HOLD))
            self._report(DONE)
        command = self._controller.inputs.ints[self._offset]
        if command != Command.NONE:
            self._last_command_s = self._controller.time_s
        elif 0.0 < self._watchdog_s < self._controller.time_s - self._last_command_s:
            LOGGER.warning("no command for %.3f s: the watchdog ends the program", self._watchdog_s)
            return False
        if command == Command.NONE or command in _STREAMED:
            self._executing = False
            self._stream(command)
            self._report(READY)
        elif not self._executing:
            self._executing = True
            return self._execute(command)
        return True

    def _report(self, state: int) -> None:
        self._controller.outputs.ints[self._offset] = state

    def _doubles(self, first: int, count: int) -> tuple[float, ...]:
        start = self._offset + first
        return tuple(self._controller.inputs.doubles[start : start + count])

    def _stream(self, command: int) -> None:
        motion = self._controller.motion
        if command == Command.SERVOJ:
            (lookahead_s,) = self._doubles(9, 1)
            motion.set_command(MotionCommand(Drive.SERVO, self._doubles(0, JOINTS), lookahead_s=max(lookahead_s, 0.03)))
        elif command == Command.SPEEDJ:
            (acceleration,) = self._doubles(6, 1)
            motion.set_command(MotionCommand(Drive.SPEED, self._doubles(0, JOINTS), acceleration=acceleration))
        elif command == Command.GET_STEPTIME:
            self._controller.outputs.doubles[self._offset] = self._controller.period_s

    def _execute(self, command: int) -> bool:
        """Starts a command that is not streamed; returns False if the program ends."""
        controller = self._controller
        match command:
            case Command.STOP_SCRIPT:
                return False
            case Command.MOVEJ:
                velocity, acceleration = self._doubles(6, 2)
                controller.motion.set_command(
                    MotionCommand(Drive.MOVE, self._doubles(0, JOINTS), velocity, acceleration)
                )
                self._moving = True
                return True
            case Command.SPEED_STOP | Command.SERVO_STOP | Command.STOPL | Command.STOPJ:
                (deceleration,) = self._doubles(0, 1)
                controller.motion.set_command(MotionCommand(Drive.STOP, acceleration=deceleration))
                self._moving = True
                return True
            case Command.SET_PAYLOAD:
                controller.payload_kg, *centre = self._doubles(0, 4)
                controller.payload_centre_m = tuple(centre)
            case Command.SET_WATCHDOG:
                (frequency,) = self._doubles(0, 1)
                self._watchdog_s = 1.0 / frequency if frequency > 0.0 else 0.0
            case Command.PROTECTIVE_STOP:
                controller.protective_stop()
            case Command.JOINTS_WITHIN_LIMITS:
                inside = all(abs(position) <= 6.2831853072 for position in self._doubles(0, JOINTS))
                controller.outputs.ints[self._offset + 1] = int(inside)
            case Command.ZERO_FT_SENSOR:
                controller.wrench = (0.0,) * 6
            case Command.SET_TCP | Command.KICK_WATCHDOG:
                pass
            case _:
                LOGGER.error("command %d of the control script is not emulated: the program ends", command)
                return False
        self._report(DONE)
        return True


class ProgramReceiver:
    """Collects the text received on a script port and starts the programs in this text.

    Args:
        controller: Controller that runs the programs.
    """

    def __init__(self, controller: UrController) -> None:
        self._controller = controller
        self._text = ""

    def receive(self, data: bytes) -> None:
        """Adds received data; a program ends with a line `end`, a single command at the end of its line."""
        self._text += data.decode("utf-8", errors="replace")
        while "\n" in self._text:
            if not self._text.startswith(("def ", "sec ")):
                line, _, self._text = self._text.partition("\n")
                if line.strip():
                    LOGGER.info("script command not run: %s", line[:80])
                continue
            end = self._text.find("\nend\n")
            if end < 0:
                return
            program, self._text = self._text[: end + 5], self._text[end + 5 :]
            self._start(program)

    def _start(self, text: str) -> None:
        try:
            script = ControlScript.from_text(self._controller, text)
        except UnknownProgramError as error:
            LOGGER.error("%s", error)
            return
        if self._controller.start_program(script):
            LOGGER.info("program %s of %d characters runs", script.name, len(text))
