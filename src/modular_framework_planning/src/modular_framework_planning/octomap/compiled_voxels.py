# SPDX-License-Identifier: BSD-3-Clause
"""Compiled loops over voxels: the voxels along rays, and the leaves in an octree's byte stream."""

from __future__ import annotations  # noqa: I001 - numba_cache has to come before numba

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning import numba_cache  # noqa: F401 - says where compiled code is kept
from numba import njit

Keys = NDArray[np.int64]
Values = NDArray[np.float32]
X_BITS = 0x249249249249  # bits 0, 3, 6, ...: where a Morton code of 3 x 16 bits holds x
EMPTY = -1
HASH_FACTOR = 0x9E3779B97F4A7C15 - (1 << 64)  # 2**64 / golden ratio, as a signed number


@njit(cache=True, nogil=True)
def _insert(table: Keys, key: int) -> bool:
    """Puts a key into an open-addressed table; returns whether it is new."""
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
    larger = np.full(4 * len(table), EMPTY, np.int64)
    for key in table:
        if key != EMPTY:
            _insert(larger, key)
    return larger


@njit(cache=True, nogil=True)
def _spread(value: int) -> int:
    value = (value | (value << 16)) & 0x0000FF0000FF
    value = (value | (value << 8)) & 0x00F00F00F00F
    value = (value | (value << 4)) & 0x0C30C30C30C3
    return (value | (value << 2)) & X_BITS


@njit(cache=True, nogil=True)
def cells_of_points(points: NDArray[np.float64], resolution: float, axis_center: int) -> Keys:
    """Returns the Morton codes of the voxels that points (n, 3) lie in; points beyond the tree are left out."""
    keys, count = np.empty(len(points), np.int64), 0
    for i in range(len(points)):
        key, inside = 0, True
        for axis in range(3):
            cell = np.floor(points[i, axis] / resolution) + axis_center
            inside &= 0 <= cell < 2 * axis_center
            if inside:
                key |= _spread(int(cell)) << axis
        if inside:
            keys[count] = key
            count += 1
    return keys[:count]


@njit(cache=True, nogil=True)
def cells_on_rays(origin: NDArray[np.float64], ends: NDArray[np.float64]) -> Keys:
    """Returns the voxels that rays go through, that of the origin included, those of the ends not.

    The walk is that of Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing" (1987).

    Args:
        origin: where the rays begin (3,), in voxel units, 0 at the corner of voxel (0, 0, 0).
        ends: where they end (n, 3), in voxel units; within 0..65535.

    Returns:
        Morton codes, each once, in no order.
    """
    table = np.full(1 << 16, EMPTY, np.int64)
    used = 0
    spread = np.empty(3, np.int64)
    steps = np.empty(3, np.int64)
    left = np.empty(3, np.int64)
    next_at = np.empty(3)
    gaps = np.empty(3)
    for ray in range(len(ends)):
        total = 0
        for axis in range(3):
            cell, last = int(np.floor(origin[axis])), int(np.floor(ends[ray, axis]))
            length = ends[ray, axis] - origin[axis]
            spread[axis] = _spread(cell) << axis
            steps[axis] = 1 if last >= cell else -1
            left[axis] = abs(last - cell)
            total += left[axis]
            gaps[axis] = 1.0 / abs(length) if length != 0.0 else np.inf
            border = cell + 1 if steps[axis] == 1 else cell
            next_at[axis] = abs(border - origin[axis]) * gaps[axis] if left[axis] else np.inf
        for _ in range(total):
            if _insert(table, spread[0] | spread[1] | spread[2]):
                used += 1
                if 2 * used > len(table):
                    table = _grown(table)
            axis = 0 if next_at[0] <= next_at[1] else 1
            if next_at[2] < next_at[axis]:
                axis = 2
            bits = X_BITS << axis
            if steps[axis] == 1:
                spread[axis] = ((spread[axis] | ~bits) + 1) & bits
            else:
                spread[axis] = (spread[axis] - 1) & bits
            left[axis] -= 1
            next_at[axis] = next_at[axis] + gaps[axis] if left[axis] else np.inf
    return table[table != EMPTY]


@njit(cache=True, nogil=True)
def merged(
    keys: Keys, values: Values, new_keys: Keys, steps: Values, lowest: float, highest: float
) -> tuple[Keys, Values]:
    """Adds steps to the values of keys and clamps the sums; a key that is not there yet begins at 0.

    Args:
        keys: what there is (n,), ascending.
        values: of the keys (n,).
        new_keys: where something is added (m,), ascending.
        steps: what is added (m,).
        lowest: lower clamp.
        highest: upper clamp.
    """
    all_keys, sums = np.empty(len(keys) + len(new_keys), np.int64), np.empty(len(keys) + len(new_keys), np.float32)
    old, new, size = 0, 0, 0
    while old < len(keys) or new < len(new_keys):
        from_old = new == len(new_keys) or (old < len(keys) and keys[old] <= new_keys[new])
        from_new = old == len(keys) or (new < len(new_keys) and new_keys[new] <= keys[old])
        all_keys[size] = keys[old] if from_old else new_keys[new]
        sums[size] = values[old] if from_old else np.float32(0.0)
        if from_new:
            sums[size] = min(max(sums[size] + steps[new], lowest), highest)
            new += 1
        if from_old:
            old += 1
        size += 1
    return all_keys[:size].copy(), sums[:size].copy()


@njit(cache=True, nogil=True)
def read_full(children: NDArray[np.uint8], levels: int) -> tuple[int, Keys, NDArray[np.int64], Keys]:
    """Finds the leaves of a stream of (value, child bits) nodes in pre-order.

    Args:
        children: the child bits of each node (n,).
        levels: depth of the tree.

    Returns:
        How many nodes the tree has, or -1 where it is deeper than allowed or ends early; and of each leaf the first
        Morton code, the depth and the number of its node.
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
    """Finds the leaves of a stream of nodes with two bits a child: 1 free, 2 occupied, 3 has children.

    Args:
        codes: the sixteen bits of each inner node in pre-order (n,).
        levels: depth of the tree.

    Returns:
        How many nodes were read, or -1 where the tree is deeper than allowed or ends early; and of each leaf the first
        Morton code, the depth and whether it is occupied.
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
def within_regions(
    points: NDArray[np.float64],
    origin: NDArray[np.float64],
    shadow: float,
    balls: NDArray[np.float64],
    planes: NDArray[np.float64],
    starts: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Returns which points lie in a convex region, or less than a shadow's length behind one as seen from the origin.

    Args:
        points: (n, 3) [m].
        origin: where the sensor is (3,) [m].
        shadow: length of the shadow [m]; 0 for none.
        balls: centre and radius of a ball around each region (k, 4) [m].
        planes: half-spaces a*x + b*y + c*z + d <= 0 of all regions (m, 4), unit normals.
        starts: where the planes of each region begin (k + 1,).
    """
    result = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        u, v, w = origin[0] - x, origin[1] - y, origin[2] - z
        distance = np.sqrt(u * u + v * v + w * w)
        share = min(shadow, distance) / distance if distance > 0.0 else 0.0
        u, v, w = u * share, v * share, w * share
        square = u * u + v * v + w * w
        for region in range(len(balls)):
            p, q, r = x - balls[region, 0], y - balls[region, 1], z - balls[region, 2]
            reach = balls[region, 3]
            gap = p * p + q * q + r * r
            if gap > (reach + shadow) ** 2:
                continue
            begin, end = _within_ball(square, p * u + q * v + r * w, gap - reach * reach)
            for number in range(starts[region], starts[region + 1]):
                a, b, c = planes[number, 0], planes[number, 1], planes[number, 2]
                height = a * x + b * y + c * z + planes[number, 3]
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
def _within_ball(square: float, half: float, excess: float) -> tuple[float, float]:
    """The piece (shares 0..1) of a line start + t * back that lies in a ball.

    Args:
        square: back . back.
        half: back . (start - centre).
        excess: squared distance of start and centre less the squared radius.
    """
    if square == 0.0:
        return (0.0, 1.0) if excess <= 0.0 else (1.0, 0.0)
    root = half * half - square * excess
    if root < 0.0:
        return 1.0, 0.0
    root = np.sqrt(root)
    return max(0.0, (-half - root) / square), min(1.0, (-half + root) / square)


@njit(cache=True, nogil=True)
def distinct(keys: Keys) -> Keys:
    """Returns the keys, each once, ascending."""
    table = np.full(1 << 12, EMPTY, np.int64)
    used = 0
    for key in keys:
        if _insert(table, key):
            used += 1
            if 2 * used > len(table):
                table = _grown(table)
    return np.sort(table[table != EMPTY])
