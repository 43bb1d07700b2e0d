# SPDX-License-Identifier: BSD-3-Clause
"""Finds antipodal contact pairs, in which each contact is in the friction cone of the other's surface."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from antipodal_grasps.ray_casting import Crossing, line_crossings
from modular_framework_core.grasp_generation import solid_meshes
from modular_framework_core.grasp_generation.contact_pair import ContactPair, PairRules, distinct_pairs
from modular_framework_urdf.mesh_reader import TriangleMesh

Array = npt.NDArray[np.float64]

ALIGNMENT_DIGITS = 3
SAME_POSITION_M = 1e-5
"""Maximum distance between crossings at the same position."""


@dataclass(frozen=True, slots=True)
class PairSettings(PairRules):
    """Feasibility limits of a contact pair, and search effort.

    Attributes:
        surface_samples: Number of surface points from which rays are cast.
        lines_per_sample: Number of rays from each point: one along the normal, the others in the friction cone.
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
    """Returns contact pairs of an object.

    Rays are cast inwards from surface points, and in the same directions through the centre of mass. Each entry into
    the object from free space forms a pair with each following exit: on a mug, both the wall and the whole body.

    Args:
        solids: Closed parts of the object.
        centroid: Centre of mass, shape (3,) [m].
        max_width: Maximum distance between the contacts [m].
        settings: Feasibility limits of a pair.
        generator: Random number generator.

    Returns:
        The pairs in order of alignment, equally aligned pairs in order of their distance from the centre of mass.
    """
    mesh = solid_meshes.join_meshes(solids)
    points, normals = _samples(mesh, settings.surface_samples, generator)
    directions = np.concatenate(
        [-normals, *(_in_cone(-normals, settings.friction, generator) for _ in range(settings.lines_per_sample - 1))]
    )
    origins = np.concatenate([np.tile(points, (settings.lines_per_sample, 1)), np.tile(centroid, (len(points), 1))])
    directions = np.concatenate([directions, -normals])
    pairs = []
    for origin, direction, crossings in zip(
        origins, directions, line_crossings(mesh, origins, directions), strict=True
    ):
        for entry, end in _inside_intervals(crossings):
            alignment = min(float(-entry.normal @ direction), float(end.normal @ direction))
            if end.distance - entry.distance <= max_width and alignment >= settings.cone_cosine:
                ends = (origin + entry.distance * direction, origin + end.distance * direction)
                pairs.append(ContactPair(*ends, alignment))
    pairs.sort(key=lambda pair: (-round(pair.alignment, ALIGNMENT_DIGITS), pair.distance_from(centroid)))
    return distinct_pairs(pairs, settings)


def _samples(mesh: TriangleMesh, count: int, generator: np.random.Generator) -> tuple[Array, Array]:
    """Returns random surface points and the surface normals there, both of shape (n, 3)."""
    import trimesh  # slow to load

    drawn = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    points, faces = trimesh.sample.sample_surface(drawn, count, seed=int(generator.integers(2**31)))
    return np.asarray(points), np.asarray(drawn.face_normals)[faces]


def _in_cone(axes: Array, friction: float, generator: np.random.Generator) -> Array:
    """Returns unit vectors sampled uniformly from the cones around the axes, both of shape (n, 3)."""
    radius = friction * np.sqrt(generator.random(len(axes)))
    angle = 2 * math.pi * generator.random(len(axes))
    helper = np.where(np.abs(axes[:, :1]) < 0.8, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    first_axis = np.cross(axes, helper)
    first_axis /= np.linalg.norm(first_axis, axis=1, keepdims=True)
    second_axis = np.cross(axes, first_axis)
    tilted = axes + radius[:, None] * (np.cos(angle)[:, None] * first_axis + np.sin(angle)[:, None] * second_axis)
    return tilted / np.linalg.norm(tilted, axis=1, keepdims=True)


def _inside_intervals(crossings: list[Crossing]) -> list[tuple[Crossing, Crossing]]:
    """Returns each entry into the object from free space with each following exit.

    Empty if the mesh is not closed along the ray.
    """
    ordered = sorted(crossings, key=lambda crossing: (round(crossing.distance / SAME_POSITION_M), not crossing.enters))
    depth = 0
    entries: list[Crossing] = []
    intervals: list[tuple[Crossing, Crossing]] = []
    for crossing in ordered:
        if crossing.enters and depth == 0:
            entries.append(crossing)
        depth += 1 if crossing.enters else -1
        if depth == 0:
            intervals += [
                (entry, crossing) for entry in entries if crossing.distance - entry.distance > SAME_POSITION_M
            ]
    return intervals if depth == 0 else []
