# SPDX-License-Identifier: BSD-3-Clause
"""Simulated cameras: where they are, what they see, and the geometry of a pinhole.

An optical frame has z forwards, x to the right and y downwards in the image (REP 103).
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

_NOTHING = 1.0 - 1e-6
"""Depth in OpenGL's buffer from which on nothing is seen; TinyRenderer's empty pixels have not quite 1."""
POINT = np.dtype({"names": ["x", "y", "z", "rgb"], "formats": ["<f4", "<f4", "<f4", "<u4"]})
"""A point of a cloud: position [m], and colour as 0x00RRGGBB."""


@dataclass(frozen=True, slots=True)
class Pinhole:
    """The geometry of an image; the centre of the first pixel is at (0, 0), and pixels are square.

    Attributes:
        width: [pixel]
        height: [pixel]
        horizontal_fov: Angle between the left and the right edge of the image [rad].
        near: Depth of the nearest surface that is seen [m].
        far: Depth of the farthest [m].
    """

    width: int = 640
    height: int = 480
    horizontal_fov: float = math.pi / 3
    near: float = 0.05
    far: float = 10.0

    @property
    def focal_length(self) -> float:
        """Distance from the lens to the image [pixel]."""
        return self.width / (2 * math.tan(self.horizontal_fov / 2))

    @property
    def centre(self) -> tuple[float, float]:
        """Where the optical axis meets the image [pixel]: column and row."""
        return (self.width - 1) / 2, (self.height - 1) / 2

    def intrinsics(self) -> tuple[float, ...]:
        """Returns the matrix K of the camera, row by row [pixel]."""
        (column, row), focal = self.centre, self.focal_length
        return (focal, 0.0, column, 0.0, focal, row, 0.0, 0.0, 1.0)

    def opengl_projection(self, shift: tuple[float, float] = (0.0, 0.0)) -> tuple[float, ...]:
        """Returns OpenGL's projection matrix, column by column.

        Args:
            shift: What the image is moved by, right and down [pixel].
        """
        focal, near, far = self.focal_length, self.near, self.far
        column_1 = (2 * focal / self.width, 0.0, 0.0, 0.0)
        column_2 = (0.0, 2 * focal / self.height, 0.0, 0.0)
        column_3 = (-2 * shift[0] / self.width, 2 * shift[1] / self.height, (near + far) / (near - far), -1.0)
        return (*column_1, *column_2, *column_3, 0.0, 0.0, 2 * near * far / (near - far), 0.0)

    def depth_from_buffer(self, values: npt.NDArray[np.float32]) -> Depth:
        """Converts OpenGL's depth, from 0 at `near` to 1 at `far`, to metres along the optical axis.

        Returns:
            Depth [m]; not a number where nothing is seen.
        """
        buffer = values.astype(np.float64)
        depth = self.far * self.near / (self.far - (self.far - self.near) * buffer)
        depth[buffer >= _NOTHING] = np.nan
        return depth.astype(np.float32)

    def cloud(self, depth: Depth, rgb: Image) -> Cloud:
        """Returns a point in the optical frame for every pixel, in the order of the image.

        Args:
            depth: (height, width) [m]; the points of pixels without depth are not numbers.
            rgb: (height, width, 3)
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
    """Names of topics; an empty one is not published.

    Attributes:
        image: sensor_msgs/Image, rgb8.
        image_info: sensor_msgs/CameraInfo of the image.
        depth: sensor_msgs/Image, 32FC1 [m].
        depth_info: sensor_msgs/CameraInfo of the depth image.
        points: sensor_msgs/PointCloud2 with colours.
    """

    image: str = ""
    image_info: str = ""
    depth: str = ""
    depth_info: str = ""
    points: str = ""


@dataclass(frozen=True, slots=True)
class Camera:
    """A simulated camera.

    Attributes:
        name: Differs from camera to camera.
        frame_id: Its optical frame, for the headers of its messages.
        parent: What it is fastened to: "world", or "model::link".
        optical_in_parent: Pose of the optical frame in the frame of the parent.
        rate_hz: Images in a second of simulated time.
        topics: Where it publishes.
        pinhole: The geometry of its images.
        depth_range: Least and greatest depth that is measured [m].
        noise: Of the colours, whose range is 0 to 1.
        seed: Of the simulation.
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
    """What a camera saw.

    Attributes:
        rgb: (height, width, 3)
        depth: (height, width) [m]; not a number where it saw nothing.
    """

    rgb: Image
    depth: Depth

    def within(self, depth_range: tuple[float, float]) -> CameraImage:
        """Returns the same image without depth outside a range [m]."""
        low, high = depth_range
        with np.errstate(invalid="ignore"):
            kept = (self.depth >= low) & (self.depth <= high)
        return CameraImage(self.rgb, np.where(kept, self.depth, np.float32(np.nan)))

    def with_noise(self, source: NoiseSource, time_ns: int) -> CameraImage:
        """Returns the same image with noise on its colours.

        Args:
            source: The noise of the camera, of one channel.
            time_ns: When it was taken [ns].
        """
        if not source.active:
            return self
        noisy = source.added_to(self.rgb.astype(np.float64)[None] / 255.0, time_ns)
        return CameraImage(np.rint(np.clip(noisy[0], 0.0, 1.0) * 255.0).astype(np.uint8), self.depth)
