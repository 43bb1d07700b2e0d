# SPDX-License-Identifier: BSD-3-Clause
"""Generates and ranks antipodal grasps of a two-finger gripper that approaches from above, inclined or level.

Contact pairs are found by ray casting (:mod:`contact_pairs`); the hand poses at each pair come from
:mod:`modular_framework_core.grasp_generation.pair_grasps`, as in all methods based on contact pairs.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from antipodal_grasps.contact_pairs import PairSettings, contact_pairs
from modular_framework_core.grasp_generation.grasp_candidates import GraspQuery
from modular_framework_core.grasp_generation.pair_grasps import PairGrasp, PairGraspSettings, grasps_on_pairs


@dataclass(frozen=True, slots=True)
class AntipodalSettings(PairGraspSettings):
    """Feasibility limits, search effort and ranking of grasps.

    Attributes:
        pairs: Settings of the contact pairs.
    """

    pairs: PairSettings = field(default_factory=PairSettings)


def antipodal_grasps(query: GraspQuery, settings: AntipodalSettings) -> list[PairGrasp]:
    """Returns the grasps of an object; deterministic for a given query.

    Args:
        query: Object, surroundings and hand.
        settings: Feasibility limits.

    Returns:
        Feasible grasps in the order in which their reachability should be checked.
    """
    generator = np.random.default_rng(query.seed)
    widest = settings.widest(query.gripper)
    pairs = contact_pairs(query.target.solids, query.target.surface.centroid, widest, settings.pairs, generator)
    return grasps_on_pairs(pairs, query, settings)
