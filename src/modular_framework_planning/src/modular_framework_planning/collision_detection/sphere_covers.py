# SPDX-License-Identifier: BSD-3-Clause
"""Covers bodies with spheres, coarse to fine: the upper levels of their sphere trees, and balls inside of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_collision import FIELD, Covers
from modular_framework_planning.collision_detection.kernels.compiled_distance import BOX, CYLINDER, SPHERE
from modular_framework_planning.collision_detection.kernels.compiled_triangles import (
    Surfaces,
    encloses,
    triangle_distance,
)
from modular_framework_planning.geometry.spatial import Array

CANDIDATES = 255  # nodes of a tree around whose centres there may be balls
NO_NODE = -1.0  # in place of a radius


@njit(cache=True, nogil=True)
def _depth_inside(surface, root, point):  # type: ignore[no-untyped-def]
    """Returns how far a point is from a closed surface that encloses it [m], 0 outside of it."""
    spheres, _, links, triangles = surface
    x, y, z = point[0], point[1], point[2]
    if not encloses(surface, root, x, y, z):
        return 0.0
    corners, waiting, depth, best = np.empty(9), np.empty(512, np.int32), 1, np.inf
    for corner in range(0, 9, 3):
        corners[corner], corners[corner + 1], corners[corner + 2] = x, y, z
    waiting[0] = root
    while depth > 0:
        depth -= 1
        node = waiting[depth]
        gap = np.sqrt((spheres[node, 0] - x) ** 2 + (spheres[node, 1] - y) ** 2 + (spheres[node, 2] - z) ** 2)
        if gap - spheres[node, 3] >= best:
            continue
        if links[node, 0] < 0:
            best = min(best, triangle_distance(triangles[links[node, 1]], corners))
        else:
            waiting[depth], waiting[depth + 1] = links[node, 0], links[node, 1]
            depth += 2
    return best


@njit(cache=True, nogil=True)
def _fill(surface, root, pose, out):  # type: ignore[no-untyped-def]
    """Writes the upper levels (nodes, 4) of a tree of spheres; their centres are moved by a pose (3, 4)."""
    spheres, links = surface.spheres, surface.links
    nodes = np.full(len(out), -1, np.int32)
    nodes[0] = root
    for place in range(len(out)):
        node, out[place, 3] = nodes[place], NO_NODE
        if node < 0:
            continue
        for row in range(3):
            out[place, row] = pose[row, 3]
            for inner in range(3):
                out[place, row] += pose[row, inner] * spheres[node, inner]
        out[place, 3] = spheres[node, 3]
        if 2 * place + 2 < len(out) and links[node, 0] >= 0:
            nodes[2 * place + 1], nodes[2 * place + 2] = links[node, 0], links[node, 1]


def heap_of(surfaces: Surfaces, root: int, pose: Array, nodes: int, inflation: float = 0.0) -> Array:
    """Returns spheres around a body, see Covers.spheres; shape (nodes, 4).

    Args:
        surfaces: that hold the tree of its surface.
        root: of the tree.
        pose: of the surface in the frame of the joint, shape (3, 4).
        nodes: of the heap, one less than a power of two.
        inflation: radius of a ball around each point of the surface that belongs to the body [m].
    """
    out = np.zeros((nodes, 4))
    _fill(surfaces, root, np.ascontiguousarray(pose), out)
    out[out[:, 3] >= 0.0, 3] += inflation
    return out


def single_sphere(sphere: Array, pose: Array, nodes: int) -> Array:
    """Returns the heap (nodes, 4) of a body of which one sphere (centre and radius) is known."""
    out = np.full((nodes, 4), NO_NODE)
    out[0] = *(pose[:, :3] @ sphere[:3] + pose[:, 3]), sphere[3]
    return out


def balls_inside(surfaces: Surfaces, root: int, most: int) -> Array:
    """Returns balls inside of a closed surface, the largest first; the centre of none lies in a larger one.

    Returns:
        Shape (most, 4): centre and radius [m], 0 for none.
    """
    candidates = heap_of(surfaces, root, np.eye(4)[:3], CANDIDATES)
    candidates = candidates[candidates[:, 3] >= 0.0]
    candidates[:, 3] = [_depth_inside(surfaces, root, candidate) for candidate in candidates]
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


def empty_covers(layers: Layers, joints: int, bodies: int, pairs: int) -> Covers:
    """Returns covers in which no body has a sphere."""
    spheres, balls = np.full((bodies, layers.nodes, 4), NO_NODE), np.zeros((bodies, layers.balls, 4))
    return Covers(spheres, balls, np.zeros(bodies), np.zeros(joints), np.full(pairs, -1), np.zeros((0, 7)))


def extents_of(spheres: Array) -> Array:
    """Returns how far the centres of spheres (b, nodes, 4) are from the origin at most, shape (b,)."""
    distances = np.where(spheres[:, :, 3] >= 0.0, np.linalg.norm(spheres[:, :, :3], axis=2), 0.0)
    return np.asarray(distances.max(axis=1, initial=0.0))


def common_joints(parents: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns the last joint on which two joints depend, -1 for none; shape (joints + 1, joints + 1).

    The last row and column are for the planning frame, whose number is -1.
    """
    count = len(parents)
    ways: list[list[int]] = []
    for joint, parent in enumerate(parents.tolist()):
        ways.append([*(ways[parent] if parent >= 0 else []), joint])
    result = np.full((count + 1, count + 1), -1)
    for one, way in enumerate(ways):
        for other, way_there in enumerate(ways):
            same = [joint for joint, there in zip(way, way_there, strict=False) if joint == there]
            result[one, other] = same[-1] if same else -1
    return result


@njit(cache=True, nogil=True)
def boxes_around(kinds, sizes, poses):  # type: ignore[no-untyped-def]
    """Returns boxes around solids, see Covers.boxes; their other arguments are those of a DistanceField."""
    boxes = np.empty((len(kinds), 7))
    for number in range(len(kinds)):
        x, y, z = sizes[number]
        a, b, c, half_length = np.inf, np.inf, np.inf, 0.0
        if kinds[number] == BOX:
            a, b, c, half_length = x, y, z, np.sqrt(x * x + y * y + z * z)
        elif kinds[number] == CYLINDER:
            a, b, c, half_length = x, x, y, np.sqrt(x * x + y * y)
        elif kinds[number] == SPHERE:
            a, b, c, half_length = x, x, x, x
        for row in range(3):
            pose = poses[number, row]
            reach = abs(pose[0]) * a + abs(pose[1]) * b + abs(pose[2]) * c if half_length > 0.0 else np.inf
            boxes[number, row], boxes[number, 3 + row] = pose[3] - reach, pose[3] + reach
        boxes[number, 6] = half_length
    return boxes


@njit(cache=True, nogil=True)
def meeting_joints(pairs, joints, common):  # type: ignore[no-untyped-def]
    """Returns the last joint that moves both bodies of each pair (p, 2), see Covers.meets.

    Args:
        pairs: of bodies, the second one FIELD for solids of the world.
        joints: that move the bodies, -1 for the world.
        common: what `common_joints` returns.
    """
    meets = np.full(len(pairs), -1)
    for pair in range(len(pairs)):
        if pairs[pair, 1] != FIELD:
            meets[pair] = common[joints[pairs[pair, 0]], joints[pairs[pair, 1]]]
    return meets
