# SPDX-License-Identifier: BSD-3-Clause
"""Converts camera images for the browser."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

_MAX_WIDTH_PX = 640
_ENCODINGS = {  # encoding: type and number of channels
    "rgb8": (np.uint8, 3),
    "bgr8": (np.uint8, 3),
    "rgba8": (np.uint8, 4),
    "bgra8": (np.uint8, 4),
    "mono8": (np.uint8, 1),
    "8UC1": (np.uint8, 1),
    "mono16": (np.uint16, 1),
    "16UC1": (np.uint16, 1),
    "32FC1": (np.float32, 1),
}


def picture_of(message: Any) -> NDArray[np.uint8]:
    """Converts a sensor_msgs/Image to colours, shape (height, width, 3); depths become grey values, dark for near.

    Raises:
        ValueError: The encoding is unknown, or the size of the data is wrong.
    """
    if message.encoding not in _ENCODINGS:
        raise ValueError(f"encoding is '{message.encoding[:50]}'; allowed: {', '.join(_ENCODINGS)}")
    kind, channels = _ENCODINGS[message.encoding]
    row = message.width * channels * np.dtype(kind).itemsize
    if not (0 < row <= message.step and len(message.data) == message.step * message.height > 0):
        raise ValueError(
            f"{len(message.data)} bytes in rows of {message.step} are not a '{message.encoding}' image of "
            f"{message.width} x {message.height}"
        )
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)[:, :row]
    pixels = rows.copy().view(kind).reshape(message.height, message.width, channels)
    if bool(message.is_bigendian) != (sys.byteorder == "big"):
        pixels = pixels.byteswap()
    stride = max(1, -(-message.width // _MAX_WIDTH_PX))
    pixels = pixels[::stride, ::stride]
    if channels == 1:
        return np.repeat(_grey(pixels), 3, axis=2)
    return pixels[..., 2::-1] if message.encoding.startswith("bgr") else pixels[..., :3]


def _grey(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    if pixels.dtype == np.uint8:
        return pixels
    values = pixels.astype(np.float64)
    valid = np.isfinite(values) & (values > 0)
    if not valid.any():
        return np.zeros(pixels.shape, np.uint8)
    low, high = values[valid].min(), values[valid].max()
    scaled = np.where(valid, 30 + 225 * (values - low) / max(high - low, 1e-9), 0)
    return np.asarray(np.nan_to_num(scaled), np.uint8)
