# SPDX-License-Identifier: BSD-3-Clause
"""Margins between the robot and the world: MoveIt's link padding and link scale.

Padding does not change shapes; padding is the minimum distance between two bodies: a link and a world object count as
touching when closer than the margin. The result equals the exact Minkowski sum of the shape and a sphere, also for
meshes. As in MoveIt, pairs of links are never padded.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from modular_framework_planning.errors import GeometryError


@dataclass(frozen=True, slots=True)
class Padding:
    """Padding of links, held objects and world objects, and scales of links.

    Attributes:
        links: Padding of each link [m], default 0.
        scales: Scale of each link, default 1.
        objects: Padding of every world object [m].
        attached: Padding of every held object [m].
    """

    links: Mapping[str, float] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)
    objects: float = 0.0
    attached: float = 0.0

    def __post_init__(self) -> None:
        named = {f"of link '{link}'": value for link, value in self.links.items()}
        for source_name, value in {**named, "of world objects": self.objects, "of held objects": self.attached}.items():
            if not np.isfinite(value) or value < 0.0:
                raise GeometryError(f"padding {source_name}: got {value} m; give a finite length of at least 0 m")
        for link, value in self.scales.items():
            if not np.isfinite(value) or value <= 0.0:
                raise GeometryError(f"scale of link '{link}': got {value}; give a finite number above 0")

    def margin(self, link: str, geometry: Any) -> float:
        """Returns the margin between a Coal geometry of a link and the world [m].

        A scale s above 1 becomes a conservative margin: (s - 1) times the maximum distance of a point from the centre.
        A scale below 1 leaves the shape unchanged, so that the robot never gets smaller than requested.
        """
        growth = self.scales.get(link, 1.0) - 1.0
        if growth > 0.0:
            geometry.computeLocalAABB()
        return (
            self.links.get(link, 0.0) + self.objects + (growth * float(geometry.aabb_radius) if growth > 0.0 else 0.0)
        )

    def with_links(self, links: Mapping[str, float], scales: Mapping[str, float]) -> Padding:
        """Returns a copy of the padding with the given links changed."""
        return replace(self, links={**self.links, **links}, scales={**self.scales, **scales})


def uniform_padding(
    links: Iterable[str], padding: float, scale: float, objects: float = 0.0, attached: float = 0.0
) -> Padding:
    """Returns a padding with equal values for all links.

    Args:
        links: Names of the links.
        padding: Padding of every link [m].
        scale: Scale of every link.
        objects: Padding of every world object [m].
        attached: Padding of every held object [m].
    """
    names = list(links)
    return Padding(
        {name: padding for name in names if padding}, {name: scale for name in names if scale != 1.0}, objects, attached
    )
