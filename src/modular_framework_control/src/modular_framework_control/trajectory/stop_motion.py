# SPDX-License-Identifier: BSD-3-Clause
"""Stop motions, in which joints come to rest when a motion is stopped before its end.

A stop begins at the measured state instead of the desired state, because the joints may not have followed.
"""

from __future__ import annotations

import numpy as np

from modular_framework_control.trajectory.joint_trajectory import (
    MIN_SEGMENT_S,
    POSITION,
    VELOCITY,
    Array,
    Track,
    segment_coefficients,
)
from modular_framework_control.trajectory.motion_limits import MotionLimits

FOLLOWING_LAG_S = 0.05
"""Maximum lag of a joint behind its commands [s]; a ramp begins at the position that the joint reaches within this time
at its measured velocity. Tuned on an arm that follows 0.03 s late over a network; a joint with a larger lag moves back
a little while braking."""
MAX_COMMAND_AGE_S = 0.01
"""Maximum age of the last command [s]; the joint has not received the desired motion after this command."""
FOLLOWING_FRACTION = 0.1
"""Maximum relative velocity error of a joint that counts as following. Its ramp begins at the desired velocity, because
measured velocities are delayed and noisy."""
SHARP_BRAKING_FRACTION = 0.9
"""Fraction of the maximum deceleration for a stop without a ramp.

The reserve prevents overshooting of a lagging joint."""
RAMP_PEAK_FACTOR = 1.5
"""Peak deceleration of a ramp as a multiple of the mean deceleration."""


class StopMotion:
    """Computes stop motions.

    Args:
        duration_s: Duration of a ramp, extended if a joint cannot brake that hard. With 0, each joint brakes at its
            maximum deceleration; a joint with unknown deceleration is held at its measured position.
        limits: Limits of the joints.
    """

    def __init__(self, duration_s: float, limits: MotionLimits) -> None:
        self._duration_s = duration_s
        self._limits = limits

    def tracks(self, desired: Array, actual: Array, time_s: float, rate: float) -> list[Track]:
        """Returns the stop motion of all joints.

        Args:
            desired: Desired positions and velocities, shape (3, joints) or (2, joints).
            actual: Measured positions and velocities, shape (2, joints).
            time_s: Current time [s of the trajectory clock].
            rate: Rate of the trajectory clock, 0 to 1, which scales the speed of the robot.
        """
        limits, is_sharp = self._limits, self._duration_s * rate <= MIN_SEGMENT_S
        is_following = np.abs(desired[VELOCITY] - actual[VELOCITY]) <= FOLLOWING_FRACTION * np.abs(desired[VELOCITY])
        velocity = np.clip(
            np.where(is_following, desired[VELOCITY], actual[VELOCITY]), -limits.max_velocities, limits.max_velocities
        )
        max_lead = FOLLOWING_LAG_S * np.minimum(
            np.abs(actual[VELOCITY]), limits.max_velocities
        ) + MAX_COMMAND_AGE_S * np.minimum(np.abs(desired[VELOCITY]), limits.max_velocities)
        lead = np.clip(desired[POSITION] - actual[POSITION], -max_lead, max_lead)
        limits = limits.with_positions(actual[POSITION])
        position = np.clip(actual[POSITION] + lead, limits.min_positions, limits.max_positions)
        with np.errstate(divide="ignore", invalid="ignore"):
            braking_s = np.where(limits.max_decelerations > 0.0, np.abs(velocity) / limits.max_decelerations, 0.0)
        durations_s = rate * np.maximum(
            self._duration_s, braking_s * (1.0 / SHARP_BRAKING_FRACTION if is_sharp else RAMP_PEAK_FACTOR)
        )
        if not (durations_s > MIN_SEGMENT_S).any():
            return [Track.hold(list(range(len(durations_s))), actual[POSITION], time_s)]
        return [
            _ramp(
                joint,
                (position[joint], velocity[joint] / rate) if duration_s > 0.0 else (actual[POSITION, joint], 0.0),
                time_s=time_s,
                duration_s=duration_s,
                bound=limits.max_positions[joint] if velocity[joint] > 0.0 else limits.min_positions[joint],
                order=3 if is_sharp else 5,
            )
            for joint, duration_s in enumerate(durations_s.tolist())
        ]


def _ramp(
    joint: int, start: tuple[float, float], *, time_s: float, duration_s: float, bound: float, order: int
) -> Track:
    """Returns a ramp to rest over half the distance of unbraked motion, shortened to end at `bound`.

    With `order` 3 the velocity decreases linearly, with 5 as 1 - 3s^2 + 2s^3.
    """
    position, velocity = start
    max_distance = abs(bound - position)
    if 0.5 * abs(velocity) * duration_s > max_distance:
        duration_s = 2.0 * max_distance / abs(velocity)
    begin, end = np.zeros((3, 1)), np.zeros((3, 1))
    begin[POSITION], begin[VELOCITY] = position, velocity
    if duration_s <= MIN_SEGMENT_S:
        return Track.hold([joint], begin[POSITION], time_s)
    end[POSITION] = position + 0.5 * duration_s * velocity
    coefficients = segment_coefficients(begin, end, duration_s, order)
    return Track.one_segment([joint], time_s, time_s + duration_s, coefficients, end[POSITION])
