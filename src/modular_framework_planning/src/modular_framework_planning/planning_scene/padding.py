# SPDX-License-Identifier: BSD-3-Clause
"""The distance that the robot keeps from the world: MoveIt's link padding and link scale.

Padding is a margin of a pair of bodies, not a changed shape: a pair of a link and a world object counts as touching
when it comes closer than the margin. That is the shape swept by a ball of the margin's radius, exactly, meshes too.
As in MoveIt, pairs of links are never padded.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from modular_framework_planning.errors import GeometryError


@dataclass(frozen=True, slots=True)
class Padding:
    """Distances [m] that links, held objects and world objects keep, and scales of links.

    Attributes:
        links: padding of a link [m]; a link that is not named has none.
        scales: scale of a link, 1 where it is not named.
        objects: added for every object of the world [m].
        attached: added for every held object [m].
    """

    links: Mapping[str, float] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)
    objects: float = 0.0
    attached: float = 0.0

    def __post_init__(self) -> None:
        named = {f"of link '{link}'": value for link, value in self.links.items()}
        for where, value in {**named, "of world objects": self.objects, "of held objects": self.attached}.items():
            if not np.isfinite(value) or value < 0.0:
                raise GeometryError(f"padding {where}: got {value} m; allowed are finite lengths of 0 m or more")
        for link, value in self.scales.items():
            if not np.isfinite(value) or value <= 0.0:
                raise GeometryError(f"scale of link '{link}': got {value}; allowed are finite numbers above 0")

    def margin(self, link: str, geometry: Any) -> float:
        """Returns the distance [m] a Coal geometry of a link keeps from the world.

        A scale s above 1 moves no point of the surface further than (s - 1) times the largest distance of a point from
        the centre, so that much is kept everywhere; a scale below 1 keeps the shape as it is: neither makes the robot
        smaller than was asked for.
        """
        grown = self.scales.get(link, 1.0) - 1.0
        if grown > 0.0:
            geometry.computeLocalAABB()
        return self.links.get(link, 0.0) + self.objects + (grown * float(geometry.aabb_radius) if grown > 0.0 else 0.0)

    def with_links(self, links: Mapping[str, float], scales: Mapping[str, float]) -> Padding:
        """Returns a padding in which the named links have other values."""
        return replace(self, links={**self.links, **links}, scales={**self.scales, **scales})


def uniform_padding(
    links: Iterable[str], padding: float, scale: float, objects: float = 0.0, attached: float = 0.0
) -> Padding:
    """Returns the padding in which every link has the same values."""
    names = list(links)
    return Padding(
        {name: padding for name in names if padding}, {name: scale for name in names if scale != 1.0}, objects, attached
    )
