# SPDX-License-Identifier: BSD-3-Clause
"""Lower bounds of the distance between two bodies, compiled: coarse for distant bodies, within 0.1 mm for close bodies.

A body is a sphere tree over triangles, or a solid with a closed-form distance to a point. For a bound of 0, the status
tells whether the bodies touch or are too close to decide.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_triangles import (
    Surfaces,
    halve_longest_edge,
    triangle_distance,
)
from modular_framework_planning.geometry.spatial import Array

SURFACE, SPHERE, BOX, CYLINDER, CONE, CAPSULE, PLANE, HALF_SPACE = range(8)  # closed forms; SURFACE: none
CLEAR, TOUCHING, TOO_CLOSE = range(3)  # statuses

MIN_PIECE_RADIUS_M = 1.0e-4  # triangles are split down to this radius before a pair counts as undecided
ROUNDING = 1.0e-6  # tolerance of the exact checker and of floating-point arithmetic [m]
MIN_USEFUL_FRACTION = 0.3  # below this fraction of the required distance, only contact is decided
MAX_RADIUS_FRACTION = 0.5  # a sphere is not subdivided if its radius is at most this fraction of its distance
MAX_PIECES = 4000  # pieces of a triangle visited before a pair counts as undecided
MAX_NODE_PAIRS = 50_000  # node pairs visited per table cell
STACK_SIZE = 512


class Solid(NamedTuple):
    """A closed form and its three parameters, see solid_distance."""

    kind: int
    p0: float
    p1: float
    p2: float


class Rotations(NamedTuple):
    """Successive rotations of a surface.

    Attributes:
        origins: A point on each axis, the axis nearest to the surface first; shape (k, 3) [m].
        axes: Unit vectors along the axes, shape (k, 3).
        max_angles: Maximum rotation to either side, shape (k,) [rad].
    """

    origins: Array
    axes: Array
    max_angles: Array


class Memory(NamedTuple):
    """Working memory of a check.

    Attributes:
        relative: Pose of the first body in the frame of the second, shape (3, 4).
        stack: Node pairs to visit, shape (STACK_SIZE, 2).
        bounds: Distance bound of each node pair, shape (STACK_SIZE,) [m].
        pieces: Pieces of a triangle, shape (64, 9) [m].
        vertices: Vertices of a triangle, shape (9,) [m].
    """

    relative: Array
    stack: NDArray[np.int32]
    bounds: Array
    pieces: Array
    vertices: Array


@njit(cache=True, nogil=True)
def new_memory() -> Memory:
    """Returns working memory."""
    stack = np.empty((STACK_SIZE, 2), np.int32)
    return Memory(np.empty((3, 4)), stack, np.empty(STACK_SIZE), np.empty((64, 9)), np.empty(9))


@njit(cache=True, nogil=True)
def solid_of(kinds: NDArray[np.int64], sizes: Array, body: int) -> Solid:
    """Returns the closed form of a body.

    Args:
        kinds: Kind of each closed form, shape (b,).
        sizes: Parameters of each closed form, shape (b, 3).
        body: Index of the body.
    """
    return Solid(kinds[body], sizes[body, 0], sizes[body, 1], sizes[body, 2])


@njit(cache=True, nogil=True)
def relative_pose(pose: Array, reference: Array, out: Array) -> None:
    """Writes a pose in the frame of a reference pose.

    Args:
        pose: Pose, shape (3, 4).
        reference: Reference pose in the same frame, shape (3, 4).
        out: Written pose, shape (3, 4).
    """
    for row in range(3):
        for column in range(4):
            value = 0.0
            for inner in range(3):
                part = pose[inner, column] - (reference[inner, 3] if column == 3 else 0.0)
                value += reference[inner, row] * part
            out[row, column] = value


@njit(cache=True, nogil=True)
def solid_distance(solid: Solid, x: float, y: float, z: float) -> float:
    """Returns the signed distance of a point from a solid [m], negative inside; a plane has no inside.

    The parameters p0, p1, p2 of the solid are the half extents of a box, the radius and half height of a cylinder, cone
    or capsule, the radius of a sphere, or the unit normal of a plane or half space.

    Args:
        solid: Closed form.
        x: Coordinate of the point in the solid's frame [m].
        y: Coordinate of the point in the solid's frame [m].
        z: Coordinate of the point in the solid's frame [m].
    """
    kind, p0, p1, p2 = solid
    if kind == BOX:
        dx, dy, dz = abs(x) - p0, abs(y) - p1, abs(z) - p2
        inside = min(max(dx, max(dy, dz)), 0.0)
        dx, dy, dz = max(dx, 0.0), max(dy, 0.0), max(dz, 0.0)
        return inside + np.sqrt(dx * dx + dy * dy + dz * dz)
    if kind == CYLINDER:
        dr, dz = np.sqrt(x * x + y * y) - p0, abs(z) - p1
        inside = min(max(dr, dz), 0.0)
        dr, dz = max(dr, 0.0), max(dz, 0.0)
        return inside + np.sqrt(dr * dr + dz * dz)
    if kind == SPHERE:
        return np.sqrt(x * x + y * y + z * z) - p0
    if kind == CAPSULE:
        dz = max(abs(z) - p1, 0.0)
        return np.sqrt(x * x + y * y + dz * dz) - p0
    if kind == CONE:
        return _cone_distance(p0, p1, np.sqrt(x * x + y * y), z)
    height = p0 * x + p1 * y + p2 * z
    return abs(height) if kind == PLANE else height


@njit(cache=True, nogil=True)
def placed_solid_distance(solid: Solid, poses: Array, body: int, x: float, y: float, z: float) -> float:
    """Returns the signed distance of a point from a placed solid [m].

    Args:
        solid: Closed form.
        poses: Pose of each body in the planning frame, shape (b, 3, 4).
        body: Index of the solid's body.
        x: Coordinate of the point in the planning frame [m].
        y: Coordinate of the point in the planning frame [m].
        z: Coordinate of the point in the planning frame [m].
    """
    x, y, z = x - poses[body, 0, 3], y - poses[body, 1, 3], z - poses[body, 2, 3]
    return solid_distance(
        solid,
        poses[body, 0, 0] * x + poses[body, 1, 0] * y + poses[body, 2, 0] * z,
        poses[body, 0, 1] * x + poses[body, 1, 1] * y + poses[body, 2, 1] * z,
        poses[body, 0, 2] * x + poses[body, 1, 2] * y + poses[body, 2, 2] * z,
    )


@njit(cache=True, nogil=True)
def _cone_distance(radius: float, half: float, r: float, z: float) -> float:
    """Returns the signed distance of (r, z), r >= 0, from the triangle (0, -half), (radius, -half), (0, half)."""
    slant = np.sqrt(radius * radius + 4.0 * half * half)
    above_side = (2.0 * half * r + radius * (z - half)) / slant
    below_base = -half - z
    if above_side <= 0.0 and below_base <= 0.0:
        return max(above_side, below_base)
    fraction = (radius * (radius - r) + 2.0 * half * (z + half)) / (slant * slant)
    fraction = min(max(fraction, 0.0), 1.0)
    side_r, side_z = radius * (1.0 - fraction), -half + 2.0 * half * fraction
    side = np.sqrt((r - side_r) ** 2 + (z - side_z) ** 2)
    base_r = max(r - radius, 0.0)
    base = np.sqrt(base_r * base_r + below_base * below_base)
    return min(side, base)


@njit(cache=True, nogil=True)
def _interval_gap(low: float, high: float, half: float) -> float:
    """Returns the distance between the intervals [low, high] and [-half, half]."""
    return max(max(low - half, -half - high), 0.0)


@njit(cache=True, nogil=True)
def _span_bound(solid: Solid, pieces: Array, index: int) -> float:
    """Returns a lower bound of a triangle's distance from a box or cylinder, by the triangle's axis-aligned box."""
    kind, p0, p1, p2 = solid
    x, y, z = (
        (pieces[index, 0], pieces[index, 3], pieces[index, 6]),
        (pieces[index, 1], pieces[index, 4], pieces[index, 7]),
        (pieces[index, 2], pieces[index, 5], pieces[index, 8]),
    )
    gx = _interval_gap(min(x), max(x), p0)
    gy = _interval_gap(min(y), max(y), p1 if kind == BOX else p0)
    gz = _interval_gap(min(z), max(z), p2 if kind == BOX else p1)
    if kind == CYLINDER:  # x and y together would overestimate the distance from the round side
        return np.sqrt(max(gx, gy) ** 2 + gz * gz)
    return np.sqrt(gx * gx + gy * gy + gz * gz)


@njit(cache=True, nogil=True)
def _triangle_to_solid(
    triangles: Array, index: int, pose: Array, solid: Solid, margin: float, excess: float, limit: float, pieces: Array
) -> tuple[int, float]:
    """Bounds the distance of a triangle from a solid by subdivision of the triangle; see `surface_to_solid`.

    The bound of a piece is the distance of its centroid minus the distance of its farthest vertex from the centroid.
    """
    for vertex in range(0, 9, 3):
        x, y, z = triangles[index, vertex], triangles[index, vertex + 1], triangles[index, vertex + 2]
        for row in range(3):
            pieces[0, vertex + row] = pose[row, 0] * x + pose[row, 1] * y + pose[row, 2] * z + pose[row, 3]
    depth, visited = 1, 0
    while depth > 0:
        depth -= 1
        visited += 1
        if limit > 0.0 and solid.kind in (BOX, CYLINDER) and _span_bound(solid, pieces, depth) - margin >= limit:
            continue
        cx = (pieces[depth, 0] + pieces[depth, 3] + pieces[depth, 6]) / 3.0
        cy = (pieces[depth, 1] + pieces[depth, 4] + pieces[depth, 7]) / 3.0
        cz = (pieces[depth, 2] + pieces[depth, 5] + pieces[depth, 8]) / 3.0
        radius = 0.0
        for vertex in range(0, 9, 3):
            x, y, z = pieces[depth, vertex] - cx, pieces[depth, vertex + 1] - cy, pieces[depth, vertex + 2] - cz
            radius = max(radius, x * x + y * y + z * z)
        radius = np.sqrt(radius)
        distance = solid_distance(solid, cx, cy, cz) - margin
        if distance - radius >= limit:
            continue
        if distance < -ROUNDING - excess:
            return TOUCHING, 0.0
        if distance < -ROUNDING and distance - radius >= -ROUNDING - excess:  # no part of the triangle is deep enough
            return TOO_CLOSE, 0.0
        if radius <= MAX_RADIUS_FRACTION * distance or radius <= MIN_PIECE_RADIUS_M < distance - ROUNDING:
            limit = distance - radius
            continue
        if radius <= MIN_PIECE_RADIUS_M or visited > MAX_PIECES or depth > 60:
            return TOO_CLOSE, 0.0
        halve_longest_edge(pieces, depth, 0.0)
        depth += 2
    return CLEAR, limit


@njit(cache=True, nogil=True)
def _box_to_solid(boxes: Array, node: int, pose: Array, solid: Solid) -> float:
    """Returns a lower bound of the distance between a node's box and the bounding box of a solid, -inf if unbounded.

    The centre c, the axes a and the half extents of the node's box are expressed in the frame of the solid, whose
    bounding box has the half extents h. The bound is the maximum of |c . a| - half - sum |h_i a_i| over the axes, and
    of the distance between h and the extent of the node's box along the solid's axes (separating-axis tests).
    """
    kind, p0, p1, p2 = solid
    if kind in (PLANE, HALF_SPACE):
        return -np.inf
    hx = p0
    hy = p1 if kind == BOX else p0
    hz = p2 if kind == BOX else (p0 if kind == SPHERE else (p0 + p1 if kind == CAPSULE else p1))
    cx = pose[0, 0] * boxes[node, 0] + pose[0, 1] * boxes[node, 1] + pose[0, 2] * boxes[node, 2] + pose[0, 3]
    cy = pose[1, 0] * boxes[node, 0] + pose[1, 1] * boxes[node, 1] + pose[1, 2] * boxes[node, 2] + pose[1, 3]
    cz = pose[2, 0] * boxes[node, 0] + pose[2, 1] * boxes[node, 1] + pose[2, 2] * boxes[node, 2] + pose[2, 3]
    best, ex, ey, ez = -np.inf, hx, hy, hz
    for axis in range(3):
        a, b, c = boxes[node, 3 + 3 * axis], boxes[node, 4 + 3 * axis], boxes[node, 5 + 3 * axis]
        ax = pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c
        ay = pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c
        az = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c
        half = boxes[node, 12 + axis]
        best = max(best, abs(cx * ax + cy * ay + cz * az) - half - abs(hx * ax) - abs(hy * ay) - abs(hz * az))
        ex, ey, ez = ex + half * abs(ax), ey + half * abs(ay), ez + half * abs(az)
    gx, gy, gz = max(abs(cx) - ex, 0.0), max(abs(cy) - ey, 0.0), max(abs(cz) - ez, 0.0)
    return max(best, np.sqrt(gx * gx + gy * gy + gz * gz))


@njit(cache=True, nogil=True)
def _box_to_box(boxes: Array, node: int, other_boxes: Array, other: int, pose: Array) -> float:
    """Returns a lower bound of the distance between two nodes' boxes, with the tests of `_box_to_solid`."""
    x, y, z = boxes[node, 0], boxes[node, 1], boxes[node, 2]
    dx = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3] - other_boxes[other, 0]
    dy = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3] - other_boxes[other, 1]
    dz = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3] - other_boxes[other, 2]
    best = 0.0
    e0, e1, e2 = other_boxes[other, 12], other_boxes[other, 13], other_boxes[other, 14]
    for axis in range(3):
        a, b, c = boxes[node, 3 + 3 * axis], boxes[node, 4 + 3 * axis], boxes[node, 5 + 3 * axis]
        ax = pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c
        ay = pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c
        az = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c
        c0 = abs(ax * other_boxes[other, 3] + ay * other_boxes[other, 4] + az * other_boxes[other, 5])
        c1 = abs(ax * other_boxes[other, 6] + ay * other_boxes[other, 7] + az * other_boxes[other, 8])
        c2 = abs(ax * other_boxes[other, 9] + ay * other_boxes[other, 10] + az * other_boxes[other, 11])
        half = boxes[node, 12 + axis]
        gap = abs(dx * ax + dy * ay + dz * az) - half
        gap -= c0 * other_boxes[other, 12]
        best = max(best, gap - c1 * other_boxes[other, 13] - c2 * other_boxes[other, 14])
        e0, e1, e2 = e0 + half * c0, e1 + half * c1, e2 + half * c2
    g0 = max(abs(dx * other_boxes[other, 3] + dy * other_boxes[other, 4] + dz * other_boxes[other, 5]) - e0, 0.0)
    g1 = max(abs(dx * other_boxes[other, 6] + dy * other_boxes[other, 7] + dz * other_boxes[other, 8]) - e1, 0.0)
    g2 = max(abs(dx * other_boxes[other, 9] + dy * other_boxes[other, 10] + dz * other_boxes[other, 11]) - e2, 0.0)
    return max(best, np.sqrt(g0 * g0 + g1 * g1 + g2 * g2))


@njit(cache=True, nogil=True)
def surface_to_solid(
    surface: Surfaces, root: int, pose: Array, solid: Solid, margin: float, excess: float, limit: float, memory: Memory
) -> tuple[int, float]:
    """Returns a lower bound of the distance of a surface from a solid.

    Args:
        surface: Trees with the surface.
        root: Root node of the surface.
        pose: Pose of the surface in the solid's frame, shape (3, 4).
        solid: Closed form.
        margin: Distance subtracted from every distance [m].
        excess: Maximum distance by which the surface lies outside its body [m]; only a deeper point proves contact.
        limit: Maximum of the bound [m].
        memory: Working memory.

    Returns:
        The status, and a lower bound of the distance minus the margin [m].
    """
    spheres, boxes, children, triangles = surface
    stack, bounds, pieces = memory.stack, memory.bounds, memory.pieces
    stack[0, 0], bounds[0] = root, -np.inf
    depth, result = 1, CLEAR
    while depth > 0:
        depth -= 1
        node = stack[depth, 0]
        if bounds[depth] >= limit:
            continue
        if children[node, 0] < 0:
            index = children[node, 1]
            status, bound = _triangle_to_solid(triangles, index, pose, solid, margin, excess, limit, pieces)
            if status == TOUCHING:
                return TOUCHING, 0.0
            if status == TOO_CLOSE:  # from here on, search for a touching triangle only
                result, limit = TOO_CLOSE, -ROUNDING - excess
                continue
            limit = min(limit, bound)
            continue
        far, near = children[node, 0], children[node, 1]
        far_gap = _centre_distance(spheres, far, pose, solid) - margin
        near_gap = _centre_distance(spheres, near, pose, solid) - margin
        if far_gap - spheres[far, 3] < near_gap - spheres[near, 3]:
            far, near, far_gap, near_gap = near, far, near_gap, far_gap
        for child, gap in ((far, far_gap), (near, near_gap)):  # the nearer child ends on top of the stack
            radius = spheres[child, 3]
            if gap - radius >= limit:
                continue
            if radius <= MAX_RADIUS_FRACTION * gap:
                limit = gap - radius
            elif limit <= 0.0 or _box_to_solid(boxes, child, pose, solid) - margin < limit:
                stack[depth, 0], bounds[depth] = child, gap - radius
                depth += 1
    return result, max(limit, 0.0)


@njit(cache=True, nogil=True)
def _centre_distance(spheres: Array, node: int, pose: Array, solid: Solid) -> float:
    """Returns the signed distance of the centre of a node's sphere from a solid."""
    x, y, z = spheres[node, 0], spheres[node, 1], spheres[node, 2]
    return solid_distance(
        solid,
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3],
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3],
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3],
    )


@njit(cache=True, nogil=True)
def _centre_gap(spheres: Array, node: int, other_spheres: Array, other: int, pose: Array) -> float:
    """Returns the distance between the centres of two nodes' spheres."""
    x, y, z = spheres[node, 0], spheres[node, 1], spheres[node, 2]
    return np.sqrt(
        (pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3] - other_spheres[other, 0]) ** 2
        + (pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3] - other_spheres[other, 1]) ** 2
        + (pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3] - other_spheres[other, 2]) ** 2
    )


@njit(cache=True, nogil=True)
def surface_to_surface(
    surface: Surfaces,
    root: int,
    other_surface: Surfaces,
    other_root: int,
    pose: Array,
    margin: float,
    excess: float,
    limit: float,
    memory: Memory,
) -> tuple[int, float]:
    """Returns a lower bound of the distance between two surfaces.

    Args:
        surface: Trees with the first surface.
        root: Root node of the first surface.
        other_surface: Trees with the other surface.
        other_root: Root node of the other surface.
        pose: Pose of the first surface in the frame of the other, shape (3, 4).
        margin: Distance subtracted from every distance [m].
        excess: Maximum distance by which the surfaces lie outside their bodies [m]; only a deeper point proves contact.
        limit: Maximum of the bound [m].
        memory: Working memory.

    Returns:
        The status, and a lower bound of the distance minus the margin [m].
    """
    spheres, boxes, children, triangles = surface
    other_spheres, other_boxes, other_children, other_triangles = other_surface
    stack, bounds, vertices = memory.stack, memory.bounds, memory.vertices
    stack[0, 0], stack[0, 1], bounds[0] = root, other_root, -np.inf
    depth, min_useful, result = 1, MIN_USEFUL_FRACTION * limit, CLEAR
    while depth > 0:
        depth -= 1
        node, other = stack[depth, 0], stack[depth, 1]
        if bounds[depth] >= limit:
            continue
        if children[node, 0] < 0 and other_children[other, 0] < 0:
            face, other_face = children[node, 1], other_children[other, 1]
            distance = _triangle_to_triangle(triangles, face, pose, other_triangles, other_face, vertices) - margin
            if distance <= -excess:
                return TOUCHING, 0.0
            if distance <= ROUNDING:  # from here on, search for touching triangles only
                result, limit = TOO_CLOSE, -excess
                continue
            limit = min(limit, distance)
            if limit < min_useful:  # from here on, decide only whether the surfaces touch
                limit = min(limit, 2.0 * ROUNDING)
            continue
        if depth > STACK_SIZE - 3:
            return TOO_CLOSE, 0.0
        if other_children[other, 0] < 0 or (children[node, 0] >= 0 and spheres[node, 3] >= other_spheres[other, 3]):
            a, b, other_a, other_b = children[node, 0], children[node, 1], other, other
        else:
            a, b, other_a, other_b = node, node, other_children[other, 0], other_children[other, 1]
        gap_a = _centre_gap(spheres, a, other_spheres, other_a, pose) - margin
        gap_b = _centre_gap(spheres, b, other_spheres, other_b, pose) - margin
        radii_a, radii_b = spheres[a, 3] + other_spheres[other_a, 3], spheres[b, 3] + other_spheres[other_b, 3]
        if gap_a - radii_a < gap_b - radii_b:
            a, b, other_a, other_b = b, a, other_b, other_a
            gap_a, gap_b, radii_a, radii_b = gap_b, gap_a, radii_b, radii_a
        for child, partner, gap, radii in ((a, other_a, gap_a, radii_a), (b, other_b, gap_b, radii_b)):
            if gap - radii >= limit:
                continue
            if radii <= MAX_RADIUS_FRACTION * gap:
                limit = gap - radii
            elif limit <= 0.0 or _box_to_box(boxes, child, other_boxes, partner, pose) - margin < limit:
                stack[depth, 0], stack[depth, 1], bounds[depth] = child, partner, gap - radii
                depth += 1
    return result, max(limit, 0.0)


@njit(cache=True, nogil=True)
def _triangle_to_triangle(
    triangles: Array, index: int, pose: Array, others: Array, other: int, vertices: Array
) -> float:
    """Returns the distance between two triangles; `pose` transforms the first triangle to the frame of the second."""
    for vertex in range(0, 9, 3):
        x, y, z = triangles[index, vertex], triangles[index, vertex + 1], triangles[index, vertex + 2]
        for row in range(3):
            vertices[vertex + row] = pose[row, 0] * x + pose[row, 1] * y + pose[row, 2] * z + pose[row, 3]
    return triangle_distance(vertices, others[other])


@njit(cache=True, nogil=True, inline="always")
def _motion_in_rotations(
    spheres: Array, node: int, pose: Array, origins: Array, axes: Array, max_angles: Array
) -> float:
    """Returns an upper bound M of the motion of a node's sphere under `Rotations` [m], with ROUNDING added.

    A rotation by up to d about an axis at the distance D from the centre of the sphere, with radius r, adds
    d (D + r + M) to the bound M of the rotations before it.
    """
    x, y, z, radius = spheres[node, 0], spheres[node, 1], spheres[node, 2], spheres[node, 3]
    px = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3]
    py = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]
    pz = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]
    motion = ROUNDING
    for axis in range(len(max_angles)):
        wx, wy, wz = px - origins[axis, 0], py - origins[axis, 1], pz - origins[axis, 2]
        ax, ay, az = axes[axis, 0], axes[axis, 1], axes[axis, 2]
        reach = np.sqrt((ay * wz - az * wy) ** 2 + (az * wx - ax * wz) ** 2 + (ax * wy - ay * wx) ** 2)
        motion += max_angles[axis] * (reach + radius + motion)
    return motion


@njit(cache=True, nogil=True)
def surfaces_stay_apart(
    surface: Surfaces, root: int, other_surface: Surfaces, other_root: int, pose: Array, rotations: Rotations
) -> bool:
    """Returns whether the first surface is proven collision-free with the other surface during rotations.

    Args:
        surface: Trees with the first surface.
        root: Root node of the first surface.
        other_surface: Trees with the other surface.
        other_root: Root node of the other surface.
        pose: Pose of the first surface in the frame of the other at zero rotation, shape (3, 4).
        rotations: Rotations of the first surface, in the frame of the other.
    """
    spheres, boxes, children, triangles = surface
    other_spheres, other_boxes, other_children, other_triangles = other_surface
    origins, axes, max_angles = rotations
    stack, vertices = np.empty((STACK_SIZE, 2), np.int32), np.empty(9)
    stack[0, 0], stack[0, 1] = root, other_root
    depth, visited = 1, 0
    while depth > 0:
        depth -= 1
        visited += 1
        node, other = stack[depth, 0], stack[depth, 1]
        needed = _motion_in_rotations(spheres, node, pose, origins, axes, max_angles)
        gap = _centre_gap(spheres, node, other_spheres, other, pose)
        if (
            gap - spheres[node, 3] - other_spheres[other, 3] >= needed
            or _box_to_box(boxes, node, other_boxes, other, pose) >= needed
        ):
            continue
        if children[node, 0] < 0 and other_children[other, 0] < 0:
            face, other_face = children[node, 1], other_children[other, 1]
            if _triangle_to_triangle(triangles, face, pose, other_triangles, other_face, vertices) < needed:
                return False
            continue
        if depth > STACK_SIZE - 3 or visited > MAX_NODE_PAIRS:
            return False
        if other_children[other, 0] < 0 or (children[node, 0] >= 0 and spheres[node, 3] >= other_spheres[other, 3]):
            a, b, other_a, other_b = children[node, 0], children[node, 1], other, other
        else:
            a, b, other_a, other_b = node, node, other_children[other, 0], other_children[other, 1]
        stack[depth, 0], stack[depth, 1], stack[depth + 1, 0], stack[depth + 1, 1] = a, other_a, b, other_b
        depth += 2
    return True
