# SPDX-License-Identifier: BSD-3-Clause
"""Samples antipodal contact pairs from points with normals, no wider than the gripper's opening."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modular_framework_core.grasp_generation.contact_pair import ContactPair, PairRules, distinct_pairs

Array = npt.NDArray[np.float64]

MIN_WIDTH_M = 1e-3
"""Minimum width of a pair; closer contacts are not on opposite sides."""


@dataclass(frozen=True, slots=True)
class CloudPairSettings(PairRules):
    """Feasibility limits of a contact pair, and search effort.

    Attributes:
        contact_samples: Number of sampled contacts; all pairs of these contacts are evaluated.
        max_pairs: Maximum number of kept pairs, ranked by alignment and distance from the centre.
    """

    contact_samples: int = 800
    max_pairs: int = 3000


@dataclass(frozen=True, slots=True)
class FoundPairs:
    """Contact pairs.

    Attributes:
        pairs: Pairs that fit the gripper, best first.
        narrowest_m: Minimum width of all pairs in the friction cone [m]; inf without a pair.
    """

    pairs: list[ContactPair]
    narrowest_m: float


def sample_pairs(
    points: Array,
    normals: Array,
    centroid: Array,
    max_width: float,
    *,
    settings: CloudPairSettings,
    generator: np.random.Generator,
) -> FoundPairs:
    """Samples contacts and returns the pairs that two fingers can hold.

    Args:
        points: Possible contacts, shape (n, 3) [m].
        normals: Outward unit normals at the points, shape (n, 3).
        centroid: Centre of mass of the object, shape (3,) [m].
        max_width: Maximum distance between the contacts [m].
        settings: Feasibility limits of a pair.
        generator: Random number generator.
    """
    chosen = generator.permutation(len(points))[: settings.contact_samples]
    points, normals = points[chosen], normals[chosen]
    first, second = np.triu_indices(len(points), k=1)
    lines = points[second] - points[first]
    widths = np.linalg.norm(lines, axis=1)
    apart = widths > MIN_WIDTH_M
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
    pair_order = (
        ContactPair(points[first_index], points[second_index], float(alignment))
        for first_index, second_index, alignment in zip(first[best], second[best], alignments[best], strict=True)
    )
    return FoundPairs(distinct_pairs(pair_order, settings), narrowest)
