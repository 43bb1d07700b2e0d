# SPDX-License-Identifier: BSD-3-Clause
"""Checks every position command before it goes to the arm: what the arm cannot do must not reach it.

A command that is no number, lies outside a joint's range or is far from the last one is refused; the arm brakes and
holds. One that is only faster, or accelerates more, than a joint may is followed as fast as the joint may.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

_SLACK = 1e-6     # rounding that is forgiven [rad], and as a share of a limit


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """What a joint may do.

    Attributes:
        name: of the joint.
        min_position, max_position: its range [rad].
        max_velocity: [rad/s].
        max_acceleration: [rad/s^2].
    """

    name: str
    min_position: float
    max_position: float
    max_velocity: float
    max_acceleration: float


class CommandCheck:
    """The commands that go to the arm.

    Args:
        limits: of the joints, in the order of the commands.
        max_jump: largest distance between a command and what was last sent [rad].

    Attributes:
        sent: what is to be sent [rad]; changed by `admit` and `reset`.
    """

    def __init__(self, limits: Sequence[MotionLimits], max_jump: float) -> None:
        self._limits = tuple(limits)
        self._max_jump = max_jump
        self.sent = [0.0] * len(self._limits)
        self._velocities = [0.0] * len(self._limits)
        self._targets = [0.0] * len(self._limits)

    def reset(self, positions: Sequence[float]) -> None:
        """Begin anew from an arm that rests at `positions` [rad]."""
        self.sent = list(positions)
        self._targets = list(positions)
        self._velocities = [0.0] * len(self._limits)

    def admit(self, commands: Sequence[float], period_s: float) -> str:
        """Set `sent` to what the arm is to be told.

        Args:
            commands: positions [rad].
            period_s: time since the last call [s].

        Returns:
            "", or why the commands were refused; `sent` then brings the arm to rest.
        """
        reason = self._why_not(commands)
        if period_s <= 0.0:
            return reason
        for joint, limit in enumerate(self._limits):
            if reason:
                self._brake(joint, limit.max_acceleration * period_s, period_s)
            else:
                command = min(max(commands[joint], limit.min_position), limit.max_position)
                self._approach(joint, command, limit, period_s)
        return reason

    def _why_not(self, commands: Sequence[float]) -> str:
        for command, sent, limit in zip(commands, self.sent, self._limits, strict=True):
            if not math.isfinite(command):
                return f"joint '{limit.name}': command {command} is no position; the arm holds"
            if not limit.min_position - _SLACK <= command <= limit.max_position + _SLACK:
                return (f"joint '{limit.name}': command {command:.6g} rad is outside its range "
                        f"[{limit.min_position:.6g}, {limit.max_position:.6g}] rad; the arm holds")
            if abs(command - sent) > self._max_jump:
                return (f"joint '{limit.name}': command {command:.6g} rad is {abs(command - sent):.3g} rad away from "
                        f"{sent:.6g} rad where the arm is told to be; at most {self._max_jump:g} rad at once "
                        "(parameter max_jump_rad); the arm holds")
        return ""

    def _brake(self, joint: int, change: float, period_s: float) -> None:
        velocity = self._velocities[joint]
        velocity -= min(max(velocity, -change), change)
        self._velocities[joint] = velocity
        self.sent[joint] += velocity * period_s
        self._targets[joint] = self.sent[joint]

    def _approach(self, joint: int, command: float, limit: MotionLimits, period_s: float) -> None:
        """Go to the command at once if velocity and acceleration allow it, else as fast as they do.

        "At once" also asks that the joint can be as fast as the commands are in the next cycle, lest it run past them.
        """
        position, velocity = self.sent[joint], self._velocities[joint]
        top, change = limit.max_velocity, limit.max_acceleration * period_s
        pace = (command - self._targets[joint]) / period_s
        self._targets[joint] = command
        wanted = (command - position) / period_s
        at_once = max(abs(wanted - velocity), abs(wanted - pace)) <= change * (1.0 + _SLACK)
        if not at_once or abs(wanted) > top * (1.0 + _SLACK):
            pace = min(max(pace, -top), top)
            behind = command - pace * period_s - position
            goal = pace + math.copysign(_closing_speed(abs(behind), limit.max_acceleration, period_s), behind)
            velocity += min(max(min(max(goal, -top), top) - velocity, -change), change)
            self._velocities[joint] = velocity
            self.sent[joint] = position + velocity * period_s
        else:
            self._velocities[joint] = wanted
            self.sent[joint] = command


def _closing_speed(distance: float, deceleration: float, period_s: float) -> float:
    """Highest speed from which one can still stop within `distance` [m|rad], braking once per period."""
    step = deceleration * period_s
    return step * (math.sqrt(0.25 + 2.0 * distance / (step * period_s)) - 0.5)
