# SPDX-License-Identifier: BSD-3-Clause
"""Fast reader for the points of a serialized trajectory_msgs/JointTrajectory.

A goal may have 100,000 points. One Python object per point would block the control loop, which shares the interpreter,
for seconds. NumPy reads many points of equal sizes at once.
"""

from __future__ import annotations

import struct
from functools import lru_cache

import numpy as np

from modular_framework_control.trajectory.joint_trajectory import TrajectoryPoints, chunks

_U32 = struct.Struct("<I")
_FIELDS = ("positions", "velocities", "accelerations", "effort")
_EMPTY_POINT_BYTES = 24  # four sizes and a duration

Buffer = bytes | bytearray | memoryview
Sizes = tuple[int, int, int, int]


def read_points(data: Buffer, offset: int, joints: int) -> tuple[TrajectoryPoints, int]:
    """Reads an array of points.

    Args:
        data: Serialized message.
        offset: Offset of the array's length field [bytes].
        joints: Number of joint names.

    Returns:
        The points, and the offset of the end of the array [bytes].

    Raises:
        struct.error: The data is truncated.
    """
    (count,) = _U32.unpack_from(data, offset)
    offset += 4
    if count * _EMPTY_POINT_BYTES > len(data) - offset:
        raise struct.error(f"{count} points do not fit into the remaining {len(data) - offset} bytes")
    columns_used = joints if 8 * count * joints <= len(data) else 0  # a small message must not allocate much memory
    points = TrajectoryPoints(np.empty(count), np.zeros((count, 3, columns_used)), np.empty((count, 3), np.int32))
    for chunk in chunks(count):
        begin = chunk.start
        while begin < chunk.stop:
            sizes = _sizes_at(data, offset)
            block = _equal_sized(data, offset, sizes, chunk.stop - begin)
            _store(points, slice(begin, begin + len(block)), block, sizes, columns_used)
            begin += len(block)
            offset += block.nbytes
    return points, offset


def _sizes_at(data: Buffer, offset: int) -> Sizes:
    """Returns the lengths of the four value arrays of the point at `offset`."""
    sizes = []
    for _ in _FIELDS:
        (size,) = _U32.unpack_from(data, offset)
        sizes.append(size)
        offset += 4 + 8 * size
    return sizes[0], sizes[1], sizes[2], sizes[3]


def _equal_sized(data: Buffer, offset: int, sizes: Sizes, max_points: int) -> np.ndarray:
    """Returns a view of the leading points at `offset` whose arrays have these lengths, at most `max_points` points."""
    count = min(max_points, (len(data) - offset) // (_EMPTY_POINT_BYTES + 8 * sum(sizes)))
    if count < 1:
        raise struct.error(f"the point at byte {offset} is longer than the message")
    block = np.frombuffer(data, _layout(sizes), count, offset)
    is_equal_sized = np.all([block[f"{kind} size"] == size for kind, size in zip(_FIELDS, sizes, strict=True)], axis=0)
    return block if is_equal_sized.all() else block[: int(is_equal_sized.argmin())]


@lru_cache(maxsize=64)
def _layout(sizes: Sizes) -> np.dtype[np.void]:
    """Returns the memory layout of a point."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    for kind, size in zip(_FIELDS, sizes, strict=True):
        fields += [(f"{kind} size", "<u4"), (kind, "<f8", (size,))]
    return np.dtype([*fields, ("secs", "<i4"), ("nsecs", "<i4")])


def _store(points: TrajectoryPoints, rows: slice, block: np.ndarray, sizes: Sizes, columns_used: int) -> None:
    points.times_s[rows] = block["secs"] + block["nsecs"] / 1e9
    points.counts[rows] = np.minimum(sizes[:3], np.iinfo(np.int32).max)
    for row, (kind, size) in enumerate(zip(_FIELDS[:3], sizes[:3], strict=True)):
        columns = min(size, columns_used)
        points.values[rows, row, :columns] = block[kind][:, :columns]
