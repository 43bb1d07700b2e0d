# SPDX-License-Identifier: BSD-3-Clause
"""Distinguishes a silent link from a busy computer, and a state of the arm from corrupted data."""

from __future__ import annotations

import math

from modular_framework_drivers.ur.arm_messages import ArmState

_LONGEST_STEP_S = 0.02
_MAX_POSITION = 100.0  # some joints, as wrist 3 of a UR3, turn without end [rad]
_MAX_SPEED = 2.0 * math.pi  # of a measured joint; twice what a UR5's does [rad/s]
_SLACK = 0.05  # rounding and jitter of the clock [rad]
_MAX_FIGURE = 1e4  # of currents [A], forces [N] and torques [Nm]
_MAX_MODE = 31
_MAX_ADVANCE_S = 2.0  # of the controller's clock before ours, when a delay ends


class SilenceWatch:
    """Measures for how long no message was received, as far as it was checked.

    A check that runs every few milliseconds but comes a second late has not seen a second of silence: messages may be
    in the queues of this computer. So the time between two checks counts for 20 ms at most.

    Args:
        now_s: on a clock that never jumps [s].
    """

    __slots__ = ("_last_s", "_silent_s")

    def __init__(self, now_s: float) -> None:
        self._last_s = now_s
        self._silent_s = 0.0

    def update(self, now_s: float, heard: bool) -> float:
        """Notes whether a message was received since the last call; returns the length of the silence [s]."""
        self._silent_s = 0.0 if heard else self._silent_s + min(now_s - self._last_s, _LONGEST_STEP_S)
        self._last_s = now_s
        return self._silent_s


def is_plausible(state: ArmState, last: ArmState | None) -> bool:
    """Whether an arm can be in this state after the last one; corrupted data, read as a state, is not plausible."""
    figures = (*state.currents, *state.wrench, state.speed_fraction, state.speed_scaling)
    if not (
        math.isfinite(state.timestamp_s)
        and all(abs(position) <= _MAX_POSITION for position in state.positions)
        and all(abs(velocity) <= 2.0 * _MAX_SPEED for velocity in state.velocities)
        and all(abs(figure) <= _MAX_FIGURE for figure in figures)
        and all(-1 <= mode <= _MAX_MODE for mode in state.modes)
    ):
        return False
    if last is None:
        return True
    elapsed_s = state.received_s - last.received_s
    reach = _MAX_SPEED * elapsed_s + _SLACK
    return 0.0 < state.timestamp_s - last.timestamp_s <= elapsed_s + _MAX_ADVANCE_S and all(
        abs(new - old) <= reach for new, old in zip(state.positions, last.positions, strict=True)
    )
