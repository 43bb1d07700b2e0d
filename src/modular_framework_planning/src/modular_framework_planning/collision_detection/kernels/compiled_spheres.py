# SPDX-License-Identifier: BSD-3-Clause
"""Makes the spheres around and inside of bodies, and what a check with them needs besides, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from modular_framework_planning.collision_detection.kernels.compiled_collision import FIELD
from modular_framework_planning.collision_detection.kernels.compiled_distance import BOX, CYLINDER, SPHERE
from modular_framework_planning.collision_detection.kernels.compiled_triangles import encloses, triangle_distance

NO_NODE = -1.0  # in place of a radius


@njit(cache=True, nogil=True)
def depth_inside(surface, root, point):  # type: ignore[no-untyped-def]
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
def fill_heap(surface, root, out):  # type: ignore[no-untyped-def]
    """Writes the upper levels (nodes, 4) of a tree of spheres."""
    spheres, links = surface.spheres, surface.links
    nodes = np.full(len(out), -1, np.int32)
    nodes[0] = root
    for place in range(len(out)):
        node, out[place, 3] = nodes[place], NO_NODE
        if node < 0:
            continue
        out[place] = spheres[node]
        if 2 * place + 2 < len(out) and links[node, 0] >= 0:
            nodes[2 * place + 1], nodes[2 * place + 2] = links[node, 0], links[node, 1]


@njit(cache=True, nogil=True)
def fill_heaps(surface, roots, poses, spheres, inflation, chosen, out):  # type: ignore[no-untyped-def]
    """Writes the spheres (b, nodes, 4) of some bodies, in the frames of their joints: one alone without a surface.

    Args:
        surface: that holds the trees of the bodies' surfaces.
        roots: of all bodies, see World.
        poses: of all bodies, see World.
        spheres: of all bodies, see World.
        inflation: radius of a ball around each point of a body's surface that belongs to it [m], shape (b,).
        chosen: numbers of the bodies.
        out: filled; no body has a sphere before.
    """
    for body in chosen:
        if roots[body] < 0:
            out[body, 0] = spheres[body]
        else:
            fill_heap(surface, roots[body], out[body])
        for place in range(out.shape[1]):
            if out[body, place, 3] < 0.0:
                continue
            x, y, z = out[body, place, 0], out[body, place, 1], out[body, place, 2]
            for row in range(3):
                pose = poses[body, row]
                out[body, place, row] = pose[0] * x + pose[1] * y + pose[2] * z + pose[3]
            if roots[body] >= 0:
                out[body, place, 3] += inflation[body]


@njit(cache=True, nogil=True)
def extents_of(spheres):  # type: ignore[no-untyped-def]
    """Returns how far the centres of spheres (b, nodes, 4) are from the origin at most, shape (b,)."""
    extents = np.zeros(len(spheres))
    for body in range(len(spheres)):
        for place in range(spheres.shape[1]):
            x, y, z, radius = spheres[body, place]
            if radius >= 0.0:
                extents[body] = max(extents[body], np.sqrt(x * x + y * y + z * z))
    return extents


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
def _common_joint(parents, first, second):  # type: ignore[no-untyped-def]
    """Returns the last joint both joints depend on, -1 for none."""
    while first != second:  # parents come before children
        if first > second:
            first = parents[first]
        else:
            second = parents[second]
    return first


@njit(cache=True, nogil=True)
def meeting_joints(pairs, joints, parents):  # type: ignore[no-untyped-def]
    """Returns the last joint that moves both bodies of each pair (p, 2), see Covers.meets.

    Args:
        pairs: of bodies, the second one FIELD for solids of the world.
        joints: that move the bodies, -1 for the world.
        parents: of the joints, see Tree.
    """
    meets = np.full(len(pairs), -1)
    for pair in range(len(pairs)):
        if pairs[pair, 1] != FIELD:
            meets[pair] = _common_joint(parents, joints[pairs[pair, 0]], joints[pairs[pair, 1]])
    return meets
