# SPDX-License-Identifier: BSD-3-Clause
"""Compiled kernels for voxel maps: ray traversal, map updates, decoding of octree streams, and self filtering."""

from __future__ import annotations  # noqa: I001 - numba_cache must be imported before numba

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning import numba_cache  # noqa: F401 - sets the folder of numba's cache
from numba import njit

Keys = NDArray[np.int64]
Values = NDArray[np.float32]
X_BITS = 0x249249249249  # bits 0, 3, 6, ..., the x bits of a Morton code of 3 x 16 bits
EMPTY = -1
HASH_FACTOR = 0x9E3779B97F4A7C15 - (1 << 64)  # 2**64 / golden ratio, as a signed integer


@njit(cache=True, nogil=True)
def _insert(table: Keys, key: int) -> bool:
    """Inserts a key into an open-addressing hash table; returns whether the key is new."""
    mask = len(table) - 1
    slot = ((key * HASH_FACTOR) >> 20) & mask
    while table[slot] != EMPTY:
        if table[slot] == key:
            return False
        slot = (slot + 1) & mask
    table[slot] = key
    return True


@njit(cache=True, nogil=True)
def _grown(table: Keys) -> Keys:
    """Returns a hash table with the same keys and four times the capacity."""
    larger = np.full(4 * len(table), EMPTY, np.int64)
    for key in table:
        if key != EMPTY:
            _insert(larger, key)
    return larger


@njit(cache=True, nogil=True)
def _spread(value: int) -> int:
    """Moves bit i of a 16-bit value to bit 3 i."""
    value = (value | (value << 16)) & 0x0000FF0000FF
    value = (value | (value << 8)) & 0x00F00F00F00F
    value = (value | (value << 4)) & 0x0C30C30C30C3
    return (value | (value << 2)) & X_BITS


@njit(cache=True, nogil=True)
def cells_of_points(points: NDArray[np.float64], resolution: float, axis_center: int) -> Keys:
    """Returns the Morton codes of the voxels that contain points, without points outside the tree.

    Args:
        points: Points in the frame of the tree, shape (n, 3) [m].
        resolution: Edge length of a voxel [m].
        axis_center: Index of the voxel that begins at coordinate 0.
    """
    keys, count = np.empty(len(points), np.int64), 0
    for i in range(len(points)):
        key, is_inside = 0, True
        for axis in range(3):
            cell = np.floor(points[i, axis] / resolution) + axis_center
            is_inside &= 0 <= cell < 2 * axis_center
            if is_inside:
                key |= _spread(int(cell)) << axis
        if is_inside:
            keys[count] = key
            count += 1
    return keys[:count]


@njit(cache=True, nogil=True)
def cells_on_rays(origin: NDArray[np.float64], ends: NDArray[np.float64]) -> Keys:
    """Returns the distinct Morton codes of the voxels along rays, unordered.

    The codes include the voxel of the origin, but not the voxels of the ends.
    Source: Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing" (1987).

    Args:
        origin: Start of the rays in voxel units, with 0 at the corner of voxel (0, 0, 0); shape (3,).
        ends: Ends of the rays in voxel units, within 0..65535; shape (n, 3).
    """
    table = np.full(1 << 16, EMPTY, np.int64)
    used = 0
    axis_bits, steps, remaining = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3, np.int64)
    next_border, border_spacing = np.empty(3), np.empty(3)
    for ray in range(len(ends)):
        total = 0
        for axis in range(3):
            cell, last = int(np.floor(origin[axis])), int(np.floor(ends[ray, axis]))
            length = ends[ray, axis] - origin[axis]
            axis_bits[axis] = _spread(cell) << axis
            steps[axis] = 1 if last >= cell else -1
            remaining[axis] = abs(last - cell)
            total += remaining[axis]
            border_spacing[axis] = 1.0 / abs(length) if length != 0.0 else np.inf
            border = cell + 1 if steps[axis] == 1 else cell
            next_border[axis] = abs(border - origin[axis]) * border_spacing[axis] if remaining[axis] else np.inf
        for _ in range(total):
            if _insert(table, axis_bits[0] | axis_bits[1] | axis_bits[2]):
                used += 1
                if 2 * used > len(table):
                    table = _grown(table)
            axis = 0 if next_border[0] <= next_border[1] else 1
            if next_border[2] < next_border[axis]:
                axis = 2
            mask = X_BITS << axis
            if steps[axis] == 1:
                axis_bits[axis] = ((axis_bits[axis] | ~mask) + 1) & mask
            else:
                axis_bits[axis] = (axis_bits[axis] - 1) & mask
            remaining[axis] -= 1
            next_border[axis] = next_border[axis] + border_spacing[axis] if remaining[axis] else np.inf
    return table[table != EMPTY]


@njit(cache=True, nogil=True)
def merge(
    keys: Keys, values: Values, new_keys: Keys, steps: Values, min_value: float, max_value: float
) -> tuple[Keys, Values]:
    """Returns all keys in ascending order, and their values after adding steps; a new key starts at 0.

    Args:
        keys: Known keys in ascending order, shape (n,).
        values: Value of each known key, shape (n,).
        new_keys: Updated keys in ascending order, shape (m,).
        steps: Step of each updated key, shape (m,).
        min_value: Lower bound of a changed value.
        max_value: Upper bound of a changed value.
    """
    all_keys, sums = np.empty(len(keys) + len(new_keys), np.int64), np.empty(len(keys) + len(new_keys), np.float32)
    old, new, size = 0, 0, 0
    while old < len(keys) or new < len(new_keys):
        from_old = new == len(new_keys) or (old < len(keys) and keys[old] <= new_keys[new])
        from_new = old == len(keys) or (new < len(new_keys) and new_keys[new] <= keys[old])
        all_keys[size] = keys[old] if from_old else new_keys[new]
        sums[size] = values[old] if from_old else np.float32(0.0)
        if from_new:
            sums[size] = min(max(sums[size] + steps[new], min_value), max_value)
            new += 1
        if from_old:
            old += 1
        size += 1
    return all_keys[:size].copy(), sums[:size].copy()


@njit(cache=True, nogil=True)
def read_full(children: NDArray[np.uint8], levels: int) -> tuple[int, Keys, NDArray[np.int64], Keys]:
    """Returns the leaves of an octree stream with full values, whose nodes (value, child bits) are in pre-order.

    Args:
        children: Child bits of each node, shape (n,).
        levels: Depth of the tree.

    Returns:
        The number of nodes, or -1 for a tree that is too deep or truncated; and each leaf's first Morton code, depth
        and node index.
    """
    count = len(children)
    starts, depths, nodes = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count, np.int64)
    stack_key, stack_depth = np.zeros(8 * (levels + 1), np.int64), np.zeros(8 * (levels + 1), np.int64)
    size, leaves, node = 1, 0, 0
    while size and node < count:
        size -= 1
        key, depth, bits = stack_key[size], stack_depth[size], children[node]
        if bits == 0:
            starts[leaves], depths[leaves], nodes[leaves] = key, depth, node
            leaves += 1
        elif depth == levels:
            return -1, starts[:0], depths[:0], nodes[:0]
        else:
            for child in range(7, -1, -1):
                if (bits >> child) & 1:
                    stack_key[size] = key + (child << (3 * (levels - depth - 1)))
                    stack_depth[size] = depth + 1
                    size += 1
        node += 1
    return -1 if size else node, starts[:leaves], depths[:leaves], nodes[:leaves]


@njit(cache=True, nogil=True)
def read_binary(codes: NDArray[np.uint16], levels: int) -> tuple[int, Keys, NDArray[np.int64], NDArray[np.bool_]]:
    """Returns the leaves of a binary octree stream with two bits per child: 1 free, 2 occupied, 3 inner node.

    Args:
        codes: Sixteen bits of each inner node in pre-order, shape (n,).
        levels: Depth of the tree.

    Returns:
        The number of inner nodes, or -1 for a tree that is too deep or truncated; and each leaf's first Morton code,
        depth and occupancy.
    """
    count = len(codes)
    starts, depths = np.empty(8 * count, np.int64), np.empty(8 * count, np.int64)
    occupied = np.empty(8 * count, np.bool_)
    stack_key, stack_depth = np.zeros(8 * (levels + 1), np.int64), np.zeros(8 * (levels + 1), np.int64)
    size, leaves, node = 1, 0, 0
    while size and node < count:
        size -= 1
        key, depth, code = stack_key[size], stack_depth[size], int(codes[node])
        if depth == levels:
            return -1, starts[:0], depths[:0], occupied[:0]
        for child in range(7, -1, -1):
            kind = (code >> (2 * child)) & 3
            start = key + (child << (3 * (levels - depth - 1)))
            if kind == 3:
                stack_key[size], stack_depth[size] = start, depth + 1
                size += 1
            elif kind:
                starts[leaves], depths[leaves], occupied[leaves] = start, depth + 1, kind == 2
                leaves += 1
        node += 1
    return -1 if size else node, starts[:leaves], depths[:leaves], occupied[:leaves]


@njit(cache=True, nogil=True)
def points_in_regions(
    points: NDArray[np.float64],
    origin: NDArray[np.float64],
    shadow: float,
    spheres: NDArray[np.float64],
    planes: NDArray[np.float64],
    starts: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Returns whether each point lies in a convex region or in the shadow of a region as seen from the sensor.

    A point lies in a shadow if the segment of length `shadow` from the point p towards the sensor, p + t (u, v, w) with
    t from 0 to 1, meets the region.

    Args:
        points: Points, shape (n, 3) [m].
        origin: Position of the sensor, shape (3,) [m].
        shadow: Length of the shadow behind a region [m].
        spheres: Centre and radius of each region's bounding sphere, shape (k, 4) [m].
        planes: Half-spaces a*x + b*y + c*z + d <= 0 of all regions with unit normals, shape (m, 4).
        starts: Index of each region's first plane, and the number of planes; shape (k + 1,).
    """
    result = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        u, v, w = origin[0] - x, origin[1] - y, origin[2] - z
        distance = np.sqrt(u * u + v * v + w * w)
        fraction = min(shadow, distance) / distance if distance > 0.0 else 0.0
        u, v, w = u * fraction, v * fraction, w * fraction
        squared_length = u * u + v * v + w * w
        for region in range(len(spheres)):
            p, q, r = x - spheres[region, 0], y - spheres[region, 1], z - spheres[region, 2]
            radius = spheres[region, 3]
            squared_distance = p * p + q * q + r * r
            if squared_distance > (radius + shadow) ** 2:
                continue
            excess = squared_distance - radius * radius
            begin, end = _range_in_sphere(squared_length, p * u + q * v + r * w, excess)
            for plane in range(starts[region], starts[region + 1]):
                a, b, c = planes[plane, 0], planes[plane, 1], planes[plane, 2]
                height = a * x + b * y + c * z + planes[plane, 3]
                slope = a * u + b * v + c * w
                if slope > 0.0:
                    end = min(end, -height / slope)
                elif slope < 0.0:
                    begin = max(begin, -height / slope)
                elif height > 0.0:
                    end = -1.0
                if begin > end:
                    break
            if begin <= end:
                result[i] = True
                break
    return result


@njit(cache=True, nogil=True)
def _range_in_sphere(a: float, b: float, c: float) -> tuple[float, float]:
    """Returns the range of t, within 0..1, in which start + t * direction lies in a sphere; (1, 0) if nowhere.

    The range lies between the roots of a t^2 + 2 b t + c.

    Args:
        a: direction . direction.
        b: direction . (start - centre).
        c: Squared distance between start and centre minus the squared radius.
    """
    if a == 0.0:
        return (0.0, 1.0) if c <= 0.0 else (1.0, 0.0)
    discriminant = b * b - a * c
    if discriminant < 0.0:
        return 1.0, 0.0
    root = np.sqrt(discriminant)
    return max(0.0, (-b - root) / a), min(1.0, (-b + root) / a)


@njit(cache=True, nogil=True)
def distinct(keys: Keys) -> Keys:
    """Returns the distinct keys in ascending order."""
    table = np.full(1 << 12, EMPTY, np.int64)
    used = 0
    for key in keys:
        if _insert(table, key):
            used += 1
            if 2 * used > len(table):
                table = _grown(table)
    return np.sort(table[table != EMPTY])
