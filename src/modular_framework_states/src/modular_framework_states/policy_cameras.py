# SPDX-License-Identifier: BSD-3-Clause
"""Receives the camera images of a policy's observation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from sensor_msgs.msg import Image

from mbf_method.observation import CameraImages
from modular_framework_core.grasp_generation.ros_fresh_messages import FreshMessages, NoMessageError
from modular_framework_ros.messages.camera_images import colour_array, depth_array


class PolicyCameraError(RuntimeError):
    """A camera image is missing or unusable; the message gives the reason."""


class PolicyCameras:
    """Subscribes to the images of named cameras while waiting.

    Subscribers: all topics (sensor_msgs/Image).

    Args:
        colour_topics: Topics of the colour images, keyed by camera name.
        depth_topics: Topics of the depth images, keyed by camera name.
    """

    def __init__(self, colour_topics: Mapping[str, str], depth_topics: Mapping[str, str]) -> None:
        self._colour_topics, self._depth_topics = dict(colour_topics), dict(depth_topics)
        self._messages = FreshMessages()

    def take(self, timeout_s: float) -> dict[str, CameraImages]:
        """Waits for images that are not older than this call; the images of a camera have equal stamps.

        Args:
            timeout_s: Maximum wait per camera [s of the ROS clock; s of real time without a publisher].

        Raises:
            PolicyCameraError: An image does not arrive in time, or its encoding is unsuitable.
        """
        names = sorted({*self._colour_topics, *self._depth_topics})
        return {name: self._images(name, timeout_s) for name in names}

    def _images(self, name: str, timeout_s: float) -> CameraImages:
        colour_topic, depth_topic = self._colour_topics.get(name, ""), self._depth_topics.get(name, "")
        topics = [topic for topic in (colour_topic, depth_topic) if topic]
        try:
            messages = self._messages.take(dict.fromkeys(topics, Image), timeout_s)
            colour = colour_array(messages[colour_topic]) if colour_topic else np.zeros((0, 0, 3), np.uint8)
            depth = depth_array(messages[depth_topic]) if depth_topic else np.zeros((0, 0), np.float32)
        except NoMessageError as error:
            raise PolicyCameraError(f"camera '{name}': {error} within {timeout_s:g} s; start the camera") from error
        except ValueError as error:
            raise PolicyCameraError(f"camera '{name}': an image of {topics} cannot be used: {error}") from error
        return CameraImages(colour, depth)
