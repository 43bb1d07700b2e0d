# SPDX-License-Identifier: BSD-3-Clause
"""Reads the points of a serialised trajectory_msgs/JointTrajectory into arrays.

A goal may have 100,000 points. To make a Python object of each would keep the control loop, which shares the
interpreter, from its time for seconds; NumPy reads points that have the same sizes many at once.
"""

from __future__ import annotations

import struct
from functools import lru_cache

import numpy as np

from modular_framework_control.trajectory.joint_trajectory import TrajectoryPoints, parts

_U32 = struct.Struct("<I")
_KINDS = ("positions", "velocities", "accelerations", "effort")
_EMPTY_POINT_BYTES = 24  # four sizes and a duration

Buffer = bytes | bytearray | memoryview
Sizes = tuple[int, int, int, int]


def read_points(data: Buffer, offset: int, joints: int) -> tuple[TrajectoryPoints, int]:
    """Reads an array of points.

    Args:
        data: the serialised message.
        offset: where the array begins, with the number of its points [bytes].
        joints: number of joint names.

    Returns:
        The points, and where the array ends [bytes].

    Raises:
        struct.error: the data end before the array does.
    """
    (count,) = _U32.unpack_from(data, offset)
    offset += 4
    if count * _EMPTY_POINT_BYTES > len(data) - offset:
        raise struct.error(f"{count} points do not fit into the {len(data) - offset} bytes that are left")
    kept = joints if 8 * count * joints <= len(data) else 0  # otherwise a small message could ask for much memory
    points = TrajectoryPoints(np.empty(count), np.zeros((count, 3, kept)), np.empty((count, 3), np.int32))
    for part in parts(count):
        begin = part.start
        while begin < part.stop:
            sizes = _sizes_at(data, offset)
            sent = _alike(data, offset, sizes, part.stop - begin)
            _store(points, slice(begin, begin + len(sent)), sent, sizes, kept)
            begin += len(sent)
            offset += sent.nbytes
    return points, offset


def _sizes_at(data: Buffer, offset: int) -> Sizes:
    """Numbers of the four kinds of values of the point at `offset`."""
    sizes = []
    for _ in _KINDS:
        (size,) = _U32.unpack_from(data, offset)
        sizes.append(size)
        offset += 4 + 8 * size
    return sizes[0], sizes[1], sizes[2], sizes[3]


def _alike(data: Buffer, offset: int, sizes: Sizes, at_most: int) -> np.ndarray:
    """Views the points from `offset` on that have these sizes, at least one and at most `at_most`."""
    fit = min(at_most, (len(data) - offset) // (_EMPTY_POINT_BYTES + 8 * sum(sizes)))
    if fit < 1:
        raise struct.error(f"the point at byte {offset} is longer than the message")
    sent = np.frombuffer(data, _layout(sizes), fit, offset)
    alike = np.all([sent[f"{kind} size"] == size for kind, size in zip(_KINDS, sizes, strict=True)], axis=0)
    return sent if alike.all() else sent[: int(alike.argmin())]


@lru_cache(maxsize=64)
def _layout(sizes: Sizes) -> np.dtype[np.void]:
    """The fields of a point."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    for kind, size in zip(_KINDS, sizes, strict=True):
        fields += [(f"{kind} size", "<u4"), (kind, "<f8", (size,))]
    return np.dtype([*fields, ("secs", "<i4"), ("nsecs", "<i4")])


def _store(points: TrajectoryPoints, where: slice, sent: np.ndarray, sizes: Sizes, kept: int) -> None:
    points.times_s[where] = sent["secs"] + sent["nsecs"] / 1e9
    points.counts[where] = np.minimum(sizes[:3], np.iinfo(np.int32).max)
    for row, (kind, size) in enumerate(zip(_KINDS[:3], sizes[:3], strict=True)):
        columns = min(size, kept)
        points.values[where, row, :columns] = sent[kind][:, :columns]
