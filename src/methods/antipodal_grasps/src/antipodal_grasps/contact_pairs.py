# SPDX-License-Identifier: BSD-3-Clause
"""Finds pairs of contacts at which two fingers can hold an object: each in the friction cone of its surface."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from antipodal_grasps.ray_casting import Crossing, lines_through
from modular_framework_core.grasp_generation import solid_meshes
from modular_framework_core.grasp_generation.contact_pair import ContactPair, PairRules, distinct_pairs
from modular_framework_urdf.mesh_reader import TriangleMesh

Array = npt.NDArray[np.float64]

ALIGNMENT_DIGITS = 3
SAME_PLACE_M = 1e-5
"""Crossings that are nearer to each other than this are at the same place."""


@dataclass(frozen=True, slots=True)
class PairSettings(PairRules):
    """What counts as a pair of contacts, and how many are looked for.

    Attributes:
        surface_samples: Points of the surface from which lines are cast.
        lines_per_sample: Lines from each point: one along the normal, the others within the friction cone.
    """

    surface_samples: int = 300
    lines_per_sample: int = 3


def contact_pairs(
    solids: Sequence[TriangleMesh],
    centroid: Array,
    max_width: float,
    settings: PairSettings,
    generator: np.random.Generator,
) -> list[ContactPair]:
    """Finds pairs of contacts of an object.

    Lines go inwards from points of its surface, and in the same directions through its centre of mass. Wherever one
    enters the object from free space and wherever it then leaves it, is a pair: of a mug, both the wall and the whole.

    Args:
        solids: Closed parts of the object.
        centroid: (3,) its centre of mass [m].
        max_width: Greatest distance of the contacts [m].
        settings: What counts as a pair.
        generator: Source of all random choices.

    Returns:
        The pairs, best aligned first, and of those equally aligned the most central first.
    """
    mesh = solid_meshes.joined(solids)
    points, normals = _samples(mesh, settings.surface_samples, generator)
    directions = np.concatenate(
        [-normals, *(_in_cone(-normals, settings.friction, generator) for _ in range(settings.lines_per_sample - 1))]
    )
    origins = np.concatenate([np.tile(points, (settings.lines_per_sample, 1)), np.tile(centroid, (len(points), 1))])
    directions = np.concatenate([directions, -normals])
    found = []
    for origin, direction, crossings in zip(origins, directions, lines_through(mesh, origins, directions), strict=True):
        for entry, end in _passages(crossings):
            alignment = min(float(-entry.normal @ direction), float(end.normal @ direction))
            if end.distance - entry.distance <= max_width and alignment >= settings.cone_cosine:
                ends = (origin + entry.distance * direction, origin + end.distance * direction)
                found.append(ContactPair(*ends, alignment))
    found.sort(key=lambda pair: (-round(pair.alignment, ALIGNMENT_DIGITS), pair.distance_from(centroid)))
    return distinct_pairs(found, settings)


def _samples(mesh: TriangleMesh, count: int, generator: np.random.Generator) -> tuple[Array, Array]:
    """Returns random points of the surface and its normals there, both (n, 3)."""
    import trimesh  # slow to load

    drawn = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    points, faces = trimesh.sample.sample_surface(drawn, count, seed=int(generator.integers(2**31)))
    return np.asarray(points), np.asarray(drawn.face_normals)[faces]


def _in_cone(axes: Array, friction: float, generator: np.random.Generator) -> Array:
    """Returns unit vectors (n, 3) spread evenly over the cones around these (n, 3)."""
    radius = friction * np.sqrt(generator.random(len(axes)))
    angle = 2 * math.pi * generator.random(len(axes))
    helper = np.where(np.abs(axes[:, :1]) < 0.8, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    one = np.cross(axes, helper)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    other = np.cross(axes, one)
    tilted = axes + radius[:, None] * (np.cos(angle)[:, None] * one + np.sin(angle)[:, None] * other)
    return tilted / np.linalg.norm(tilted, axis=1, keepdims=True)


def _passages(crossings: list[Crossing]) -> list[tuple[Crossing, Crossing]]:
    """Returns each way into the object from free space with each way out of it behind that.

    Empty when the mesh is not closed along the line.
    """
    ordered = sorted(crossings, key=lambda crossing: (round(crossing.distance / SAME_PLACE_M), not crossing.enters))
    depth = 0
    entries: list[Crossing] = []
    found: list[tuple[Crossing, Crossing]] = []
    for crossing in ordered:
        if crossing.enters and depth == 0:
            entries.append(crossing)
        depth += 1 if crossing.enters else -1
        if depth == 0:
            found += [(entry, crossing) for entry in entries if crossing.distance - entry.distance > SAME_PLACE_M]
    return found if depth == 0 else []
