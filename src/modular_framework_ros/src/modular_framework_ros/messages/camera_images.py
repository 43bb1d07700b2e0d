# SPDX-License-Identifier: BSD-3-Clause
"""Converts a sensor_msgs/Image to an array; imports no ROS."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import numpy.typing as npt

ENCODINGS = {  # encoding: type and number of channels
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
MILLIMETRE_M = 1e-3


def pixel_array(message: Any) -> npt.NDArray[Any]:
    """Returns the pixels of an image, shape (height, width, channels), in the channel order of the encoding.

    Raises:
        ValueError: The encoding is unknown, or the size of the data is wrong.
    """
    if message.encoding not in ENCODINGS:
        raise ValueError(f"encoding is '{message.encoding[:50]}'; allowed: {', '.join(ENCODINGS)}")
    kind, channels = ENCODINGS[message.encoding]
    row = message.width * channels * np.dtype(kind).itemsize
    if not (0 < row <= message.step and len(message.data) == message.step * message.height > 0):
        raise ValueError(
            f"{len(message.data)} bytes in rows of {message.step} are not a '{message.encoding}' image of "
            f"{message.width} x {message.height}"
        )
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)[:, :row]
    pixels = rows.copy().view(kind).reshape(message.height, message.width, channels)
    return pixels.byteswap() if bool(message.is_bigendian) != (sys.byteorder == "big") else pixels


def colours(pixels: npt.NDArray[Any], encoding: str) -> npt.NDArray[Any]:
    """Returns the RGB channels of pixels with at least three channels.

    Args:
        pixels: Array of `pixel_array`.
        encoding: Encoding of the image.
    """
    return pixels[..., 2::-1] if encoding.startswith("bgr") else pixels[..., :3]


def depth_array(message: Any) -> npt.NDArray[np.float32]:
    """Returns the depths of an image, shape (height, width) [m]; NaN for pixels without a measurement.

    Raises:
        ValueError: The encoding is not 32FC1 [m] or 16UC1 [mm], or the size of the data is wrong.
    """
    if message.encoding not in ("32FC1", "16UC1"):
        raise ValueError(f"encoding is '{message.encoding[:50]}'; allowed for depths: 32FC1 [m], 16UC1 [mm]")
    depths = pixel_array(message)[..., 0]
    if message.encoding == "16UC1":
        depths = np.where(depths > 0, depths * np.float32(MILLIMETRE_M), np.float32(np.nan))
    return np.asarray(depths, dtype=np.float32)


def colour_array(message: Any) -> npt.NDArray[np.uint8]:
    """Returns the RGB colours of an image, shape (height, width, 3).

    Raises:
        ValueError: The encoding has no colours, or the size of the data is wrong.
    """
    if not message.encoding.startswith(("rgb", "bgr")):
        raise ValueError(f"encoding is '{message.encoding[:50]}'; allowed for colours: rgb8, bgr8, rgba8, bgra8")
    return np.ascontiguousarray(colours(pixel_array(message), message.encoding))
