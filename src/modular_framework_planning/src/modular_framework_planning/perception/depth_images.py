# SPDX-License-Identifier: BSD-3-Clause
"""Conversion of depth images and point clouds to points within and beyond the sensor's range."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from modular_framework_planning.errors import GeometryError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_ros.messages.point_clouds import PointCloudError, point_array

DEPTH_TYPES = {"16UC1": ("u2", 0.001), "32FC1": ("f4", 1.0), "mono16": ("u2", 0.001)}  # pixel type, unit [m]


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
                f"camera_info: K has fx, fy, cx, cy = {self.fx}, {self.fy}, {self.cx}, {self.cy}; "
                "all must be finite and focal lengths above 0; calibrate the camera"
            )


@dataclass(frozen=True, slots=True)
class SeenPoints:
    """Points in the sensor's frame.

    Attributes:
        ends: Ends of rays within range, shape (n, 3) [m].
        beyond: Points at maximum range on rays that ended beyond, shape (m, 3) [m].
        pixels: For a depth image, the flat pixel index of each end, shape (n,).
    """

    ends: Array
    beyond: Array
    pixels: Any = None


def depth_array(data: bytes, encoding: str, shape: tuple[int, int], row_bytes: int, big_endian: bool) -> Array:
    """Decodes a depth image, shape (rows, columns) [m].

    Args:
        data: Pixel data.
        encoding: Encoding of sensor_msgs/Image.
        shape: Height and width [pixel].
        row_bytes: Bytes per row.
        big_endian: Whether pixels are big-endian.

    Raises:
        GeometryError: The encoding is not supported, or the data is too short.
    """
    if encoding not in DEPTH_TYPES:
        raise GeometryError(f"depth image: encoding '{encoding}'; supported encodings: {', '.join(DEPTH_TYPES)}")
    kind, unit = DEPTH_TYPES[encoding]
    pixel = np.dtype(kind).newbyteorder(">" if big_endian else "<")
    height, width = shape
    if row_bytes < width * pixel.itemsize or len(data) < height * row_bytes:
        raise GeometryError(
            f"depth image: {len(data)} bytes in rows of {row_bytes}; {width} x {height} pixels of "
            f"'{encoding}' need {width * height * pixel.itemsize}"
        )
    rows = np.ndarray((height, width), pixel, data, strides=(row_bytes, pixel.itemsize))
    return rows.astype(np.float64) * unit


def points_of_depth(depth: Array, camera: Pinhole, near: float, far: float, skip: tuple[int, int]) -> SeenPoints:
    """Projects a depth image to points.

    Args:
        depth: Distance along the optical axis, shape (rows, columns) [m]. Values up to 0 and NaN mean no measurement,
            infinity means beyond range.
        camera: Intrinsic parameters of the camera.
        near: Minimum valid depth [m].
        far: Maximum range [m].
        skip: Numbers of rows and columns left out at each border.
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
    """Returns the points of a sensor_msgs/PointCloud2, shape (rows, columns, 3) [m].

    Raises:
        GeometryError: A field x, y or z is missing or not a floating-point number, or the data is too short.
    """
    try:
        return point_array(message)
    except PointCloudError as error:
        raise GeometryError(str(error)) from error


def points_of_cloud(cloud: Array, max_range: float, subsample: int) -> SeenPoints:
    """Returns the subsampled points of a cloud, without points that are not finite.

    Args:
        cloud: Points, shape (rows, columns, 3) [m].
        max_range: Maximum range [m].
        subsample: Step between used rows and between used columns.
    """
    points = cloud[::subsample, ::subsample].reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    distances = np.linalg.norm(points, axis=1)
    far = distances > max_range
    return SeenPoints(
        points[~far], points[far] * (max_range / distances[far])[:, None] if far.any() else np.empty((0, 3))
    )
