# SPDX-License-Identifier: BSD-3-Clause
"""The messages between the control loop and the processes that run ur-rtde; one datagram per message.

The first byte is the kind; numbers follow in the machine's own byte order, as both ends run on one machine. CONNECTING
comes from both processes when they begin to connect; STATE, and ALIVE while there is none, from the one that reads;
READY once and ACCEPTED after each command from the one that commands; FAILED with the reason from both, as the last
message.
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
Six = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ArmState:
    """State that the arm's controller reports.

    Attributes:
        received_s: when the process that reads got it, on the monotonic clock [s].
        timestamp_s: the controller's own clock [s].
        positions: of the joints [rad].
        velocities: [rad/s].
        currents: of the motors [A].
        wrench: force [N] and torque [Nm] at the tool, in the frame of the base.
        speed_fraction: the speed slider, 0 to 1.
        speed_scaling: share of the pace at which the controller lets programs run.
        robot_mode, safety_mode, runtime_state: numbers of RTDE.
        late_s: how long it was under way [s].
    """

    received_s: float
    timestamp_s: float
    positions: Six
    velocities: Six
    currents: Six
    wrench: Six
    speed_fraction: float
    speed_scaling: float
    robot_mode: int
    safety_mode: int
    runtime_state: int
    late_s: float = 0.0

    @property
    def modes(self) -> tuple[int, int, int]:
        """Modes of robot and safety, and state of the program."""
        return self.robot_mode, self.safety_mode, self.runtime_state

    def packed(self) -> bytes:
        """The message that carries it."""
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
    def unpacked(cls, message: bytes) -> ArmState:
        """The state in a message."""
        values = _STATE.unpack(message)
        return cls(values[1], values[2], values[3:9], values[9:15], values[15:21], values[21:27], *values[27:])


def servo_message(positions: Sequence[float], time_s: float) -> bytes:
    """Message that has the joints go to `positions` [rad] within `time_s` [s]."""
    return _SERVO.pack(SERVO, *positions, time_s)


def read_servo_message(message: bytes) -> tuple[list[float], float]:
    """Positions [rad] and time [s] of a servo message."""
    values = _SERVO.unpack(message)
    return list(values[1:7]), values[7]
