# SPDX-License-Identifier: BSD-3-Clause
"""Converts camera images for the browser."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from modular_framework_ros.messages.camera_images import colours, pixel_array

_MAX_WIDTH_PX = 640


def picture_of(message: Any) -> NDArray[np.uint8]:
    """Converts a sensor_msgs/Image to colours, shape (height, width, 3); depths become grey values, dark for near.

    Raises:
        ValueError: The encoding is unknown, or the size of the data is wrong.
    """
    pixels = pixel_array(message)
    stride = max(1, -(-message.width // _MAX_WIDTH_PX))
    pixels = pixels[::stride, ::stride]
    if pixels.shape[2] == 1:
        return np.repeat(_grey(pixels), 3, axis=2)
    return colours(pixels, message.encoding)


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
