# SPDX-License-Identifier: BSD-3-Clause
"""Connects the control loop to an arm: provides the newest state, and sends commands.

Two processes run ur-rtde (rtde_process.py). A thread starts them, and restarts them after a connection failure; the
control loop only exchanges datagrams with them. The process that reads the arm detects a silent arm, because a delayed
control loop cannot distinguish a silent arm from its own delay.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass

from modular_framework_drivers.ur.arm_messages import (
    ACCEPTED,
    CONNECTING,
    FAILED,
    READY,
    STATE,
    ArmState,
    servo_message,
)
from modular_framework_drivers.ur.arm_modes import PROGRAM_PLAYING, robot_fault
from modular_framework_drivers.ur.child_process import ChildProcess
from modular_framework_drivers.ur.state_watch import SilenceWatch

START_TIMEOUT_S = 30.0  # start timeout of a process, even on a busy computer
LOGGER = logging.getLogger("rosout.ur_arm")
_MODULE = "modular_framework_drivers.ur.rtde_process"
_KEEPER_PERIOD_S = 0.02
_CONNECT_TIMEOUT_S = 5.0  # maximum time from the start of a process to the first state
_PROGRAM_TIMEOUT_S = 15.0  # maximum time from the start of a process until the program runs
_SILENCE_MARGIN_S = 0.38  # allowed silence of a process beyond `timeout_s`
_MAX_RETRY_S = 2.0  # maximum time between attempts; each attempt takes 0.3 s of a processor to start an interpreter
_STOP_PATIENCE_S = 3.0  # maximum time of the arm to come to rest when the link is closed
_STOP_TIMEOUT_S = 0.1  # time of an ended process to send its stop after all queued commands


@dataclass(frozen=True, slots=True)
class LinkSettings:
    """Holds the connection settings of an arm.

    Attributes:
        address: Address of the controller.
        timeout_s: Time without a state after which the connection is lost [s].
        speed_scale: Initial speed slider in [0, 1], never raised after the first command; None for no change.
        payload_kg: Mass of the payload [kg].
        payload_centre_m: Centre of mass of the payload in the flange frame [m].
        lookahead_s: Lookahead time of servoj, 0.03 to 0.2 [s].
        gain: Gain of servoj, 100 to 2000.
        real_time: Whether the processes that run ur-rtde request real-time scheduling.
        retry_s: Time between two connection attempts [s]; doubles after each failure, up to 2 s.
    """

    address: str
    _: KW_ONLY
    timeout_s: float = 0.12
    speed_scale: float | None = None
    payload_kg: float = 0.0
    payload_centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lookahead_s: float = 0.03
    gain: float = 2000.0
    real_time: bool = True
    retry_s: float = 0.5


class _RtdeProcess:
    """Tracks a process that runs ur-rtde.

    Attributes:
        process: Child process.
        working: Whether the process has sent a state or is ready for commands.
        connecting: Whether the process has started.
        failed: Whether the process must be replaced.
        silence: Time without an expected message.
        awaits_message: Whether a message is expected.
    """

    __slots__ = ("process", "connecting", "working", "failed", "silence", "awaits_message", "_timeout_s", "_since_s")

    def __init__(self, process: ChildProcess, now_s: float) -> None:
        self.process = process
        self.connecting = self.working = self.failed = self.awaits_message = False
        self.silence = SilenceWatch(now_s)
        self._since_s, self._timeout_s = now_s, START_TIMEOUT_S

    def start_connecting(self, now_s: float, timeout_s: float) -> None:
        """Records that the process has started and must connect within `patience_s` [s]."""
        self.connecting, self._since_s, self._timeout_s = True, now_s, timeout_s

    def exceeded_timeout(self, now_s: float) -> str:
        """Returns the connection timeout as text if it has passed, otherwise ""."""
        if self.working or self.failed or now_s - self._since_s <= self._timeout_s:
            return ""
        return f"within {self._timeout_s:g} s"


class RtdeLink:
    """Connects to one arm.

    The control loop calls `poll` and `servo`; other threads call `request_program`, `connect` and `close`.

    Args:
        settings: Connection settings.
    """

    def __init__(self, settings: LinkSettings) -> None:
        self._settings = settings
        self._silence_timeout_s = settings.timeout_s + _SILENCE_MARGIN_S
        self._closing = threading.Event()
        self._keeper: threading.Thread | None = None
        self._states: _RtdeProcess | None = None
        self._control: _RtdeProcess | None = None
        self._program_wanted = False
        self._has_commanded = False
        self.state: ArmState | None = None
        self.lost = "the first attempt is under way"
        self.commanding = False
        self.program_failure = ""
        self.program_failed_s = 0.0
        self.program_ready_s = 0.0

    def connect(self) -> None:
        """Starts a thread that connects, and reconnects after each failure until `close`."""
        self._keeper = threading.Thread(target=self._keep_connected, name="ur_link", daemon=True)
        self._keeper.start()

    def close(self) -> None:
        """Ends the connection and stops the arm; may be called twice."""
        self._closing.set()
        if self._keeper is not None:
            self._keeper.join(timeout=10.0)
            self._keeper = None

    def request_program(self) -> None:
        """Requests the upload of the program that accepts commands, as soon as the arm is connected."""
        control = self._control
        if control is not None and control.working:  # the program may have ended before the arm followed commands
            control.failed, self.commanding = True, False
        self.program_failure = ""
        self._program_wanted = True

    @property
    def start_step(self) -> str:
        """Describes the step that remains before the arm accepts commands."""
        control = self._control
        if control is None:
            return "the command process has not been started yet"
        if self.commanding:
            return "its program has been uploaded but does not run yet"
        return "its program is being uploaded" if control.connecting else "the command process is starting"

    def drop_program(self, reason: str) -> None:
        """Sends no commands until the next `request_program`, and logs the reason."""
        LOGGER.error("arm at %s: accepts no commands: %s", self._settings.address, reason)
        self._drop(reason)

    def _drop(self, reason: str) -> None:
        self.commanding = False
        self._program_wanted = False
        if self._control is not None:
            self._control.failed = True
        self.program_failure = reason
        self.program_failed_s = time.monotonic()

    def poll(self) -> None:
        """Reads the messages of the processes."""
        now_s = time.monotonic()
        states, control = self._states, self._control
        if states is not None:
            self._read_states(states, now_s)
        if control is not None:
            self._read_replies(control, now_s)

    def servo(self, positions: Sequence[float], time_s: float) -> None:
        """Commands the joints to `positions` [rad] within `time_s` [s]."""
        control = self._control
        if self.commanding and control is not None:
            control.process.send(servo_message(positions, time_s))
            control.awaits_message = True

    def _read_states(self, states: _RtdeProcess, now_s: float) -> None:
        newest, heard = b"", False
        for message in states.process.messages():
            heard = True
            if message[:1] == STATE:
                newest = message
            elif message == CONNECTING:
                states.start_connecting(now_s, _CONNECT_TIMEOUT_S)
            elif message[:1] == FAILED:
                self._lose_connection(states, message[1:].decode(errors="replace"))
        silent_s = states.silence.update(now_s, heard)
        if states.failed:
            return
        if newest:
            if self.lost:
                LOGGER.info("arm at %s: connected", self._settings.address)
            self.state, self.lost, states.working = ArmState.from_bytes(newest), "", True
        if states.process.ended:
            self._lose_connection(states, "the process that reads the arm's state ended")
        elif states.working and silent_s > self._silence_timeout_s:
            timeout = f"{self._silence_timeout_s:g} s"
            self._lose_connection(states, f"the process that reads the arm's state has been silent for {timeout}")

    def _lose_connection(self, states: _RtdeProcess, reason: str) -> None:
        if not self.lost:
            LOGGER.error("arm at %s: link lost: %s", self._settings.address, reason)
            if self._has_commanded:  # before the first command, no motion has started and no `resume` is needed
                self._drop("its program ended with the lost connection")
        if not states.failed:
            states.failed = True
            self.lost = reason

    def _read_replies(self, control: _RtdeProcess, now_s: float) -> None:
        playing = self.state is not None and self.state.runtime_state == PROGRAM_PLAYING
        received_reply = not control.awaits_message or not playing
        for message in control.process.messages():
            if message == ACCEPTED:
                received_reply, control.awaits_message = True, False
            elif message == CONNECTING:
                control.start_connecting(now_s, _PROGRAM_TIMEOUT_S)
            elif message == READY:
                control.working = True
                self.commanding = self._program_wanted and not control.failed and not self.lost
                self.program_ready_s = now_s
                self._has_commanded |= self.commanding
            elif message[:1] == FAILED and not control.failed:
                self.drop_program(message[1:].decode(errors="replace"))
        if control.failed:
            return
        if control.process.ended:
            self.drop_program("the process that commands the arm ended")
        elif control.silence.update(now_s, received_reply) > self._silence_timeout_s:
            timeout = f"{self._silence_timeout_s:g} s"
            self.drop_program(f"the process that commands the arm has accepted no command for {timeout}")

    def _keep_connected(self) -> None:
        next_attempt_s, retry_s = 0.0, self._settings.retry_s
        while not self._closing.wait(_KEEPER_PERIOD_S):
            now_s = time.monotonic()
            try:
                if self._states is None and now_s >= next_attempt_s:
                    next_attempt_s = now_s + retry_s
                    self._states = self._start("state", ["--timeout", str(self._settings.timeout_s)], now_s)
                elif self._states is not None and self._is_over(self._states, now_s):
                    states, self._states = self._states, None
                    states.process.end()
                    retry_s = self._settings.retry_s if states.working else min(2.0 * retry_s, _MAX_RETRY_S)
                    next_attempt_s = now_s + retry_s
                self._keep_program(now_s)
            except OSError as error:
                self._log_start_failure(error)
        if self._states is not None:
            self._states.process.end()
        if self._control is not None and not self._control.process.end(_STOP_PATIENCE_S):
            LOGGER.error(
                "arm at %s: the program was not stopped within %g s and may still run; stop it at the teach pendant",
                self._settings.address,
                _STOP_PATIENCE_S,
            )
        self._states = self._control = None

    def _log_start_failure(self, error: OSError) -> None:
        reason = f"a process cannot be started: {error}; free memory, processes or open files of this computer"
        if self._states is None:
            self.lost = reason
        else:
            self.drop_program(reason)

    def _is_over(self, states: _RtdeProcess, now_s: float) -> bool:
        late = states.exceeded_timeout(now_s)
        if late:
            states.failed = True
            self.lost = f"no state from the arm {late} of connecting"
        return states.failed

    def _keep_program(self, now_s: float) -> None:
        control = self._control
        requested = self._program_wanted and not self.lost
        if control is None:
            if requested and self.state is not None and not robot_fault(self.state, self._settings.address):
                self._control = self._start("control", self._control_arguments(), now_s)
        elif not requested or control.failed:
            self._control, control.failed = None, True
            control.process.end(_STOP_TIMEOUT_S)
        elif late := control.exceeded_timeout(now_s):
            reason = f"the program was not accepted {late}"
            if self._has_commanded:
                self.drop_program(reason)
            else:  # no motion has started yet, so no `resume` is needed
                LOGGER.error("arm at %s: %s; the driver uploads the program again", self._settings.address, reason)
                control.failed = True

    def _control_arguments(self) -> list[str]:
        settings, speed_scale = self._settings, self._settings.speed_scale
        if speed_scale is not None and self._has_commanded and self.state is not None:
            speed_scale = min(speed_scale, self.state.speed_fraction)  # an operator may have lowered the slider
        scale = [] if speed_scale is None else ["--speed-scale", _argument_text(speed_scale)]
        return [
            *scale,
            "--payload",
            _argument_text(settings.payload_kg),
            "--payload-centre",
            *map(_argument_text, settings.payload_centre_m),
            "--lookahead",
            _argument_text(settings.lookahead_s),
            "--gain",
            _argument_text(settings.gain),
        ]

    def _start(self, role: str, arguments: Sequence[str], now_s: float) -> _RtdeProcess:
        real_time = ["--real-time"] if self._settings.real_time else []
        return _RtdeProcess(ChildProcess(_MODULE, [role, self._settings.address, *real_time, *arguments]), now_s)


def _argument_text(number: float) -> str:
    """Formats a number for a command line, which would parse -5e-05 as an option."""
    return f"{number:.9f}"
