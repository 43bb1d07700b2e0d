# SPDX-License-Identifier: BSD-3-Clause
"""The processes that hold ur-rtde, one to read the arm's state and one to command it.

ur-rtde stops the whole interpreter while it connects and uploads its program, and ends the process on some faults of
the network; nothing of that may touch the control loop. Each process lives for one connection: it says what went wrong
and ends, or is ended; whoever started it starts the next. It also ends, and stops the arm, when its starter is gone.
"""
from __future__ import annotations

import argparse
import contextlib
import signal
import socket
import sys
import time
from collections.abc import Sequence

from modular_framework_drivers.ur.arm_messages import (
    FAILED,
    MESSAGE_SIZE,
    READY,
    SERVO,
    ArmState,
    read_servo_message,
)

_STOP_DECELERATION = 10.0    # at the end of a connection [rad/s^2]
_VARIABLES = ["timestamp", "actual_q", "actual_qd", "actual_current", "actual_TCP_force", "target_speed_fraction",
              "speed_scaling", "robot_mode", "safety_mode", "runtime_state"]


class ConnectionEndedError(Exception):
    """The connection to the arm is of no more use; the text says why."""


def report_states(address: str, channel: socket.socket, timeout_s: float) -> None:
    """Send every state the arm reports, until the connection fails.

    Args:
        address: of the arm's controller.
        channel: to the control loop.
        timeout_s: a connection that brings nothing new for so long is lost [s].

    Raises:
        ConnectionEndedError: the connection failed.
        RuntimeError: there was none to be had.
    """
    from rtde_receive import RTDEReceiveInterface

    arm = RTDEReceiveInterface(address, -1.0, _VARIABLES)
    last_timestamp_s, last_new_s, pause_s = -1.0, time.monotonic(), 0.001
    while True:
        timestamp_s = arm.getTimestamp()
        now_s = time.monotonic()
        if timestamp_s != last_timestamp_s:
            last_timestamp_s, last_new_s = timestamp_s, now_s
            state = ArmState(now_s, timestamp_s, tuple(arm.getActualQ()), tuple(arm.getActualQd()),
                             tuple(arm.getActualCurrent()), tuple(arm.getActualTCPForce()),
                             arm.getTargetSpeedFraction(), arm.getSpeedScaling(), arm.getRobotMode(),
                             arm.getSafetyMode(), arm.getRuntimeState())
            _send(channel, state.packed())
        elif not arm.isConnected():
            raise ConnectionEndedError("the arm closed the connection")
        elif now_s - last_new_s > timeout_s:
            raise ConnectionEndedError(f"nothing new from the arm for {timeout_s:g} s")
        time.sleep(pause_s)


def _send(channel: socket.socket, message: bytes) -> None:
    """Send if there is room; a control loop that is held up gets the newest state later.

    Raises:
        BrokenPipeError: the control loop is gone.
    """
    with contextlib.suppress(BlockingIOError):
        channel.send(message)


def command_arm(options: argparse.Namespace, channel: socket.socket) -> None:
    """Upload ur-rtde's program and pass on the commands of the control loop, until either ends.

    Args:
        options: the command line.
        channel: from the control loop.

    Raises:
        ConnectionEndedError: the program no longer runs.
        RuntimeError: it could not be started.
    """
    from rtde_control import RTDEControlInterface
    from rtde_io import RTDEIOInterface

    arm = RTDEControlInterface(options.address)
    panel = RTDEIOInterface(options.address)
    if options.speed_scale is not None and not panel.setSpeedSlider(options.speed_scale):
        raise ConnectionEndedError(f"the arm refused the speed slider value {options.speed_scale:g}")
    if not arm.setPayload(options.payload, options.payload_centre):
        raise ConnectionEndedError(f"the arm refused a payload of {options.payload:g} kg")
    _send(channel, READY)
    channel.setblocking(True)
    while True:
        message = _newest(channel)
        if not message:
            arm.servoStop(_STOP_DECELERATION)
            arm.stopScript()
            return
        if message[:1] == SERVO:
            positions, time_s = read_servo_message(message)
            if not arm.servoJ(positions, 0.0, 0.0, time_s, options.lookahead, options.gain):
                raise ConnectionEndedError("the program on the arm was stopped")


def _newest(channel: socket.socket) -> bytes:
    """The last of the messages that wait, after waiting for one; empty when the other end is gone."""
    message = channel.recv(MESSAGE_SIZE)
    while message:
        try:
            newer = channel.recv(MESSAGE_SIZE, socket.MSG_DONTWAIT)
        except BlockingIOError:
            break
        message = newer
    return message


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one of the two processes; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("role", choices=("state", "control"))
    parser.add_argument("channel", type=int, help="file descriptor of the socket to the control loop")
    parser.add_argument("address")
    parser.add_argument("--timeout", type=float, default=0.12)
    parser.add_argument("--speed-scale", type=float)
    parser.add_argument("--payload", type=float, default=0.0)
    parser.add_argument("--payload-centre", type=float, nargs=3, default=[0.0, 0.0, 0.0])
    parser.add_argument("--lookahead", type=float, default=0.03)
    parser.add_argument("--gain", type=float, default=2000.0)
    options = parser.parse_args(arguments)
    signal.signal(signal.SIGINT, signal.SIG_IGN)    # ctrl-c in the terminal is for the control loop, which ends us
    with socket.socket(fileno=options.channel) as channel:
        channel.setblocking(False)
        try:
            if options.role == "state":
                report_states(options.address, channel, options.timeout)
            else:
                command_arm(options, channel)
        except BrokenPipeError:
            return 0
        except Exception as error:  # ur-rtde raises many kinds; all mean that this connection is over
            channel.setblocking(False)
            text = str(error).strip() or type(error).__name__
            try:
                _send(channel, FAILED + text.encode()[:MESSAGE_SIZE - 1])
            except OSError:
                return 1
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
