# SPDX-License-Identifier: BSD-3-Clause
"""Computes the motion in which joints come to rest when a motion is stopped before its end.

A stop begins at the measured state, not at the desired one, because the joints may not have followed the trajectory.
"""

from __future__ import annotations

import numpy as np

from modular_framework_control.trajectory.joint_trajectory import (
    POSITION,
    SHORTEST_SEGMENT_S,
    VELOCITY,
    Array,
    Track,
    segment_coefficients,
)
from modular_framework_control.trajectory.motion_limits import MotionLimits

FOLLOWING_LAG_S = 0.05
"""Largest lag of a joint behind its commands [s]: a ramp begins at the position that the joint reaches in this time at
its measured velocity. Tuned on an arm that follows 0.03 s late over a network; a joint with a larger lag moves back a
little while it brakes."""
COMMAND_S = 0.01
"""Largest age of the last command [s]; the desired motion since then has not been sent to the joint."""
FOLLOWING_SHARE = 0.1
"""A joint whose measured velocity differs from the desired one by at most this share of it counts as following; a ramp
then begins at the desired velocity, because measured velocities are late and noisy."""
SHARP_BRAKING_SHARE = 0.9
"""Share of the largest deceleration that a stop without a ramp takes. The rest is for a joint that follows late to
catch up, so that it does not run past the end of the stop and come back."""
PEAK_OF_RAMP = 1.5
"""Largest deceleration of a ramp, as a multiple of its mean one."""


class StopMotion:
    """Makes the motion in which joints stop.

    Args:
        duration_s: of a ramp [s], longer where a joint may not brake that hard; 0 to brake as hard as each joint may: a
            joint whose largest deceleration is not known is held where it is measured.
        limits: of the joints.
    """

    def __init__(self, duration_s: float, limits: MotionLimits) -> None:
        self._duration_s = duration_s
        self._limits = limits

    def tracks(self, desired: Array, actual: Array, time_s: float, rate: float) -> list[Track]:
        """The motion of all joints from `time_s` on.

        Args:
            desired: positions and velocities desired now, shape (3, joints) or (2, joints).
            actual: positions and velocities measured, shape (2, joints).
            time_s: now [s of the trajectories' clock].
            rate: how fast that clock runs, 0 to 1; a slowed robot has as much less speed to lose.
        """
        limits, sharp = self._limits, self._duration_s * rate <= SHORTEST_SEGMENT_S
        follows = np.abs(desired[VELOCITY] - actual[VELOCITY]) <= FOLLOWING_SHARE * np.abs(desired[VELOCITY])
        velocity = np.clip(np.where(follows, desired[VELOCITY], actual[VELOCITY]), -limits.fastest, limits.fastest)
        under_way = FOLLOWING_LAG_S * np.minimum(np.abs(actual[VELOCITY]), limits.fastest) + COMMAND_S * np.minimum(
            np.abs(desired[VELOCITY]), limits.fastest
        )
        ahead = np.clip(desired[POSITION] - actual[POSITION], -under_way, under_way)
        limits = limits.with_positions(actual[POSITION])
        position = np.clip(actual[POSITION] + ahead, limits.lowest, limits.highest)
        with np.errstate(divide="ignore", invalid="ignore"):
            braking_s = np.where(limits.braking > 0.0, np.abs(velocity) / limits.braking, 0.0)
        durations_s = rate * np.maximum(
            self._duration_s, braking_s * (1.0 / SHARP_BRAKING_SHARE if sharp else PEAK_OF_RAMP)
        )
        if not (durations_s > SHORTEST_SEGMENT_S).any():
            return [Track.hold(list(range(len(durations_s))), actual[POSITION], time_s)]
        return [
            _ramp(
                joint,
                (position[joint], velocity[joint] / rate) if duration_s > 0.0 else (actual[POSITION, joint], 0.0),
                time_s,
                duration_s,
                limits.highest[joint] if velocity[joint] > 0.0 else limits.lowest[joint],
                3 if sharp else 5,
            )
            for joint, duration_s in enumerate(durations_s.tolist())
        ]


def _ramp(joint: int, start: tuple[float, float], time_s: float, duration_s: float, bound: float, order: int) -> Track:
    """A ramp to rest on which half of the way without it is gone; `bound` ends it earlier.

    The velocity falls evenly with `order` 3, as 1 - 3s^2 + 2s^3 with 5.
    """
    position, velocity = start
    left = abs(bound - position)
    if 0.5 * abs(velocity) * duration_s > left:
        duration_s = 2.0 * left / abs(velocity)
    begin, end = np.zeros((3, 1)), np.zeros((3, 1))
    begin[POSITION], begin[VELOCITY] = position, velocity
    if duration_s <= SHORTEST_SEGMENT_S:
        return Track.hold([joint], begin[POSITION], time_s)
    end[POSITION] = position + 0.5 * duration_s * velocity
    coefficients = segment_coefficients(begin, end, duration_s, order)
    return Track.one_segment([joint], time_s, time_s + duration_s, coefficients, end[POSITION])
