# SPDX-License-Identifier: BSD-3-Clause
"""Tells a link that is silent from a computer that is busy, and the state of an arm from garbage on the line."""
from __future__ import annotations

import math

from modular_framework_drivers.ur.arm_messages import ArmState

_LONGEST_STEP_S = 0.02
_MAX_POSITION = 100.0           # some joints, as wrist 3 of a UR3, turn without end [rad]
_MAX_SPEED = 2.0 * math.pi      # of a measured joint; twice what a UR5's does [rad/s]
_SLACK = 0.05                   # rounding and jitter of the clock [rad]


class SilenceWatch:
    """How long nothing was heard, as far as somebody listened.

    A listener that is called every few milliseconds and comes a second late has not heard a second of silence: what was
    said meanwhile may be on its way through this computer. So no look counts for more than 20 ms.

    Args:
        now_s: on a clock that never jumps [s].
    """

    __slots__ = ("_last_s", "_silent_s")

    def __init__(self, now_s: float) -> None:
        self._last_s = now_s
        self._silent_s = 0.0

    def update(self, now_s: float, heard: bool) -> float:
        """Note whether something was heard since the last look; returns how long nothing was [s]."""
        self._silent_s = 0.0 if heard else self._silent_s + min(now_s - self._last_s, _LONGEST_STEP_S)
        self._last_s = now_s
        return self._silent_s


def is_plausible(state: ArmState, last: ArmState | None) -> bool:
    """Whether an arm can be in that state after the last one; garbage on the line, read as a state, cannot."""
    if not math.isfinite(state.timestamp_s) or not all(abs(position) <= _MAX_POSITION for position in state.positions):
        return False
    if last is None:
        return True
    reach = _MAX_SPEED * (state.received_s - last.received_s) + _SLACK
    return state.timestamp_s > last.timestamp_s and all(
        abs(new - old) <= reach for new, old in zip(state.positions, last.positions, strict=True))
