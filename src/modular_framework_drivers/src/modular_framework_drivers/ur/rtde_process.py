# SPDX-License-Identifier: BSD-3-Clause
"""The processes that hold ur-rtde, one to read the arm's state and one to command it.

ur-rtde stops the whole interpreter while it connects and uploads its program, and ends the process on some faults of
the network; nothing of that may touch the control loop. Each process lives for one connection: it says what went wrong
and ends, or is ended; whoever started it starts the next. It also ends, and stops the arm, when its starter is gone.

Both run in real time where that is wanted and permitted, but only once they are connected: less urgent than the control
loop, before everything else.
"""
from __future__ import annotations

import argparse
import contextlib
import signal
import socket
import sys
import time
from collections.abc import Sequence
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
from modular_framework_drivers.ur.state_watch import SilenceWatch, is_plausible

_PRIORITY = 60               # the control loop has 80
_POLL_PERIOD_S = 0.002
_ALIVE_PERIOD_S = 0.02
_STOP_DECELERATION = 10.0    # at the end of a connection [rad/s^2]
_VARIABLES = ["timestamp", "actual_q", "actual_qd", "actual_current", "actual_TCP_force", "target_speed_fraction",
              "speed_scaling", "robot_mode", "safety_mode", "runtime_state"]


class ConnectionEndedError(Exception):
    """The connection to the arm is of no more use; the text says why."""


def report_states(options: argparse.Namespace, channel: socket.socket) -> None:
    """Send every state the arm reports, until the connection fails.

    Args:
        options: the command line.
        channel: to the control loop.

    Raises:
        ConnectionEndedError: the connection failed.
        RuntimeError: there was none to be had.
    """
    from rtde_receive import RTDEReceiveInterface

    _send(channel, CONNECTING)
    arm = RTDEReceiveInterface(options.address, -1.0, _VARIABLES)
    _take_priority(options)
    last: ArmState | None = None
    last_timestamp_s, last_sent_s = float("nan"), 0.0
    silence = SilenceWatch(time.monotonic())
    while True:
        now_s, timestamp_s, heard = time.monotonic(), arm.getTimestamp(), False
        if timestamp_s != last_timestamp_s:
            last_timestamp_s = timestamp_s
            state = _state_of(arm, now_s, timestamp_s)
            if heard := is_plausible(state, last):
                last, last_sent_s = state, now_s
                _send(channel, state.packed())
        if not heard and not arm.isConnected():
            raise ConnectionEndedError("the arm closed the connection")
        if silence.update(now_s, heard) > options.timeout:
            raise ConnectionEndedError(f"nothing new from the arm for {options.timeout:g} s")
        if now_s - last_sent_s > _ALIVE_PERIOD_S:
            last_sent_s = now_s
            _send(channel, ALIVE)
        time.sleep(_POLL_PERIOD_S)


def _state_of(arm: Any, now_s: float, timestamp_s: float) -> ArmState:
    """The state that ur-rtde received last."""
    return ArmState(now_s, timestamp_s, tuple(arm.getActualQ()), tuple(arm.getActualQd()),
                    tuple(arm.getActualCurrent()), tuple(arm.getActualTCPForce()), arm.getTargetSpeedFraction(),
                    arm.getSpeedScaling(), arm.getRobotMode(), arm.getSafetyMode(), arm.getRuntimeState())


def _send(channel: socket.socket, message: bytes) -> None:
    """Send if there is room; a control loop that is held up gets the newest state later.

    Raises:
        BrokenPipeError: the control loop is gone.
    """
    with contextlib.suppress(BlockingIOError):
        channel.send(message, socket.MSG_DONTWAIT)


def _take_priority(options: argparse.Namespace) -> None:
    """Run in real time if that is wanted; a refusal is told by the control loop, which is refused the same."""
    if options.real_time:
        run_in_real_time(_PRIORITY)


def command_arm(options: argparse.Namespace, channel: socket.socket) -> None:
    """Upload ur-rtde's program and pass on the commands of the control loop until it ends.

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
            # a program that is paused or stopped takes none; which of them it is the state of the arm tells
            if arm.servoJ(positions, 0.0, 0.0, time_s, options.lookahead, options.gain):
                with contextlib.suppress(BrokenPipeError):   # nobody is there any more; the next message says so
                    _send(channel, ACCEPTED)
    arm.servoStop(_STOP_DECELERATION)
    arm.stopScript()


def _newest(channel: socket.socket) -> bytes:
    """The last of the messages that wait, after waiting for one; empty when the other end is gone."""
    try:
        message = channel.recv(MESSAGE_SIZE)
        while message:
            message = channel.recv(MESSAGE_SIZE, socket.MSG_DONTWAIT)
    except BlockingIOError:
        return message
    except ConnectionResetError:    # it went without reading what we said last
        return b""
    return message


def command_line() -> argparse.ArgumentParser:
    """What the processes are to be told."""
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
    """Run one of the two processes; returns the exit code."""
    options = command_line().parse_args(arguments)
    signal.signal(signal.SIGINT, signal.SIG_IGN)    # ctrl-c in the terminal is for the control loop, which ends us
    with socket.socket(fileno=options.channel) as channel:
        channel.setblocking(True)     # one made where sockets have a default timeout, as rospy sets it, does not block
        try:
            if options.role == "state":
                report_states(options, channel)
            else:
                command_arm(options, channel)
        except BrokenPipeError:
            return 0
        except Exception as error:  # ur-rtde raises many kinds; all mean that this connection is over
            text = str(error).strip() or type(error).__name__
            if "Failed to start control script" in text:    # ur-rtde does not say so of every arm
                text += "; is the arm in remote control?"
            try:
                _send(channel, FAILED + text.encode()[:MESSAGE_SIZE - 1])
            except OSError:
                return 1
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
