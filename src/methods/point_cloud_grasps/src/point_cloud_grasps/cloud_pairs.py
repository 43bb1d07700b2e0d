# SPDX-License-Identifier: BSD-3-Clause
"""Samples pairs of contacts on points with normals: both in the friction cone, no wider than the gripper opens."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modular_framework_core.grasp_generation.contact_pair import ContactPair, PairRules, distinct_pairs

Array = npt.NDArray[np.float64]

NARROWEST_M = 1e-3
"""Contacts that are nearer than this are not on two sides."""


@dataclass(frozen=True, slots=True)
class CloudPairSettings(PairRules):
    """What counts as a pair of contacts, and how many are looked for.

    Attributes:
        contact_samples: Contacts that are drawn; all pairs of them are looked at.
        max_pairs: Greatest number of pairs that are kept, the best aligned and most central ones.
    """

    contact_samples: int = 800
    max_pairs: int = 3000


@dataclass(frozen=True, slots=True)
class FoundPairs:
    """Pairs of contacts.

    Attributes:
        pairs: Those that fit the gripper, best first.
        narrowest_m: Least distance of two contacts in each other's friction cone, fitting or not [m]; inf: there are
            none.
    """

    pairs: list[ContactPair]
    narrowest_m: float


def sample_pairs(
    points: Array,
    normals: Array,
    centroid: Array,
    max_width: float,
    settings: CloudPairSettings,
    generator: np.random.Generator,
) -> FoundPairs:
    """Draws contacts and returns the pairs among them that two fingers can hold.

    Args:
        points: (n, 3) where a pad may touch [m].
        normals: (n, 3) outward unit normals there.
        centroid: (3,) centre of mass of the object [m].
        max_width: Greatest distance of the contacts [m].
        settings: What counts as a pair.
        generator: Source of all random choices.
    """
    chosen = generator.permutation(len(points))[: settings.contact_samples]
    points, normals = points[chosen], normals[chosen]
    first, second = np.triu_indices(len(points), k=1)
    lines = points[second] - points[first]
    widths = np.linalg.norm(lines, axis=1)
    apart = widths > NARROWEST_M
    first, second, widths = first[apart], second[apart], widths[apart]
    lines = lines[apart] / widths[:, None]
    alignments = np.minimum(-(normals[first] * lines).sum(axis=1), (normals[second] * lines).sum(axis=1))
    held = alignments >= settings.cone_cosine
    if not held.any():
        return FoundPairs([], math.inf)
    narrowest = float(widths[held].min())
    held &= widths <= max_width
    first, second, lines, alignments = first[held], second[held], lines[held], alignments[held]
    from_centre = centroid - (points[first] + points[second]) / 2
    offsets = np.linalg.norm(from_centre - lines * (from_centre * lines).sum(axis=1, keepdims=True), axis=1)
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    squareness = (alignments - settings.cone_cosine) / (1.0 - settings.cone_cosine)
    best = np.argsort(offsets / extent - squareness, kind="stable")[: settings.max_pairs]
    found = (
        ContactPair(points[one], points[other], float(alignment))
        for one, other, alignment in zip(first[best], second[best], alignments[best], strict=True)
    )
    return FoundPairs(distinct_pairs(found, settings), narrowest)
