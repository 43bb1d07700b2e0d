# SPDX-License-Identifier: BSD-3-Clause
"""The processes that run ur-rtde, one to read the arm's state and one to command it.

ur-rtde blocks the whole interpreter while it connects and uploads its program, and it ends the process on some faults
of the network; neither may affect the control loop. Each process lives for one connection: it reports what failed and
ends, or is ended, and its parent starts the next one. It also ends, and stops the arm, when its parent is gone.

Both use real-time scheduling where that is wanted and permitted, once they are connected, with a lower priority than
the control loop.
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
from modular_framework_drivers.ur.state_watch import SilenceWatch, is_plausible

_PRIORITY = 60  # the control loop has 80
_POLL_PERIOD_S = 0.002
_ALIVE_PERIOD_S = 0.02
_LAST_WORDS_S = 1.0  # for the reason of the end to find room
_STOP_DECELERATION = 10.0  # at the end of a connection [rad/s^2]
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
    """Sends every state that the arm reports, until the connection fails.

    Args:
        options: the command line.
        channel: to the control loop.

    Raises:
        ConnectionEndedError: the connection failed.
        RuntimeError: there was no connection.
    """
    from rtde_receive import RTDEReceiveInterface

    _send(channel, CONNECTING)
    delay = DelayWatch(options.address)
    delay.refuse_beyond(options.timeout)
    arm = RTDEReceiveInterface(options.address, -1.0, _VARIABLES)
    _take_priority(options)
    delay.start()
    last: ArmState | None = None
    modes, damaged = (0, 0, 0), 0
    last_timestamp_s, last_sent_s = float("nan"), 0.0
    silence = SilenceWatch(time.monotonic())
    while True:
        now_s, heard = time.monotonic(), False
        state = read_new_state(arm, now_s, last_timestamp_s)
        if state is not None:
            last_timestamp_s = state.timestamp_s
            heard = is_plausible(state, last)
            damaged = 0 if heard else damaged + 1
            if heard and (last is None or state.modes != last.modes):  # a flipped bit makes another valid mode of one
                heard, modes = state.modes == modes, state.modes
            if heard:
                last, last_sent_s = state, now_s
                _send(channel, replace(state, late_s=delay.update(now_s - state.timestamp_s)).packed())
        if not heard and not arm.isConnected():
            raise ConnectionEndedError("the arm closed the connection")
        if silence.update(now_s, heard) > options.timeout:
            what = "only damaged data" if damaged > 1 else "nothing new"
            raise ConnectionEndedError(f"{what} from the arm for {options.timeout:g} s")
        delay.refuse_beyond(options.timeout)
        if now_s - last_sent_s > _ALIVE_PERIOD_S:
            last_sent_s = now_s
            _send(channel, ALIVE)
        time.sleep(_POLL_PERIOD_S)


def read_new_state(arm: Any, now_s: float, last_timestamp_s: float) -> ArmState | None:
    """Returns the state that ur-rtde received last.

    Args:
        arm: RTDEReceiveInterface of the arm.
        now_s: time of reception to note, on the monotonic clock [s].
        last_timestamp_s: timestamp of the state that was read before [s].

    Returns:
        The state; None if it was read before, or if the next state arrived while it was read.
    """
    timestamp_s = arm.getTimestamp()
    if timestamp_s == last_timestamp_s:
        return None
    state = ArmState(
        now_s,
        timestamp_s,
        tuple(arm.getActualQ()),
        tuple(arm.getActualQd()),
        tuple(arm.getActualCurrent()),
        tuple(arm.getActualTCPForce()),
        arm.getTargetSpeedFraction(),
        arm.getSpeedScaling(),
        arm.getRobotMode(),
        arm.getSafetyMode(),
        arm.getRuntimeState(),
    )
    return state if arm.getTimestamp() == timestamp_s else None


def _send(channel: socket.socket, message: bytes) -> None:
    """Sends a message unless the socket is full; a control loop that is late gets a newer state later.

    Raises:
        BrokenPipeError: the control loop is gone.
    """
    with contextlib.suppress(BlockingIOError):
        channel.send(message, socket.MSG_DONTWAIT)


def _take_priority(options: argparse.Namespace) -> None:
    """Requests real-time scheduling if wanted; a refusal is not logged, because the control loop logs its own."""
    if options.real_time:
        run_in_real_time(_PRIORITY)


def command_arm(options: argparse.Namespace, channel: socket.socket) -> None:
    """Uploads ur-rtde's program and passes on the commands of the control loop until that ends.

    Args:
        options: the command line.
        channel: from the control loop.

    Raises:
        ConnectionEndedError: the arm refused its settings.
        RuntimeError: the program could not be started.
    """
    from rtde_control import RTDEControlInterface
    from rtde_io import RTDEIOInterface

    _send(channel, CONNECTING)
    arm = RTDEControlInterface(options.address)
    panel = RTDEIOInterface(options.address)
    if options.speed_scale is not None and not panel.setSpeedSlider(options.speed_scale):
        raise ConnectionEndedError(f"the arm refused the speed slider value {options.speed_scale:g}")
    if not arm.setPayload(options.payload, options.payload_centre):
        raise ConnectionEndedError(f"the arm refused a payload of {options.payload:g} kg")
    _take_priority(options)
    _send(channel, READY)
    while message := _newest(channel):
        if message[:1] == SERVO:
            positions, time_s = read_servo_message(message)
            # a paused or stopped program accepts none; the state of the arm says which of the two it is
            if arm.servoJ(positions, 0.0, 0.0, time_s, options.lookahead, options.gain):
                with contextlib.suppress(BrokenPipeError):  # the parent is gone; the next message says so
                    _send(channel, ACCEPTED)
    arm.servoStop(_STOP_DECELERATION)
    arm.stopScript()


def _newest(channel: socket.socket) -> bytes:
    """Waits for a message and returns the last one in the queue; empty if the other end is gone."""
    try:
        message = channel.recv(MESSAGE_SIZE)
        while message:
            message = channel.recv(MESSAGE_SIZE, socket.MSG_DONTWAIT)
    except BlockingIOError:
        return message
    except ConnectionResetError:  # it ended without reading the last message to it
        return b""
    return message


def command_line() -> argparse.ArgumentParser:
    """The arguments of the processes."""
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
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # ctrl-c in the terminal is for the control loop, which ends us
    with socket.socket(fileno=options.channel) as channel:
        channel.setblocking(True)  # one made where sockets have a default timeout, as rospy sets it, does not block
        try:
            if options.role == "state":
                report_states(options, channel)
            else:
                command_arm(options, channel)
        except BrokenPipeError:
            return 0
        except Exception as error:  # ur-rtde raises many kinds; all mean that this connection is over
            text = str(error).strip() or type(error).__name__
            if "Failed to start control script" in text:  # ur-rtde gives this reason for some arms only
                text += "; is the arm in remote control?"
            channel.settimeout(_LAST_WORDS_S)  # the socket may be full of states of a control loop that is late
            with contextlib.suppress(OSError):
                channel.send(FAILED + text.encode()[: MESSAGE_SIZE - 1])
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
