# SPDX-License-Identifier: BSD-3-Clause
"""Simulates the joints of the emulated arm, which follow programs within the velocity and acceleration of a UR5."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from scipy.spatial.transform import Rotation

JOINTS = 6
MAX_VELOCITY = math.pi  # of every joint of a UR5 [rad/s]
MAX_ACCELERATION = 40.0  # maximum accepted by URScript [rad/s^2]
MAX_SERVO_ERROR = 0.5  # distance to the servo target beyond which the controller stops the arm [rad]
_ARRIVED = 1e-5  # tolerance at the end of a move: distance [rad] and speed [rad/s]

# Denavit-Hartenberg parameters of the UR5 from the manufacturer: (a [m], d [m], alpha [rad]) per joint.
_UR5_LINKS = (
    (0.0, 0.089159, math.pi / 2),
    (-0.425, 0.0, 0.0),
    (-0.39225, 0.0, 0.0),
    (0.0, 0.10915, math.pi / 2),
    (0.0, 0.09465, -math.pi / 2),
    (0.0, 0.0823, 0.0),
)


class Drive(Enum):
    """Type of a motion."""

    HOLD = "hold"
    SERVO = "servo"
    SPEED = "speed"
    MOVE = "move"
    STOP = "stop"


@dataclass(frozen=True, slots=True)
class MotionCommand:
    """Holds the command of a motion.

    Attributes:
        drive: Type of the motion.
        target: Joint positions of SERVO and MOVE [rad] or joint velocities of SPEED [rad/s].
        velocity: Maximum speed of MOVE [rad/s].
        acceleration: Acceleration of SPEED, MOVE and STOP [rad/s^2].
        lookahead_s: Time constant of SERVO [s].
    """

    drive: Drive
    target: tuple[float, ...] = (0.0,) * JOINTS
    velocity: float = MAX_VELOCITY
    acceleration: float = MAX_ACCELERATION
    lookahead_s: float = 0.1


class ArmMotion:
    """Simulates the positions and velocities of the joints.

    Args:
        positions: Initial joint positions [rad].
    """

    def __init__(self, positions: Sequence[float]) -> None:
        self.positions = list(positions)
        self.velocities = [0.0] * JOINTS
        self.command = MotionCommand(Drive.HOLD)

    def set_command(self, command: MotionCommand) -> None:
        """Replaces the current motion."""
        self.command = command

    @property
    def servo_error(self) -> float:
        """Returns the maximum distance of a joint to its servo target [rad]; 0 without a target."""
        if self.command.drive is not Drive.SERVO:
            return 0.0
        return max(abs(goal - position) for goal, position in zip(self.command.target, self.positions, strict=True))

    @property
    def is_finished(self) -> bool:
        """Returns whether a MOVE has reached its target or a STOP has ended at rest."""
        at_rest = max(map(abs, self.velocities)) <= _ARRIVED
        if self.command.drive is Drive.MOVE:
            return at_rest and all(
                abs(goal - position) <= _ARRIVED
                for goal, position in zip(self.command.target, self.positions, strict=True)
            )
        return at_rest

    def step(self, dt_s: float, speed_fraction: float) -> None:
        """Advances by `dt_s` [s]; `speed_fraction` in [0, 1] scales the maximum speed, like the speed slider."""
        command = self.command
        wanted = self._target_velocities(command, dt_s)
        limit = command.acceleration if command.drive in (Drive.SPEED, Drive.MOVE, Drive.STOP) else MAX_ACCELERATION
        change = min(limit, MAX_ACCELERATION) * dt_s
        top = MAX_VELOCITY * speed_fraction
        for joint, velocity in enumerate(self.velocities):
            goal = min(max(wanted[joint], -top), top)
            velocity += min(max(goal - velocity, -change), change)
            self.velocities[joint] = velocity
            self.positions[joint] += velocity * dt_s

    def _target_velocities(self, command: MotionCommand, dt_s: float) -> Sequence[float]:
        match command.drive:
            case Drive.HOLD | Drive.STOP:
                return (0.0,) * JOINTS
            case Drive.SPEED:
                return command.target
            case Drive.SERVO:
                return self._towards(command.target, command.lookahead_s, MAX_ACCELERATION, [MAX_VELOCITY] * JOINTS)
            case Drive.MOVE:
                errors = [abs(goal - position) for goal, position in zip(command.target, self.positions, strict=True)]
                longest = max(max(errors), 1e-12)
                tops = [command.velocity * error / longest for error in errors]
                return self._towards(command.target, dt_s, command.acceleration, tops)

    def _towards(
        self, target: Sequence[float], time_constant_s: float, acceleration: float, tops: Sequence[float]
    ) -> list[float]:
        """Returns the velocities that bring the joints to the target without overshoot."""
        velocities = []
        for goal, position, top in zip(target, self.positions, tops, strict=True):
            error = goal - position
            speed = min(abs(error) / time_constant_s, math.sqrt(2.0 * acceleration * abs(error)) * 0.8, top)
            velocities.append(math.copysign(speed, error))
        return velocities


def flange_pose(positions: Sequence[float]) -> tuple[float, ...]:
    """Returns the flange pose of a UR5 in the base frame: position [m], then rotation vector [rad]."""
    rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    origin = [0.0, 0.0, 0.0]
    for theta, (a, d, alpha) in zip(positions, _UR5_LINKS, strict=True):
        ct, st, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
        offset = (a * ct, a * st, d)
        link = ((ct, -st * ca, st * sa), (st, ct * ca, -ct * sa), (0.0, sa, ca))
        origin = [origin[row] + sum(rotation[row][k] * offset[k] for k in range(3)) for row in range(3)]
        rotation = [
            [sum(rotation[row][k] * link[k][column] for k in range(3)) for column in range(3)] for row in range(3)
        ]
    return (*origin, *Rotation.from_matrix(rotation).as_rotvec().tolist())
