# SPDX-License-Identifier: BSD-3-Clause
"""Encodes the messages between the control loop and the processes that run ur-rtde, one datagram per message.

The first byte is the message type; numbers follow in native byte order, as all processes run on one machine. Both
processes send CONNECTING when they start to connect, and FAILED with the cause as their last message. The process that
reads states sends STATE, or ALIVE while no state arrives. The process that sends commands to the arm sends READY once
and ACCEPTED after each command.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

JOINTS = 6
CONNECTING, STATE, ALIVE, READY, ACCEPTED, FAILED, SERVO = b"C", b"S", b"A", b"R", b"T", b"F", b"Q"
_STATE = struct.Struct("=cdd26diiId")
_SERVO = struct.Struct("=c7d")
MESSAGE_SIZE = 1024
JointValues = tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmState:
    """Holds a state reported by the arm's controller.

    Attributes:
        received_s: Time of reception on the monotonic clock [s].
        timestamp_s: Time on the clock of the controller [s].
        positions: Joint positions [rad].
        velocities: Joint velocities [rad/s].
        currents: Motor currents [A].
        wrench: Force [N] and torque [Nm] at the tool, in the base frame.
        speed_fraction: Speed slider in [0, 1].
        speed_scaling: Speed scaling factor that the controller applies to programs.
        robot_mode: Robot mode of RTDE.
        safety_mode: Safety mode of RTDE.
        runtime_state: Runtime state of the program in RTDE.
        late_s: Transmission delay [s].
    """

    received_s: float
    timestamp_s: float
    positions: JointValues
    velocities: JointValues
    currents: JointValues
    wrench: JointValues
    speed_fraction: float
    speed_scaling: float
    robot_mode: int
    safety_mode: int
    runtime_state: int
    late_s: float = 0.0

    @property
    def modes(self) -> tuple[int, int, int]:
        """Returns the robot mode, the safety mode and the runtime state of the program."""
        return self.robot_mode, self.safety_mode, self.runtime_state

    def to_bytes(self) -> bytes:
        """Returns the state as a message."""
        return _STATE.pack(
            STATE,
            self.received_s,
            self.timestamp_s,
            *self.positions,
            *self.velocities,
            *self.currents,
            *self.wrench,
            self.speed_fraction,
            self.speed_scaling,
            *self.modes,
            self.late_s,
        )

    @classmethod
    def from_bytes(cls, message: bytes) -> ArmState:
        """Returns the state in a message."""
        values = _STATE.unpack(message)
        speed_fraction, speed_scaling, robot_mode, safety_mode, runtime_state, late_s = values[27:]
        return cls(
            received_s=values[1],
            timestamp_s=values[2],
            positions=values[3:9],
            velocities=values[9:15],
            currents=values[15:21],
            wrench=values[21:27],
            speed_fraction=speed_fraction,
            speed_scaling=speed_scaling,
            robot_mode=robot_mode,
            safety_mode=safety_mode,
            runtime_state=runtime_state,
            late_s=late_s,
        )


def servo_message(positions: Sequence[float], time_s: float) -> bytes:
    """Returns the message that commands the joints to `positions` [rad] within `time_s` [s]."""
    return _SERVO.pack(SERVO, *positions, time_s)


def read_servo_message(message: bytes) -> tuple[list[float], float]:
    """Returns the positions [rad] and the time [s] of a servo message."""
    values = _SERVO.unpack(message)
    return list(values[1:7]), values[7]
