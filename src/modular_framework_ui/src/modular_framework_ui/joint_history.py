# SPDX-License-Identifier: BSD-3-Clause
"""Samples of the joints during a task, at a low rate that a browser can draw."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from modular_framework_ui.revised_entries import RevisedEntries

Values = tuple[float | None, ...]
"""Value of each joint, in the order of the joints' names; None if unknown."""


class Quantity(Enum):
    """Quantity of a joint."""

    POSITION = "position"  # [rad or m]
    VELOCITY = "velocity"  # [rad/s or m/s]
    EFFORT = "effort"  # [N m or N]
    ERROR = "error"  # desired minus measured position [rad or m]


@dataclass(frozen=True, slots=True)
class JointSample:
    """Values of all joints at a time.

    Attributes:
        time_s: Time [s].
        values: Values of each quantity, in the order of `Quantity`; joints that became known later are absent.
    """

    time_s: float
    values: tuple[Values, ...]


class JointHistory:
    """Keeps the latest value of each joint, and samples all values periodically.

    Args:
        max_samples: Maximum number of samples; a new sample replaces the oldest sample of a full history.
        period_s: Minimum time between two samples [s].
    """

    def __init__(self, max_samples: int, period_s: float) -> None:
        self._period_s = period_s
        self._samples = RevisedEntries[JointSample](max_samples)
        self._next_s = -math.inf
        self._latest: dict[Quantity, dict[str, float | None]] = {quantity: {} for quantity in Quantity}
        self._joints: dict[str, None] = {}

    @property
    def joints(self) -> tuple[str, ...]:
        """Returns the names of the joints, in the order of their first values."""
        return tuple(self._joints)

    @property
    def oldest(self) -> int:
        """Returns the index of the oldest sample, or the next index if there is no sample."""
        return self._samples.oldest

    def note(self, quantity: Quantity, joints: Sequence[str], values: Sequence[float]) -> None:
        """Records the latest values of some joints.

        Args:
            quantity: Quantity of the values.
            joints: Names of the joints.
            values: Value of each joint; empty if unknown.
        """
        self._joints.update(dict.fromkeys(joints))
        known = ((joint, value if math.isfinite(value) else None) for joint, value in zip(joints, values, strict=False))
        self._latest[quantity].update(known)

    def sample(self, time_s: float, revision: int) -> bool:
        """Adds a sample of the latest values unless the previous sample is too recent; returns whether it was added.

        Args:
            time_s: Current time [s].
            revision: Revision of the change.
        """
        if time_s < self._next_s or not self._joints:
            return False
        self._next_s = time_s + self._period_s
        values = tuple(tuple(latest.get(joint) for joint in self._joints) for latest in self._latest.values())
        self._samples.add(JointSample(time_s, values), revision)
        return True

    def clear(self) -> None:
        """Removes all samples; the latest values are kept."""
        self._samples.clear()
        self._next_s = -math.inf

    def sampled_since(self, revision: int) -> dict[int, JointSample]:
        """Returns the samples that were added after a revision, keyed by index."""
        return self._samples.added_since(revision)
