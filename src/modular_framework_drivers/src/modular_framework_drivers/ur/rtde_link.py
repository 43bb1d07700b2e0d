# SPDX-License-Identifier: BSD-3-Clause
"""The connection to an arm as the control loop sees it: the newest state, and whether commands get through.

Two processes hold ur-rtde (rtde_process.py). A thread starts them, and starts them again when a connection fails; the
control loop only takes datagrams from them and sends datagrams to them.
"""
from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

from modular_framework_drivers.ur.arm_messages import FAILED, READY, STATE, ArmState, servo_message
from modular_framework_drivers.ur.arm_modes import robot_fault
from modular_framework_drivers.ur.child_process import ChildProcess

LOGGER = logging.getLogger("rosout.ur_arm")
_MODULE = "modular_framework_drivers.ur.rtde_process"
_KEEPER_PERIOD_S = 0.02
_RETRY_S = 0.5                  # between two attempts to connect
_CONNECT_TIMEOUT_S = 5.0        # for the first state
_PROGRAM_TIMEOUT_S = 15.0       # for the upload of the program
_STOP_PATIENCE_S = 1.5          # for the arm to come to rest when the link is closed
_MAX_POSITION = 2.0 * math.pi + 0.2
_MAX_SPEED = 2.0 * math.pi      # of a measured joint; twice what a UR5's does [rad/s]


@dataclass(frozen=True, slots=True)
class LinkSettings:
    """How to reach an arm.

    Attributes:
        address: of its controller.
        timeout_s: without news for so long the link counts as lost [s].
        speed_scale: what to set its speed slider to, None to leave it, 0 to 1.
        payload_kg: mass of the manipulator [kg].
        payload_centre_m: its centre of mass in the flange frame [m].
        lookahead_s: of servoj, 0.03 to 0.2 [s].
        gain: of servoj, 100 to 2000.
    """

    address: str
    timeout_s: float = 0.12
    speed_scale: float | None = None
    payload_kg: float = 0.0
    payload_centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lookahead_s: float = 0.03
    gain: float = 2000.0


@dataclass(slots=True)
class _Stream:
    """A process that reads states, since when, and whether it delivered any or has failed."""

    process: ChildProcess
    since_s: float
    delivered: bool = False
    failed: bool = False


class RtdeLink:
    """Connection to one arm.

    `poll` and `servo` belong to the control loop; `request_program`, `connect` and `close` to other threads.

    Args:
        settings: how to reach it.
    """

    def __init__(self, settings: LinkSettings) -> None:
        self._settings = settings
        self._closing = threading.Event()
        self._keeper: threading.Thread | None = None
        self._states: _Stream | None = None
        self._control: ChildProcess | None = None
        self._given_up: ChildProcess | None = None
        self._control_since_s = 0.0
        self._program_wanted = False
        self.state: ArmState | None = None
        self.lost = "the first attempt is under way"
        self.commanding = False
        self.program_failure = ""
        self.program_failed_s = 0.0

    def connect(self) -> None:
        """Begin to connect, and go on until `close`; returns at once."""
        self._keeper = threading.Thread(target=self._keep, name="ur_link", daemon=True)
        self._keeper.start()

    def close(self) -> None:
        """End the connection and stop the arm; may be called twice."""
        self._closing.set()
        if self._keeper is not None:
            self._keeper.join(timeout=10.0)
            self._keeper = None

    def request_program(self) -> None:
        """Have the program that takes commands uploaded as soon as the arm is connected."""
        self.program_failure = ""
        self._program_wanted = True

    def drop_program(self, reason: str) -> None:
        """Give up commanding until the next `request_program`."""
        self.commanding = False
        self._program_wanted = False
        self._given_up = self._control
        self.program_failure = reason
        self.program_failed_s = time.monotonic()

    def poll(self) -> None:
        """Take in what the processes have said."""
        now_s = time.monotonic()
        states, control = self._states, self._control
        if states is not None:
            self._take_states(states, now_s)
        if control is not None:
            self._take_answers(control)

    def servo(self, positions: Sequence[float], time_s: float) -> bool:
        """Send the joints to `positions` [rad] within `time_s` [s]; False when that could not be sent."""
        control = self._control
        return self.commanding and control is not None and control.send(servo_message(positions, time_s))

    def _take_states(self, stream: _Stream, now_s: float) -> None:
        newest: ArmState | None = None
        for message in stream.process.messages():
            if message[:1] == STATE:
                newest = ArmState.unpacked(message)
            elif message[:1] == FAILED:
                self._lose(stream, message[1:].decode(errors="replace"))
        if stream.failed:
            return
        if newest is not None and self._plausible(newest):
            if self.lost:
                LOGGER.info("arm at %s: connected", self._settings.address)
            self.state, self.lost, stream.delivered = newest, "", True
        if stream.process.ended:
            self._lose(stream, "the process that reads the arm's state ended")
        elif stream.delivered and self.state is not None \
                and now_s - self.state.received_s > self._settings.timeout_s:
            self._lose(stream, f"nothing from the arm for {self._settings.timeout_s:g} s")

    def _plausible(self, state: ArmState) -> bool:
        """Whether an arm can be in that state so soon after the last one; garbage on the line cannot."""
        if not all(abs(position) <= _MAX_POSITION for position in state.positions):
            return False
        if self.lost or self.state is None:
            return True
        reach = _MAX_SPEED * (state.received_s - self.state.received_s) + 0.05
        return all(abs(new - old) <= reach for new, old in zip(state.positions, self.state.positions, strict=True))

    def _lose(self, stream: _Stream, reason: str) -> None:
        if not self.lost:
            LOGGER.error("arm at %s: link lost: %s", self._settings.address, reason)
            self.drop_program("its program was given up when the link was lost")
        if not stream.failed:
            stream.failed = True
            self.lost = reason

    def _take_answers(self, control: ChildProcess) -> None:
        for message in control.messages():
            if message == READY:
                self.commanding = self._program_wanted
            elif message[:1] == FAILED:
                self.drop_program(message[1:].decode(errors="replace"))
        if control.ended and self._program_wanted:
            self.drop_program("the process that commands the arm ended")

    def _keep(self) -> None:
        next_attempt_s = 0.0
        while not self._closing.wait(_KEEPER_PERIOD_S):
            now_s = time.monotonic()
            try:
                if self._states is not None and self._is_over(self._states, now_s):
                    stream, self._states = self._states, None
                    stream.process.end()
                    next_attempt_s = now_s + _RETRY_S
                elif self._states is None and now_s >= next_attempt_s:
                    next_attempt_s = now_s + _RETRY_S
                    self._states = _Stream(self._start("state", ["--timeout", str(self._settings.timeout_s)]), now_s)
                self._keep_program(now_s)
            except OSError as error:
                self._tell_not_started(error)
        if self._states is not None:
            self._states.process.end()
        if self._control is not None:
            self._control.end(_STOP_PATIENCE_S)
        self._states = self._control = None

    def _tell_not_started(self, error: OSError) -> None:
        reason = f"a process for it cannot be started: {error}; free memory, processes or open files of this computer"
        if self._states is None:
            self.lost = reason
        else:
            self.drop_program(reason)

    def _is_over(self, stream: _Stream, now_s: float) -> bool:
        if not stream.delivered and not stream.failed and now_s - stream.since_s > _CONNECT_TIMEOUT_S:
            stream.failed = True
            self.lost = f"no state from the arm within {_CONNECT_TIMEOUT_S:g} s of connecting"
        return stream.failed

    def _keep_program(self, now_s: float) -> None:
        wanted = self._program_wanted and not self.lost
        possible = self.state is not None and not robot_fault(self.state, self._settings.address)
        if self._control is not None and (not wanted or self._control.ended or self._control is self._given_up):
            process, self._control = self._control, None
            process.end()
        elif self._control is None and wanted and possible:
            settings = self._settings
            scale = [] if settings.speed_scale is None else ["--speed-scale", str(settings.speed_scale)]
            self._control = self._start("control", [
                *scale, "--payload", str(settings.payload_kg), "--payload-centre",
                *map(str, settings.payload_centre_m), "--lookahead", str(settings.lookahead_s),
                "--gain", str(settings.gain)])
            self._control_since_s = now_s
        elif self._control is not None and not self.commanding and now_s - self._control_since_s > _PROGRAM_TIMEOUT_S:
            self.drop_program(f"the program was not accepted within {_PROGRAM_TIMEOUT_S:g} s")

    def _start(self, role: str, arguments: Sequence[str]) -> ChildProcess:
        return ChildProcess(_MODULE, [role, self._settings.address, *arguments])

