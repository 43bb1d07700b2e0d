# SPDX-License-Identifier: BSD-3-Clause
"""A pair of contacts at which two fingers can hold an object."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ContactPair:
    """Two contacts on opposite sides.

    Attributes:
        first: (3,) where the line between them enters the object [m].
        second: (3,) where it leaves the object [m].
        alignment: The lesser cosine between that line and the inward normal of the first, or the outward normal of the
            second contact.
    """

    first: Array
    second: Array
    alignment: float

    @property
    def width(self) -> float:
        """Distance between the contacts [m]."""
        return float(np.linalg.norm(self.second - self.first))

    @property
    def axis(self) -> Array:
        """Unit vector (3,) from the first contact to the second: the closing axis."""
        return (self.second - self.first) / self.width

    @property
    def middle(self) -> Array:
        """Half way between the contacts (3,) [m]."""
        return (self.first + self.second) / 2

    def distance_from(self, point: Array) -> float:
        """Returns the distance of the closing axis from a point (3,) [m]."""
        offset = point - self.middle
        return float(np.linalg.norm(offset - self.axis * (offset @ self.axis)))


@dataclass(frozen=True, slots=True)
class PairRules:
    """Which contacts make a pair, and which pairs are nearly the same.

    Attributes:
        friction: Coefficient of friction between pad and object; its cone has the half angle atan(friction).
        spacing_m: Pairs whose middles are nearer than this ...
        spacing_rad: ... and whose axes differ by less than this [rad] count as one, of which the best is kept.
    """

    friction: float = 0.3
    spacing_m: float = 0.012
    spacing_rad: float = math.radians(14.0)

    @property
    def cone_cosine(self) -> float:
        """Cosine of the half angle of the friction cone."""
        return 1.0 / math.hypot(1.0, self.friction)


def distinct_pairs(pairs: Iterable[ContactPair], rules: PairRules) -> list[ContactPair]:
    """Keeps the first of all pairs that are nearly the same.

    Args:
        pairs: The pairs, best first.
        rules: Which are nearly the same.
    """
    kept: list[ContactPair] = []
    middles, axes = np.zeros((0, 3)), np.zeros((0, 3))
    least = math.cos(rules.spacing_rad)
    for pair in pairs:
        near = np.linalg.norm(middles - pair.middle, axis=1) < rules.spacing_m
        if not (near & (np.abs(axes @ pair.axis) > least)).any():
            kept.append(pair)
            middles, axes = np.vstack([middles, pair.middle]), np.vstack([axes, pair.axis])
    return kept
