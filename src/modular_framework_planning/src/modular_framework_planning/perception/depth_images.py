# SPDX-License-Identifier: BSD-3-Clause
"""Converts depth images and point clouds to points, and separates those within range from those beyond it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from modular_framework_planning.errors import GeometryError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_ros.point_clouds import PointCloudError, point_array

DEPTH_TYPES = {"16UC1": ("u2", 0.001), "32FC1": ("f4", 1.0), "mono16": ("u2", 0.001)}  # item type, unit [m]


@dataclass(frozen=True, slots=True)
class Pinhole:
    """Focal lengths and principal point of a camera [pixel]."""

    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if not np.isfinite([self.fx, self.fy, self.cx, self.cy]).all() or min(self.fx, self.fy) <= 0.0:
            raise GeometryError(
                f"camera_info: K gives fx, fy, cx, cy = {self.fx}, {self.fy}, {self.cx}, {self.cy}; "
                "focal lengths above 0 and finite numbers are needed; is the camera calibrated?"
            )


@dataclass(frozen=True, slots=True)
class SeenPoints:
    """Points in the sensor's frame.

    Attributes:
        ends: where rays ended within range (n, 3) [m].
        pixels: of a depth image, the number of the pixel of each end in the flat image (n,).
        beyond: points at the end of the range on rays that went on (m, 3) [m].
    """

    ends: Array
    beyond: Array
    pixels: Any = None


def depth_array(data: bytes, encoding: str, shape: tuple[int, int], row_bytes: int, big_endian: bool) -> Array:
    """Returns a depth image (rows, columns) [m].

    Raises:
        GeometryError: another encoding, or too few bytes.
    """
    if encoding not in DEPTH_TYPES:
        raise GeometryError(f"depth image: encoding '{encoding}'; allowed are {', '.join(DEPTH_TYPES)}")
    kind, unit = DEPTH_TYPES[encoding]
    item = np.dtype(kind).newbyteorder(">" if big_endian else "<")
    height, width = shape
    if row_bytes < width * item.itemsize or len(data) < height * row_bytes:
        raise GeometryError(
            f"depth image: {len(data)} bytes in rows of {row_bytes}; {width} x {height} pixels of "
            f"'{encoding}' need {width * height * item.itemsize}"
        )
    rows = np.ndarray((height, width), item, data, strides=(row_bytes, item.itemsize))
    return rows.astype(np.float64) * unit


def points_of_depth(depth: Array, camera: Pinhole, near: float, far: float, skip: tuple[int, int]) -> SeenPoints:
    """Projects a depth image.

    Args:
        depth: distance along the optical axis (rows, columns) [m]; 0, negative and NaN: no reading, inf: beyond range.
        camera: its camera.
        near: readings nearer than this are not used [m].
        far: readings further than this are beyond range [m].
        skip: rows and columns left out at each border.
    """
    vertical, horizontal = skip
    rows = np.arange(vertical, max(vertical, depth.shape[0] - vertical))
    columns = np.arange(horizontal, max(horizontal, depth.shape[1] - horizontal))
    inner = depth[vertical : vertical + len(rows), horizontal : horizontal + len(columns)]
    x, y = np.meshgrid((columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy)
    ends = (inner >= near) & (inner <= far)
    beyond = inner > far
    z = inner[ends]
    indices = (rows[:, None] * depth.shape[1] + columns)[ends]
    return SeenPoints(
        np.column_stack([x[ends] * z, y[ends] * z, z]),
        np.column_stack([x[beyond], y[beyond], np.ones(int(beyond.sum()))]) * far,
        indices,
    )


def cloud_array(message: Any) -> Array:
    """Returns the points of a sensor_msgs/PointCloud2 (rows, columns, 3) [m].

    Raises:
        GeometryError: x, y or z is missing or no floating-point number, or there are too few bytes.
    """
    try:
        return point_array(message)
    except PointCloudError as error:
        raise GeometryError(str(error)) from error


def points_of_cloud(cloud: Array, max_range: float, subsample: int) -> SeenPoints:
    """Returns every `subsample`-th point of every `subsample`-th row; those further than max_range [m] are beyond.

    Points with a coordinate that is not finite are left out.
    """
    points = cloud[::subsample, ::subsample].reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    distances = np.linalg.norm(points, axis=1)
    far = distances > max_range
    return SeenPoints(
        points[~far], points[far] * (max_range / distances[far])[:, None] if far.any() else np.empty((0, 3))
    )
