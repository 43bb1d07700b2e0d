# SPDX-License-Identifier: BSD-3-Clause
"""Detects from contacts which object a gripper holds.

A gripper holds an object after the object has touched two fingers for some time, and releases it after the object has
lost contact with a finger for some time. Single contacts are ignored, because they change while an object settles
between the pads.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence


class GraspWatch:
    """Tracks the contacts of a gripper's fingers.

    Args:
        hold_after_s: Contact time of two fingers after which an object is held [s of simulated time].
        release_after_s: Time without contact of two fingers after which the object is released [s of simulated time].
    """

    def __init__(self, hold_after_s: float = 0.2, release_after_s: float = 0.3) -> None:
        self._hold_after_s = hold_after_s
        self._release_after_s = release_after_s
        self._touched_since: dict[str, float] = {}
        self._missed_since: float | None = None
        self.held: str | None = None

    def reset(self) -> None:
        """Discards all contacts."""
        self._touched_since.clear()
        self._missed_since = None
        self.held = None

    def update(self, time_s: float, touched_by_finger: Sequence[Collection[str]]) -> str | None:
        """Updates the held object.

        Args:
            time_s: Simulated time [s].
            touched_by_finger: Names of the movable objects in contact, per finger.

        Returns:
            Name of the held object; None if the gripper holds no object.
        """
        counts: dict[str, int] = {}
        for touched in touched_by_finger:
            for name in set(touched):
                counts[name] = counts.get(name, 0) + 1
        grasped = {name for name, count in counts.items() if count >= 2}
        self._touched_since = {name: self._touched_since.get(name, time_s) for name in grasped}
        if self.held is not None:
            self._update_held(time_s, grasped)
        if self.held is None:
            self._detect_new(time_s)
        return self.held

    def _update_held(self, time_s: float, grasped: Collection[str]) -> None:
        if self.held in grasped:
            self._missed_since = None
        elif self._missed_since is None:
            self._missed_since = time_s
        elif time_s - self._missed_since >= self._release_after_s:
            self.held = None
            self._missed_since = None

    def _detect_new(self, time_s: float) -> None:
        candidates = [
            (since, name) for name, since in self._touched_since.items() if time_s - since >= self._hold_after_s
        ]
        if candidates:
            self.held = min(candidates)[1]
            self._missed_since = None
