# SPDX-License-Identifier: BSD-3-Clause
"""Pairs of contacts at which two fingers can hold an object."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ContactPair:
    """Two contacts on opposite sides of an object.

    Attributes:
        first: Contact at which the line through both contacts enters the object, shape (3,) [m].
        second: Contact at which this line leaves the object, shape (3,) [m].
        alignment: Smaller cosine between this line and a surface normal: the inward normal at the first contact, or
            the outward normal at the second.
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
        """Closing axis: unit vector from the first to the second contact, shape (3,)."""
        return (self.second - self.first) / self.width

    @property
    def middle(self) -> Array:
        """Midpoint of the contacts, shape (3,) [m]."""
        return (self.first + self.second) / 2

    def distance_from(self, point: Array) -> float:
        """Returns the distance between the closing axis and a point of shape (3,) [m]."""
        offset = point - self.middle
        return float(np.linalg.norm(offset - self.axis * (offset @ self.axis)))


@dataclass(frozen=True, slots=True)
class PairRules:
    """Limits for valid pairs and for duplicate pairs.

    Pairs are duplicates if both their midpoints and their closing axes are closer than the spacings.

    Attributes:
        friction: Friction coefficient between pad and object; the friction cone has the half angle atan(friction).
        spacing_m: Minimum distance between the midpoints of distinct pairs [m].
        spacing_rad: Minimum angle between the closing axes of distinct pairs [rad].
    """

    friction: float = 0.3
    spacing_m: float = 0.012
    spacing_rad: float = math.radians(14.0)

    @property
    def cone_cosine(self) -> float:
        """Cosine of the half angle of the friction cone."""
        return 1.0 / math.hypot(1.0, self.friction)


def distinct_pairs(pairs: Iterable[ContactPair], rules: PairRules) -> list[ContactPair]:
    """Removes duplicate pairs.

    Args:
        pairs: Pairs, best first; the first of several duplicates is kept.
        rules: Spacings of distinct pairs.
    """
    distinct: list[ContactPair] = []
    middles, axes = np.zeros((0, 3)), np.zeros((0, 3))
    min_cosine = math.cos(rules.spacing_rad)
    for pair in pairs:
        near = np.linalg.norm(middles - pair.middle, axis=1) < rules.spacing_m
        if not (near & (np.abs(axes @ pair.axis) > min_cosine)).any():
            distinct.append(pair)
            middles, axes = np.vstack([middles, pair.middle]), np.vstack([axes, pair.axis])
    return distinct
