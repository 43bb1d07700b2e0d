# SPDX-License-Identifier: BSD-3-Clause
"""Finds and ranks antipodal grasps: two fingers close on opposite sides, the hand comes from above, inclined or level.

Pairs of contacts come from lines through the object (:mod:`contact_pairs`); what the hand does with each is that of
every method which begins with pairs, :mod:`modular_framework_core.grasp_generation.pair_grasps`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from antipodal_grasps.contact_pairs import PairSettings, contact_pairs
from modular_framework_core.grasp_generation.grasp_candidates import GraspQuery
from modular_framework_core.grasp_generation.pair_grasps import PairGrasp, PairGraspSettings, grasps_on_pairs


@dataclass(frozen=True, slots=True)
class AntipodalSettings(PairGraspSettings):
    """What counts as usable, how much is tried, and how grasps are ranked.

    Attributes:
        pairs: How pairs of contacts are found.
    """

    pairs: PairSettings = field(default_factory=PairSettings)


def antipodal_grasps(query: GraspQuery, settings: AntipodalSettings) -> list[PairGrasp]:
    """Finds the grasps of an object; the same query gives the same grasps.

    Args:
        query: The object, what stands around it, and the hand.
        settings: What counts as usable.

    Returns:
        Usable grasps in the order in which their reachability should be checked.
    """
    generator = np.random.default_rng(query.seed)
    widest = settings.widest(query.gripper)
    pairs = contact_pairs(query.target.solids, query.target.surface.centroid, widest, settings.pairs, generator)
    return grasps_on_pairs(pairs, query, settings)
