# SPDX-License-Identifier: BSD-3-Clause
"""Camera images of every encoding become depths in metres and RGB colours."""

from __future__ import annotations

import struct
from types import SimpleNamespace

import numpy as np
import pytest

from modular_framework_ros.messages.camera_images import colour_array, depth_array


def image(encoding: str, data: bytes, *, step: int, width: int = 2, big: int = 0) -> SimpleNamespace:
    """An image with a single row."""
    return SimpleNamespace(encoding=encoding, data=data, step=step, width=width, height=1, is_bigendian=big)


def test_depths_in_metres_stay_as_they_are_and_rows_may_be_padded() -> None:
    data = struct.pack("<ff", 0.5, float("nan")) + b"\x07" * 4
    assert depth_array(image("32FC1", data, step=12)) == pytest.approx(np.array([[0.5, np.nan]]), nan_ok=True)


@pytest.mark.parametrize(("order", "big"), [("<", 0), (">", 1)])
def test_depths_in_millimetres_become_metres_and_zero_is_no_measurement(order: str, big: int) -> None:
    depths = depth_array(image("16UC1", struct.pack(f"{order}HH", 1500, 0), step=4, big=big))
    assert depths.dtype == np.float32
    assert depths == pytest.approx(np.array([[1.5, np.nan]]), nan_ok=True)


@pytest.mark.parametrize(
    ("encoding", "data"),
    [
        ("rgb8", b"\x01\x02\x03\x04\x05\x06"),
        ("bgr8", b"\x03\x02\x01\x06\x05\x04"),
        ("rgba8", b"\x01\x02\x03\xff\x04\x05\x06\xff"),
        ("bgra8", b"\x03\x02\x01\xff\x06\x05\x04\xff"),
    ],
)
def test_red_comes_first(encoding: str, data: bytes) -> None:
    assert colour_array(image(encoding, data, step=len(data))).tolist() == [[[1, 2, 3], [4, 5, 6]]]


def test_other_images_are_refused() -> None:
    with pytest.raises(ValueError, match="'mono8'; allowed for depths: 32FC1"):
        depth_array(image("mono8", b"\x00\x00", step=2))
    with pytest.raises(ValueError, match="'32FC1'; allowed for colours: rgb8"):
        colour_array(image("32FC1", b"\x00" * 8, step=8))
    with pytest.raises(ValueError, match="5 bytes in rows of 6 are not a 'rgb8' image of 2 x 1"):
        colour_array(image("rgb8", b"\x00" * 5, step=6))
