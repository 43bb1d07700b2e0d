# SPDX-License-Identifier: BSD-3-Clause
"""Converts a sensor_msgs/PointCloud2 to an array; imports no ROS."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

FLOAT_TYPES = {7: "f4", 8: "f8"}  # of sensor_msgs/PointField: FLOAT32, FLOAT64


class PointCloudError(ValueError):
    """A message is not a usable point cloud; the message gives the reason."""


def point_array(message: Any) -> npt.NDArray[np.float64]:
    """Returns the points of a sensor_msgs/PointCloud2, shape (rows, columns, 3) [m]; an unorganised cloud has one row.

    Raises:
        PointCloudError: The field x, y or z is missing or not a floating-point number, or the data are too short.
    """
    fields = {field.name: field for field in message.fields}
    bad = [name for name in "xyz" if name not in fields or fields[name].datatype not in FLOAT_TYPES]
    if bad:
        raise PointCloudError(
            f"point cloud: field {', '.join(bad)} is missing or no float; fields are "
            f"{', '.join(fields) or 'none'}; x, y and z of type FLOAT32 or FLOAT64 are needed"
        )
    shape, data = (message.height, message.width), bytes(message.data)
    reach = max(fields[name].offset + np.dtype(FLOAT_TYPES[fields[name].datatype]).itemsize for name in "xyz")
    needed = (shape[0] - 1) * message.row_step + (shape[1] - 1) * message.point_step + reach if min(shape) else 0
    if message.row_step < shape[1] * message.point_step or len(data) < needed:
        raise PointCloudError(
            f"point cloud: {len(data)} bytes in rows of {message.row_step} and points of "
            f"{message.point_step}; {shape[1]} x {shape[0]} points need {needed}"
        )
    if not min(shape):
        return np.empty((*shape, 3))
    types = {
        name: np.dtype(FLOAT_TYPES[fields[name].datatype]).newbyteorder(">" if message.is_bigendian else "<")
        for name in "xyz"
    }
    axes = [
        np.ndarray(
            shape,
            types[name],
            data,
            fields[name].offset,
            (message.row_step, message.point_step),
        )
        for name in "xyz"
    ]
    return np.stack(axes, axis=-1).astype(np.float64)
