# SPDX-License-Identifier: BSD-3-Clause
"""Clouds of any layout give their points; others are refused with what is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2, PointField

from modular_framework_ros.messages.point_clouds import PointCloudError, point_array

POINTS = np.array([[[0.1, 0.2, 0.3], [1.0, np.nan, 3.0]], [[-1.0, -2.0, -3.0], [4.0, 5.0, 6.0]]])


def cloud(points: np.ndarray, kind: str = "<f4", code: int = PointField.FLOAT32, gap: int = 4) -> PointCloud2:
    """A cloud with a field in front of the coordinates, and unused bytes at the end of each row."""
    rows, columns, _ = points.shape
    size = np.dtype(kind).itemsize
    step = gap + 3 * size
    data = np.zeros((rows, columns * step + 8), np.uint8)
    for row in range(rows):
        for column in range(columns):
            start = column * step + gap
            data[row, start : start + 3 * size] = np.frombuffer(points[row, column].astype(kind).tobytes(), np.uint8)
    message = PointCloud2(height=rows, width=columns, point_step=step, row_step=columns * step + 8)
    message.is_bigendian = kind.startswith(">")
    message.fields = [PointField("rgb", 0, PointField.UINT32, 1)] if gap else []
    message.fields += [PointField(name, gap + place * size, code, 1) for place, name in enumerate("xyz")]
    message.data = data.tobytes()
    return message


@pytest.mark.parametrize(
    ("kind", "code"), [("<f4", PointField.FLOAT32), (">f4", PointField.FLOAT32), ("<f8", PointField.FLOAT64)]
)
def test_points_are_read_whatever_their_type_order_and_gaps(kind: str, code: int) -> None:
    assert point_array(cloud(POINTS, kind, code)) == pytest.approx(POINTS, abs=1e-6, nan_ok=True)


def test_an_unorganised_cloud_has_one_row_and_an_empty_one_no_points() -> None:
    assert point_array(cloud(POINTS.reshape(1, 4, 3))) == pytest.approx(POINTS.reshape(1, 4, 3), abs=1e-6, nan_ok=True)
    assert point_array(cloud(np.zeros((1, 0, 3)))).shape == (1, 0, 3)


def test_a_cloud_that_cannot_be_read_is_refused_with_the_reason() -> None:
    with pytest.raises(PointCloudError, match="field y, z is missing or no float; fields are x"):
        point_array(PointCloud2(fields=[PointField("x", 0, PointField.FLOAT32, 1)]))
    with pytest.raises(PointCloudError, match="field x, y, z is missing or no float"):
        point_array(cloud(POINTS, code=PointField.INT32))
    short = cloud(POINTS)
    short.data = short.data[:-20]
    with pytest.raises(PointCloudError, match="bytes in rows of .*2 x 2 points need"):
        point_array(short)
