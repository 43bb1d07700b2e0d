# SPDX-License-Identifier: BSD-3-Clause
"""Bounding-sphere trees over triangle meshes, and exact triangle distances, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.geometry.spatial import Array

CENTRING_STEPS = 12  # iterations of the bounding-sphere fit
RAY = (0.4613, 0.5417, 0.7027)  # ray direction of `encloses`, a unit vector (within 1e-4) parallel to hardly any edge


class Surfaces(NamedTuple):
    """Trees of spheres and boxes over the triangles of several bodies, as returned by `build_sphere_tree`."""

    spheres: Array
    boxes: Array
    children: NDArray[np.int32]
    triangles: Array


@njit(cache=True, nogil=True)
def cut_long_edges(triangles: Array, max_edge: float) -> Array:
    """Returns triangles (k, 9), halved until no edge exceeds `max_edge` [m]; spheres fit long triangles badly."""
    result = np.empty((2 * len(triangles) + 16, 9))
    stack = np.empty((64, 9))
    used = 0
    for triangle in triangles:
        stack[0] = triangle
        depth = 1
        while depth > 0:
            depth -= 1
            if depth > 60 or halve_longest_edge(stack, depth, max_edge * max_edge):
                if used == len(result):
                    larger = np.empty((2 * used, 9))
                    larger[:used] = result
                    result = larger
                result[used] = stack[depth]
                used += 1
            else:
                depth += 2
    return result[:used].copy()


@njit(cache=True, nogil=True)
def halve_longest_edge(pieces: Array, index: int, max_squared: float) -> bool:
    """Splits a triangle at the midpoint of its longest edge.

    Args:
        pieces: Triangles, shape (n, 9) [m]; the halves are written to rows `index` and `index + 1`.
        index: Row of the triangle.
        max_squared: Squared edge length up to which the triangle stays whole [m^2].

    Returns:
        True if the triangle stays whole.
    """
    ab, bc, ca = 0.0, 0.0, 0.0  # squared edge lengths
    for row in range(3):
        ab += (pieces[index, row] - pieces[index, 3 + row]) ** 2
        bc += (pieces[index, 3 + row] - pieces[index, 6 + row]) ** 2
        ca += (pieces[index, 6 + row] - pieces[index, row]) ** 2
    if max(ab, max(bc, ca)) <= max_squared:
        return True
    first, second = (0, 3) if ab >= bc and ab >= ca else ((3, 6) if bc >= ca else (6, 0))
    for row in range(9):
        pieces[index + 1, row] = pieces[index, row]
    for row in range(3):
        middle = 0.5 * (pieces[index, first + row] + pieces[index, second + row])
        pieces[index + 1, first + row] = middle
        pieces[index, second + row] = middle
    return False


@njit(cache=True, nogil=True)
def build_sphere_tree(triangles: Array) -> tuple[Array, Array, NDArray[np.int32]]:
    """Builds a binary tree; each node encloses its triangles by a sphere and by a box.

    Args:
        triangles: Vertices, shape (m, 9) with m > 0 [m].

    Returns:
        Three arrays with one row per node; node 0 is the root.
        Spheres, shape (2 m - 1, 4): centre and radius.
        Boxes, shape (2 m - 1, 15): centre, three axes, half extents.
        Children, shape (2 m - 1, 2): child nodes, or (-1, triangle index) for a leaf.
    """
    count = len(triangles)
    spheres, boxes = np.empty((2 * count - 1, 4)), np.empty((2 * count - 1, 15))
    children = np.empty((2 * count - 1, 2), np.int32)
    order = np.arange(count)
    stack = np.empty((count + 1, 3), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2] = 0, 0, count
    depth, used = 1, 1
    while depth > 0:
        depth -= 1
        node, low, high = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        members = order[low:high]
        _fit_sphere(triangles, members, spheres[node])
        _fit_box(triangles, members, boxes[node])
        if high - low == 1:
            children[node, 0], children[node, 1] = -1, members[0]
            continue
        middle = low + _split(triangles, members)
        children[node, 0], children[node, 1] = used, used + 1
        stack[depth, 0], stack[depth, 1], stack[depth, 2] = used, low, middle
        stack[depth + 1, 0], stack[depth + 1, 1], stack[depth + 1, 2] = used + 1, middle, high
        depth += 2
        used += 2
    return spheres, boxes, children


@njit(cache=True, nogil=True)
def _split(triangles: Array, members: NDArray[np.int64]) -> int:
    """Partitions triangles in place by their centroids on the widest axis; returns the size of the first part."""
    widest, extent, middle = 0, -1.0, 0.0
    for axis in range(3):
        low, high = np.inf, -np.inf
        for member in members:
            coordinate_sum = triangles[member, axis] + triangles[member, axis + 3] + triangles[member, axis + 6]
            low, high = min(low, coordinate_sum), max(high, coordinate_sum)
        if high - low > extent:
            widest, extent, middle = axis, high - low, 0.5 * (low + high)
    count = 0
    for index in range(len(members)):
        member = members[index]
        if triangles[member, widest] + triangles[member, widest + 3] + triangles[member, widest + 6] < middle:
            members[index], members[count] = members[count], member
            count += 1
    return count if 0 < count < len(members) else len(members) // 2


@njit(cache=True, nogil=True)
def _fit_sphere(triangles: Array, members: NDArray[np.int64], sphere: Array) -> None:
    """Writes a small bounding sphere of the members.

    The centre moves towards the farthest vertex by decreasing fractions of the distance; the best centre is kept.
    Source: M. Badoiu, K. Clarkson, "Smaller core-sets for balls", SODA 2003.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for member in members:
        for index in range(9):
            low[index % 3] = min(low[index % 3], triangles[member, index])
            high[index % 3] = max(high[index % 3], triangles[member, index])
    x, y, z = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])
    min_square = np.inf
    for step in range(CENTRING_STEPS):
        max_square, farthest, vertex = -1.0, 0, 0
        for member in members:
            for index in range(0, 9, 3):
                dx, dy = triangles[member, index] - x, triangles[member, index + 1] - y
                dz = triangles[member, index + 2] - z
                squared_distance = dx * dx + dy * dy + dz * dz
                if squared_distance > max_square:
                    max_square, farthest, vertex = squared_distance, member, index
        if max_square < min_square:
            min_square = max_square
            sphere[0], sphere[1], sphere[2] = x, y, z
        x += (triangles[farthest, vertex] - x) / (step + 3.0)
        y += (triangles[farthest, vertex + 1] - y) / (step + 3.0)
        z += (triangles[farthest, vertex + 2] - z) / (step + 3.0)
    sphere[3] = np.sqrt(min_square) * (1.0 + 1.0e-12) + 1.0e-12


@njit(cache=True, nogil=True)
def _fit_box(triangles: Array, members: NDArray[np.int64], box: Array) -> None:
    """Writes a bounding box of the members.

    The first axis is the mean normal n, because surface patches are flat. The second axis a points from the mean vertex
    m to the vertex that is farthest from m across n.
    """
    nx, ny, nz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for member in members:
        t = triangles[member]
        ux, uy, uz, vx, vy, vz = t[3] - t[0], t[4] - t[1], t[5] - t[2], t[6] - t[0], t[7] - t[1], t[8] - t[2]
        nx, ny, nz = nx + uy * vz - uz * vy, ny + uz * vx - ux * vz, nz + ux * vy - uy * vx
        mx, my, mz = mx + t[0] + t[3] + t[6], my + t[1] + t[4] + t[7], mz + t[2] + t[5] + t[8]
    mx, my, mz = mx / (3 * len(members)), my / (3 * len(members)), mz / (3 * len(members))
    size = np.sqrt(nx * nx + ny * ny + nz * nz)
    if size > 1e-200:
        nx, ny, nz = nx / size, ny / size, nz / size
    else:
        nx, ny, nz = 0.0, 0.0, 1.0
    longest, ax, ay, az = 0.0, 0.0, 0.0, 0.0
    for member in members:
        for index in range(0, 9, 3):
            x, y = triangles[member, index] - mx, triangles[member, index + 1] - my
            z = triangles[member, index + 2] - mz
            height = x * nx + y * ny + z * nz
            x, y, z = x - height * nx, y - height * ny, z - height * nz
            if x * x + y * y + z * z > longest:
                longest, ax, ay, az = x * x + y * y + z * z, x, y, z
    if longest < 1e-24:
        height = nx if abs(nx) < 0.7 else ny
        ax, ay, az = -height * nx, -height * ny, -height * nz
        if abs(nx) < 0.7:
            ax += 1.0
        else:
            ay += 1.0
        longest = ax * ax + ay * ay + az * az
    size = np.sqrt(longest)
    box[3], box[4], box[5], box[6], box[7], box[8] = nx, ny, nz, ax / size, ay / size, az / size
    box[9] = ny * box[8] - nz * box[7]
    box[10] = nz * box[6] - nx * box[8]
    box[11] = nx * box[7] - ny * box[6]
    box[0], box[1], box[2] = 0.0, 0.0, 0.0
    for axis in range(3):
        dx, dy, dz = box[3 + 3 * axis], box[4 + 3 * axis], box[5 + 3 * axis]
        low, high = np.inf, -np.inf
        for member in members:
            for index in range(0, 9, 3):
                x, y, z = triangles[member, index], triangles[member, index + 1], triangles[member, index + 2]
                value = dx * x + dy * y + dz * z
                low, high = min(low, value), max(high, value)
        box[12 + axis] = 0.5 * (high - low) + 1e-12
        middle = 0.5 * (low + high)
        box[0], box[1], box[2] = box[0] + middle * dx, box[1] + middle * dy, box[2] + middle * dz


@njit(cache=True, nogil=True)
def triangle_distance(first: Array, second: Array) -> float:
    """Returns the distance between two triangles, shape (9,) each [m]; 0 if they intersect."""
    best = min(_faces_distance(first, second), _faces_distance(second, first))
    if best <= 0.0:
        return 0.0
    for edge in range(3):
        for other in range(3):
            best = min(best, _edge_distance(first, edge, second, other))
    return np.sqrt(best)


@njit(cache=True, nogil=True)
def _faces_distance(face: Array, other: Array) -> float:
    """Returns the minimum squared distance of `other`'s vertices above or below `face`, 0 if an edge crosses `face`."""
    ux, uy, uz = face[3] - face[0], face[4] - face[1], face[5] - face[2]
    vx, vy, vz = face[6] - face[0], face[7] - face[1], face[8] - face[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    size = nx * nx + ny * ny + nz * nz
    if size <= 0.0:
        return np.inf
    best = np.inf
    heights = (
        (other[0] - face[0]) * nx + (other[1] - face[1]) * ny + (other[2] - face[2]) * nz,
        (other[3] - face[0]) * nx + (other[4] - face[1]) * ny + (other[5] - face[2]) * nz,
        (other[6] - face[0]) * nx + (other[7] - face[1]) * ny + (other[8] - face[2]) * nz,
    )
    for vertex in range(3):
        next_vertex = (vertex + 1) % 3
        span = heights[vertex] - heights[next_vertex]
        if heights[vertex] * heights[next_vertex] > 0.0:
            continue
        fraction = heights[vertex] / span if span != 0.0 else 0.0
        p, q = 3 * vertex, 3 * next_vertex
        x = other[p] + fraction * (other[q] - other[p])
        y = other[p + 1] + fraction * (other[q + 1] - other[p + 1])
        z = other[p + 2] + fraction * (other[q + 2] - other[p + 2])
        if _projects_inside(face, nx, ny, nz, x, y, z):
            return 0.0
    for vertex in range(3):
        p = 3 * vertex
        if _projects_inside(face, nx, ny, nz, other[p], other[p + 1], other[p + 2]):
            best = min(best, heights[vertex] * heights[vertex] / size)
    return best


@njit(cache=True, nogil=True)
def _projects_inside(face: Array, nx: float, ny: float, nz: float, x: float, y: float, z: float) -> bool:
    """Returns whether the point (x, y, z) projects into the face with normal (nx, ny, nz)."""
    for vertex in range(3):
        p, q = 3 * vertex, 3 * ((vertex + 1) % 3)
        ex, ey, ez = face[q] - face[p], face[q + 1] - face[p + 1], face[q + 2] - face[p + 2]
        dx, dy, dz = x - face[p], y - face[p + 1], z - face[p + 2]
        if (ey * dz - ez * dy) * nx + (ez * dx - ex * dz) * ny + (ex * dy - ey * dx) * nz < 0.0:
            return False
    return True


@njit(cache=True, nogil=True)
def _edge_distance(first: Array, edge: int, second: Array, other: int) -> float:
    """Returns the squared distance between two edges, as in C. Ericson, Real-Time Collision Detection, 2005, 5.1.9."""
    p, q, r, s = 3 * edge, 3 * ((edge + 1) % 3), 3 * other, 3 * ((other + 1) % 3)
    ax, ay, az = first[q] - first[p], first[q + 1] - first[p + 1], first[q + 2] - first[p + 2]
    bx, by, bz = second[s] - second[r], second[s + 1] - second[r + 1], second[s + 2] - second[r + 2]
    wx, wy, wz = first[p] - second[r], first[p + 1] - second[r + 1], first[p + 2] - second[r + 2]
    aa, bb, ab = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz, ax * bx + ay * by + az * bz
    aw, bw = ax * wx + ay * wy + az * wz, bx * wx + by * wy + bz * wz
    det = aa * bb - ab * ab
    along = min(max((ab * bw - bb * aw) / det, 0.0), 1.0) if det > 1.0e-12 * aa * bb else 0.0
    across = (ab * along + bw) / bb if bb > 0.0 else 0.0
    if across < 0.0 or across > 1.0:
        across = min(max(across, 0.0), 1.0)
        along = min(max((ab * across - aw) / aa, 0.0), 1.0) if aa > 0.0 else 0.0
    x, y, z = wx + along * ax - across * bx, wy + along * ay - across * by, wz + along * az - across * bz
    return x * x + y * y + z * z


@njit(cache=True, nogil=True)
def encloses(surface: Surfaces, root: int, x: float, y: float, z: float) -> bool:
    """Returns whether a closed surface contains a point: a ray from the point then exits more often than it enters.

    Args:
        surface: Trees with the surface.
        root: Root node of the surface.
        x: Coordinate of the point in the surface's frame [m].
        y: Coordinate of the point in the surface's frame [m].
        z: Coordinate of the point in the surface's frame [m].
    """
    spheres, children, triangles = surface.spheres, surface.children, surface.triangles
    dx, dy, dz = RAY
    stack = np.empty(512, np.int32)
    stack[0] = root
    depth, crossings = 1, 0
    while depth > 0:
        depth -= 1
        node = stack[depth]
        wx, wy, wz = spheres[node, 0] - x, spheres[node, 1] - y, spheres[node, 2] - z
        along = wx * dx + wy * dy + wz * dz
        squared = wx * wx + wy * wy + wz * wz
        squared_radius = spheres[node, 3] * spheres[node, 3]
        if squared - along * along > squared_radius or (along < 0.0 and squared > squared_radius):
            continue
        if children[node, 0] >= 0:
            stack[depth], stack[depth + 1] = children[node, 0], children[node, 1]
            depth += 2
            continue
        crossings += _crossing(triangles[children[node, 1]], x, y, z)
    return crossings > 0


@njit(cache=True, nogil=True)
def _crossing(t: Array, x: float, y: float, z: float) -> int:
    """Returns 1 if the ray from (x, y, z) exits through the triangle t, -1 if it enters, 0 if it misses."""
    dx, dy, dz = RAY
    ux, uy, uz = t[3] - t[0], t[4] - t[1], t[5] - t[2]
    vx, vy, vz = t[6] - t[0], t[7] - t[1], t[8] - t[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    slope = dx * nx + dy * ny + dz * nz
    if slope == 0.0:
        return 0
    distance = ((t[0] - x) * nx + (t[1] - y) * ny + (t[2] - z) * nz) / slope
    if distance < 0.0 or not _projects_inside(t, nx, ny, nz, x + distance * dx, y + distance * dy, z + distance * dz):
        return 0
    return 1 if slope > 0.0 else -1
