# SPDX-License-Identifier: BSD-3-Clause
"""Distinguishes a silent connection from a busy computer, and valid states of the arm from corrupted data."""

from __future__ import annotations

import math

from modular_framework_drivers.ur.arm_messages import ArmState

_MAX_STEP_S = 0.02
_MAX_POSITION = 100.0  # [rad]; some joints, such as wrist 3 of a UR3, rotate without limits
_MAX_SPEED = 2.0 * math.pi  # measured joint speed [rad/s], twice the maximum of a UR5
_POSITION_MARGIN = 0.05  # margin for rounding and clock jitter [rad]
_MAX_MEASUREMENT = 1e4  # magnitude of currents [A], forces [N] and torques [Nm]
_MAX_MODE = 31
_MAX_ADVANCE_S = 2.0  # advance of the controller's clock relative to the local clock at the end of a delay


class ModeConfirmation:
    """Accepts modes of the arm once two successive states agree, because a flipped bit may yield another valid mode."""

    def __init__(self) -> None:
        self._accepted: tuple[int, ...] | None = None
        self._previous: tuple[int, ...] | None = None

    def confirm(self, modes: tuple[int, ...] | None) -> bool:
        """Returns whether the modes of the newest state equal the accepted modes or the modes of the previous state.

        Args:
            modes: Modes of the newest state; None for a state read from damaged data. After damaged data, two further
                states must agree, because successive states are then likely to be damaged as well.
        """
        is_confirmed = modes is not None and modes in (self._accepted, self._previous)
        self._previous = modes
        if is_confirmed:
            self._accepted = modes
        return is_confirmed


class SilenceWatch:
    """Measures the time without a received message.

    A check that is a second late has not observed a second of silence, as messages may wait in the queues of this
    computer. Therefore, each interval between two checks counts for at most 20 ms.

    Args:
        now_s: Current time on a steady clock [s].
    """

    __slots__ = ("_last_check_s", "_silent_s")

    def __init__(self, now_s: float) -> None:
        self._last_check_s = now_s
        self._silent_s = 0.0

    def update(self, now_s: float, heard: bool) -> float:
        """Records whether a message arrived since the last call, and returns the duration of the silence [s].

        Args:
            now_s: Current time on the same clock [s].
            heard: Whether a message arrived.
        """
        self._silent_s = 0.0 if heard else self._silent_s + min(now_s - self._last_check_s, _MAX_STEP_S)
        self._last_check_s = now_s
        return self._silent_s


def is_plausible(state: ArmState, last: ArmState | None) -> bool:
    """Returns whether a state can follow the last state; states read from corrupted data cannot."""
    measurements = (*state.currents, *state.wrench, state.speed_fraction, state.speed_scaling)
    if not (
        math.isfinite(state.timestamp_s)
        and all(abs(position) <= _MAX_POSITION for position in state.positions)
        and all(abs(velocity) <= 2.0 * _MAX_SPEED for velocity in state.velocities)
        and all(abs(measurement) <= _MAX_MEASUREMENT for measurement in measurements)
        and all(-1 <= mode <= _MAX_MODE for mode in state.modes)
    ):
        return False
    if last is None:
        return True
    elapsed_s = state.received_s - last.received_s
    max_displacement = _MAX_SPEED * elapsed_s + _POSITION_MARGIN
    return 0.0 < state.timestamp_s - last.timestamp_s <= elapsed_s + _MAX_ADVANCE_S and all(
        abs(new - old) <= max_displacement for new, old in zip(state.positions, last.positions, strict=True)
    )
