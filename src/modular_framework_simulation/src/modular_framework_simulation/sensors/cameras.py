# SPDX-License-Identifier: BSD-3-Clause
"""Simulated cameras: poses, images and the pinhole projection.

In an optical frame, z points forwards, x to the right and y down in the image (REP 103).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.sensors.noise import NO_NOISE, Noise, NoiseSource

OPTICAL_IN_BODY = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (-math.pi / 2, 0.0, -math.pi / 2))
"""Pose of the optical frame in the frame of a `<sensor>`, whose x axis points forwards."""

Image = npt.NDArray[np.uint8]
Depth = npt.NDArray[np.float32]
Cloud = npt.NDArray[np.void]

_EMPTY_DEPTH = 1.0 - 1e-6
"""Minimum depth value of an empty pixel in OpenGL's buffer; TinyRenderer's empty pixels are slightly below 1."""
POINT = np.dtype({"names": ["x", "y", "z", "rgb"], "formats": ["<f4", "<f4", "<f4", "<u4"]})
"""Point of a cloud: position [m] in the optical frame, and colour as 0x00RRGGBB."""


@dataclass(frozen=True, slots=True)
class Pinhole:
    """Pinhole projection with square pixels; the centre of the first pixel has the coordinates (0, 0).

    Attributes:
        width: Image width [pixel].
        height: Image height [pixel].
        horizontal_fov: Angle between the left and right image edges [rad].
        near: Minimum depth of visible surfaces [m].
        far: Maximum depth of visible surfaces [m].
    """

    width: int = 640
    height: int = 480
    horizontal_fov: float = math.pi / 3
    near: float = 0.05
    far: float = 10.0

    @property
    def focal_length(self) -> float:
        """Returns the focal length [pixel]."""
        return self.width / (2 * math.tan(self.horizontal_fov / 2))

    @property
    def centre(self) -> tuple[float, float]:
        """Returns the column and row of the principal point [pixel]."""
        return (self.width - 1) / 2, (self.height - 1) / 2

    def intrinsics(self) -> tuple[float, ...]:
        """Returns the camera matrix K in row-major order [pixel], 9 values."""
        (column, row), focal = self.centre, self.focal_length
        return (focal, 0.0, column, 0.0, focal, row, 0.0, 0.0, 1.0)

    def opengl_projection(self, shift: tuple[float, float] = (0.0, 0.0)) -> tuple[float, ...]:
        """Returns OpenGL's projection matrix in column-major order, 16 values.

        Args:
            shift: Shift of the image to the right and down [pixel].
        """
        focal, near, far = self.focal_length, self.near, self.far
        column_1 = (2 * focal / self.width, 0.0, 0.0, 0.0)
        column_2 = (0.0, 2 * focal / self.height, 0.0, 0.0)
        column_3 = (-2 * shift[0] / self.width, 2 * shift[1] / self.height, (near + far) / (near - far), -1.0)
        return (*column_1, *column_2, *column_3, 0.0, 0.0, 2 * near * far / (near - far), 0.0)

    def depth_from_buffer(self, values: npt.NDArray[np.float32]) -> Depth:
        """Converts OpenGL's depth buffer, from 0 at `near` to 1 at `far`, to depths along the optical axis.

        Args:
            values: Depth buffer, shape (height, width).

        Returns:
            Depths, shape (height, width) [m]; NaN for empty pixels.
        """
        buffer = values.astype(np.float64)
        depth = self.far * self.near / (self.far - (self.far - self.near) * buffer)
        depth[buffer >= _EMPTY_DEPTH] = np.nan
        return depth.astype(np.float32)

    def cloud(self, depth: Depth, rgb: Image) -> Cloud:
        """Returns one point in the optical frame per pixel, in the order of the image.

        Args:
            depth: Depths, shape (height, width) [m]; the points of pixels without depth are NaN.
            rgb: Colours, shape (height, width, 3).
        """
        column, row = self.centre
        points = np.empty((self.height, self.width), POINT)
        points["x"] = depth * ((np.arange(self.width, dtype=np.float32) - column) / self.focal_length)
        points["y"] = depth * ((np.arange(self.height, dtype=np.float32) - row) / self.focal_length)[:, None]
        points["z"] = depth
        red, green, blue = (rgb[..., channel].astype(np.uint32) for channel in range(3))
        points["rgb"] = red << 16 | green << 8 | blue
        return points


@dataclass(frozen=True, slots=True)
class CameraTopics:
    """Topic names of a camera; topics with an empty name are not published.

    Attributes:
        image: Topic of the sensor_msgs/Image in rgb8.
        image_info: Topic of the image's sensor_msgs/CameraInfo.
        depth: Topic of the depth image, a sensor_msgs/Image in 32FC1 [m].
        depth_info: Topic of the depth image's sensor_msgs/CameraInfo.
        points: Topic of the sensor_msgs/PointCloud2 with colours.
    """

    image: str = ""
    image_info: str = ""
    depth: str = ""
    depth_info: str = ""
    points: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """Simulated camera.

    Attributes:
        name: Unique name of the camera.
        frame_id: Optical frame in message headers.
        parent: Entity that the camera is fixed to: "world", or "model::link".
        optical_in_parent: Pose of the optical frame in the parent's frame.
        rate_hz: Frame rate in simulated time [Hz].
        topics: Names of the published topics.
        pinhole: Projection of the images.
        depth_range: Minimum and maximum measured depth [m].
        noise: Noise of the colours, whose range is 0 to 1.
        seed: Random seed of the simulation.
    """

    name: str
    frame_id: str
    parent: str
    optical_in_parent: Pose
    rate_hz: float
    topics: CameraTopics
    pinhole: Pinhole = Pinhole()
    depth_range: tuple[float, float] = (0.0, math.inf)
    noise: Noise = NO_NOISE
    seed: int = 0

    def __post_init__(self) -> None:
        pinhole = self.pinhole
        bounds = (
            ("rate", self.rate_hz, 0.0, math.inf, "Hz"),
            ("width", pinhole.width, 0, 8192, "pixel"),
            ("height", pinhole.height, 0, 8192, "pixel"),
            ("horizontal_fov", pinhole.horizontal_fov, 0.0, math.pi, "rad"),
            ("near", pinhole.near, 0.0, pinhole.far, "m"),
            ("far", pinhole.far, pinhole.near, math.inf, "m"),
        )
        for key, value, low, high, unit in bounds:
            if not low < value < high:
                raise ValueError(f"{key}: got {value:g} {unit}; allowed: more than {low:g}, less than {high:g}")


@dataclass(frozen=True, slots=True)
class CameraImage:
    """Image of a camera.

    Attributes:
        rgb: Colours, shape (height, width, 3).
        depth: Depths, shape (height, width) [m]; NaN for empty pixels.
    """

    rgb: Image
    depth: Depth

    def with_depth_range(self, depth_range: tuple[float, float]) -> CameraImage:
        """Returns the same image without depths outside a range [m]."""
        low, high = depth_range
        with np.errstate(invalid="ignore"):
            in_range = (self.depth >= low) & (self.depth <= high)
        return CameraImage(self.rgb, np.where(in_range, self.depth, np.float32(np.nan)))

    def with_noise(self, source: NoiseSource, time_ns: int) -> CameraImage:
        """Returns the same image with noise on the colours.

        Args:
            source: Noise source of the camera, with one channel.
            time_ns: Simulated time of the image [ns].
        """
        if not source.active:
            return self
        noisy = source.add_noise(self.rgb.astype(np.float64)[None] / 255.0, time_ns)
        return CameraImage(np.rint(np.clip(noisy[0], 0.0, 1.0) * 255.0).astype(np.uint8), self.depth)
