# SPDX-License-Identifier: BSD-3-Clause
"""Compares where the joints of the arm are with where they should be."""
from __future__ import annotations

from collections.abc import Mapping


def worst_joint(current: Mapping[str, float], wanted: Mapping[str, float]) -> tuple[str, float]:
    """Returns the joint farthest from where it should be, and how far it is [rad or m]; infinitely far when unknown."""
    distances = {joint: abs(current.get(joint, float("inf")) - position) for joint, position in wanted.items()}
    worst = max(distances, key=distances.__getitem__)
    return worst, distances[worst]
