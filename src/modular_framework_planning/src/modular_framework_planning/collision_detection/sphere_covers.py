# SPDX-License-Identifier: BSD-3-Clause
"""Covers bodies with spheres, coarse to fine: the upper levels of their sphere trees, and balls inside of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modular_framework_planning.collision_detection.kernels.compiled_collision import Covers
from modular_framework_planning.collision_detection.kernels.compiled_spheres import NO_NODE, depth_inside, fill_heap
from modular_framework_planning.collision_detection.kernels.compiled_triangles import Surfaces
from modular_framework_planning.geometry.spatial import Array

CANDIDATES = 63  # nodes of a tree around whose centres there may be balls


def heap_of(surfaces: Surfaces, root: int, nodes: int) -> Array:
    """Returns spheres around a body in the frame of its surface, see Covers.spheres; shape (nodes, 4).

    Args:
        surfaces: that hold the tree of its surface.
        root: of the tree.
        nodes: of the heap, one less than a power of two.
    """
    out = np.zeros((nodes, 4))
    fill_heap(surfaces, root, out)
    return out


def balls_inside(surfaces: Surfaces, root: int, most: int) -> Array:
    """Returns balls inside of a closed surface, the largest first; the centre of none lies in a larger one.

    Returns:
        Shape (most, 4): centre and radius [m], 0 for none.
    """
    candidates = heap_of(surfaces, root, CANDIDATES)
    candidates = candidates[candidates[:, 3] >= 0.0]
    candidates[:, 3] = [depth_inside(surfaces, root, candidate) for candidate in candidates]
    result = np.zeros((most, 4))
    count = 0
    for candidate in candidates[np.argsort(-candidates[:, 3], kind="stable")]:
        gaps = np.linalg.norm(result[:count, :3] - candidate[:3], axis=1)
        if count < most and candidate[3] > 0.0 and (gaps >= result[:count, 3]).all():
            result[count] = candidate
            count += 1
    return result


class Layers(NamedTuple):
    """Which spheres a check uses.

    Attributes:
        nodes: spheres around a body, one less than a power of two; 0 for none.
        balls: inside of a body.
    """

    nodes: int
    balls: int


def empty_covers(layers: Layers, bodies: int) -> Covers:
    """Returns covers in which no body has a sphere."""
    spheres, balls = np.full((bodies, layers.nodes, 4), NO_NODE), np.zeros((bodies, layers.balls, 4))
    return Covers(spheres, balls, np.zeros(bodies), np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 7)))
