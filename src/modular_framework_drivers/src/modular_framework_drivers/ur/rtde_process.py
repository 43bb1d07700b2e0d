# SPDX-License-Identifier: BSD-3-Clause
"""Runs ur-rtde in two processes: one reads the state of the arm, the other sends commands to the arm.

ur-rtde blocks the interpreter while it connects and uploads its program, and terminates the process after some network
faults; neither may affect the control loop. Each process serves one connection: it reports a failure and ends, and its
parent starts a new process. If the parent has ended, the process stops the arm and ends.

Once connected, both processes use real-time scheduling if requested and permitted, with a lower priority than the
control loop. ur-rtde waits in a busy loop for data that its receiving thread reads, so the receiving thread has the
higher priority.
"""

from __future__ import annotations

import argparse
import contextlib
import signal
import socket
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from modular_framework_control.realtime.scheduling import run_in_real_time
from modular_framework_drivers.ur.arm_messages import (
    ACCEPTED,
    ALIVE,
    CONNECTING,
    FAILED,
    MESSAGE_SIZE,
    READY,
    SERVO,
    ArmState,
    read_servo_message,
)
from modular_framework_drivers.ur.delay_watch import ConnectionEndedError, DelayWatch
from modular_framework_drivers.ur.state_watch import ModeConfirmation, SilenceWatch, is_plausible

_PRIORITY, _RECEIVING_PRIORITY = 50, 60  # below the priorities 70 and 80 of the control loop's threads
_POLL_PERIOD_S = 0.002
_ALIVE_PERIOD_S = 0.02
_FAILURE_TIMEOUT_S = 1.0  # maximum wait for queue space for the cause of the failure
_STOP_DECELERATION = 10.0  # deceleration at the end of a connection [rad/s^2]
_VARIABLES = [
    "timestamp",
    "actual_q",
    "actual_qd",
    "actual_current",
    "actual_TCP_force",
    "target_speed_fraction",
    "speed_scaling",
    "robot_mode",
    "safety_mode",
    "runtime_state",
]


def report_states(options: argparse.Namespace, channel: socket.socket) -> None:
    """Sends every state reported by the arm until the connection fails.

    Args:
        options: Parsed command line.
        channel: Socket to the control loop.

    Raises:
        ConnectionEndedError: If the connection failed.
        RuntimeError: If ur-rtde could not connect.
    """
    from rtde_receive import RTDEReceiveInterface

    _send(channel, CONNECTING)
    delay = DelayWatch(options.address)
    delay.check_delay(options.timeout)
    arm = RTDEReceiveInterface(options.address, -1.0, _VARIABLES)
    _take_priority(options)
    delay.start()
    last_state: ArmState | None = None
    modes, damaged_count = ModeConfirmation(), 0
    last_timestamp_s, last_sent_s = float("nan"), 0.0
    silence = SilenceWatch(time.monotonic())
    while True:
        now_s, heard = time.monotonic(), False
        state = read_new_state(arm, now_s, last_timestamp_s)
        if state is not None:
            last_timestamp_s = state.timestamp_s
            heard = modes.confirm(state.modes if is_plausible(state, last_state) else None)
            damaged_count = 0 if heard else damaged_count + 1
            if heard:
                last_state, last_sent_s = state, now_s
                _send(channel, replace(state, late_s=delay.update(now_s - state.timestamp_s)).to_bytes())
        if not heard and not arm.isConnected():
            raise ConnectionEndedError("the arm closed the connection")
        if silence.update(now_s, heard) > options.timeout:
            received_data = "only damaged data" if damaged_count > 1 else "nothing new"
            raise ConnectionEndedError(f"{received_data} from the arm for {options.timeout:g} s")
        delay.check_delay(options.timeout)
        if now_s - last_sent_s > _ALIVE_PERIOD_S:
            last_sent_s = now_s
            _send(channel, ALIVE)
        time.sleep(_POLL_PERIOD_S)


def read_new_state(arm: Any, now_s: float, last_timestamp_s: float) -> ArmState | None:
    """Returns the newest state received by ur-rtde.

    Args:
        arm: RTDEReceiveInterface of the arm.
        now_s: Time of reception on the monotonic clock [s].
        last_timestamp_s: Timestamp of the last state read [s].

    Returns:
        The state; None if the state has already been read or the next state arrived during the read.
    """
    timestamp_s = arm.getTimestamp()
    if timestamp_s == last_timestamp_s:
        return None
    state = ArmState(
        received_s=now_s,
        timestamp_s=timestamp_s,
        positions=tuple(arm.getActualQ()),
        velocities=tuple(arm.getActualQd()),
        currents=tuple(arm.getActualCurrent()),
        wrench=tuple(arm.getActualTCPForce()),
        speed_fraction=arm.getTargetSpeedFraction(),
        speed_scaling=arm.getSpeedScaling(),
        robot_mode=arm.getRobotMode(),
        safety_mode=arm.getSafetyMode(),
        runtime_state=arm.getRuntimeState(),
    )
    return state if arm.getTimestamp() == timestamp_s else None


def _send(channel: socket.socket, message: bytes) -> None:
    """Sends a message unless the socket is full; a delayed control loop receives a newer state later.

    Raises:
        BrokenPipeError: If the control loop has ended.
    """
    with contextlib.suppress(BlockingIOError):
        channel.send(message, socket.MSG_DONTWAIT)


def _take_priority(options: argparse.Namespace) -> None:
    """Requests real-time scheduling if enabled; the control loop already logs a refusal of its own request."""
    if options.real_time:
        run_in_real_time(_PRIORITY, _RECEIVING_PRIORITY)


def command_arm(options: argparse.Namespace, channel: socket.socket) -> None:
    """Uploads ur-rtde's program and passes on commands until the control loop closes the socket.

    Args:
        options: Parsed command line.
        channel: Socket to the control loop.

    Raises:
        ConnectionEndedError: If the arm refused its settings.
        RuntimeError: If the program could not be started.
    """
    from rtde_control import RTDEControlInterface
    from rtde_io import RTDEIOInterface

    _send(channel, CONNECTING)
    arm = RTDEControlInterface(options.address)
    io = RTDEIOInterface(options.address)
    if options.speed_scale is not None and not io.setSpeedSlider(options.speed_scale):
        raise ConnectionEndedError(f"the arm refused the speed slider value {options.speed_scale:g}")
    if not arm.setPayload(options.payload, options.payload_centre):
        raise ConnectionEndedError(f"the arm refused a payload of {options.payload:g} kg")
    _take_priority(options)
    _send(channel, READY)
    while message := _newest_message(channel):
        if message[:1] == SERVO:
            positions, time_s = read_servo_message(message)
            # a paused or stopped program accepts no command; the state of the arm distinguishes them
            if arm.servoJ(positions, 0.0, 0.0, time_s, options.lookahead, options.gain):
                with contextlib.suppress(BrokenPipeError):  # the parent has ended; the next read detects this
                    _send(channel, ACCEPTED)
    arm.servoStop(_STOP_DECELERATION)
    arm.stopScript()


def _newest_message(channel: socket.socket) -> bytes:
    """Waits for a message and returns the newest message in the queue; empty if the parent has ended."""
    try:
        message = channel.recv(MESSAGE_SIZE)
        while message:
            message = channel.recv(MESSAGE_SIZE, socket.MSG_DONTWAIT)
    except BlockingIOError:
        return message
    except ConnectionResetError:  # the parent ended with an unread message
        return b""
    return message


def command_line() -> argparse.ArgumentParser:
    """Returns the parser of the processes' command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("role", choices=("state", "control"))
    parser.add_argument("channel", type=int, help="file descriptor of the socket to the control loop")
    parser.add_argument("address")
    parser.add_argument("--real-time", action="store_true")
    parser.add_argument("--timeout", type=float, default=0.12)
    parser.add_argument("--speed-scale", type=float)
    parser.add_argument("--payload", type=float, default=0.0)
    parser.add_argument("--payload-centre", type=float, nargs=3, default=[0.0, 0.0, 0.0])
    parser.add_argument("--lookahead", type=float, default=0.03)
    parser.add_argument("--gain", type=float, default=2000.0)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one of the two processes; returns the exit code."""
    options = command_line().parse_args(arguments)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # on ctrl-c in the terminal, the control loop ends this process
    with socket.socket(fileno=options.channel) as channel:
        channel.setblocking(True)  # rospy sets a default timeout, which would make the socket non-blocking
        try:
            if options.role == "state":
                report_states(options, channel)
            else:
                command_arm(options, channel)
        except BrokenPipeError:
            return 0
        except Exception as error:  # ur-rtde raises many types; after any of them, the connection has failed
            text = str(error).strip() or type(error).__name__
            if "Failed to start control script" in text:  # ur-rtde gives this reason only for some arms
                text += "; is the arm in remote control?"
            channel.settimeout(_FAILURE_TIMEOUT_S)  # the socket may be full if the control loop is delayed
            with contextlib.suppress(OSError):
                channel.send(FAILED + text.encode()[: MESSAGE_SIZE - 1])
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
