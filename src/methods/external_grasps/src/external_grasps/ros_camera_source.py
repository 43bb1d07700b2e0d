# SPDX-License-Identifier: BSD-3-Clause
"""Receives camera images on demand, with the matrix and the pose of the camera."""

from __future__ import annotations

import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, Image

from mbf_method.grasp_request import CameraView
from modular_framework_core.grasp_generation.grasp_candidates import NoCandidatesError
from modular_framework_core.grasp_generation.ros_fresh_messages import FreshMessages, NoMessageError
from modular_framework_core.grasp_generation.ros_transforms import Transforms
from modular_framework_ros.messages.camera_images import colour_array, depth_array

DEPTH_PARAMETER, COLOUR_PARAMETER = "depth_image_topic_name", "rgb_image_topic_name"
"""Parameters of sensors_config.yaml with the topics of a camera."""
TRANSFORM_TIMEOUT_S = 5.0
"""Maximum wait for the transform at the time of an image [s of real time]; only a failure takes this long."""


class CameraSource:
    """Receives images; subscribes to the camera only while waiting.

    Parameters: ``depth_image_topic_name``, ``rgb_image_topic_name``.
    Subscribers, while waiting: both image topics (sensor_msgs/Image) and ``camera_info`` in the namespace of the depth
        image (sensor_msgs/CameraInfo). Permanent subscribers: those of :class:`Transforms`.
    """

    def __init__(self) -> None:
        """Creates the source without subscriptions; :meth:`connect` subscribes to TF."""
        self._transforms = Transforms()
        self._messages = FreshMessages()
        self._is_connected = False

    def connect(self) -> None:
        """Subscribes to TF; a second call has no effect."""
        if not self._is_connected:
            self._is_connected = True
            self._transforms.connect()

    def take(self, frame: str, timeout_s: float) -> CameraView:
        """Waits for images with equal stamps that are not older than this call.

        Args:
            frame: Frame of the camera's pose.
            timeout_s: Maximum wait [s of the ROS clock; s of real time without a publisher].

        Raises:
            NoCandidatesError: No usable images arrived in time; the message gives the reason.
        """
        depth_topic, colour_topic = (_topic(name) for name in (DEPTH_PARAMETER, COLOUR_PARAMETER))
        info_topic = f"{depth_topic.rpartition('/')[0]}/camera_info"
        try:
            messages = self._messages.take({depth_topic: Image, colour_topic: Image, info_topic: CameraInfo}, timeout_s)
        except NoMessageError as error:
            raise NoCandidatesError(
                f"{error} with the stamp of the other images within {timeout_s:g} s; start the camera, or correct "
                f"{DEPTH_PARAMETER} and {COLOUR_PARAMETER} in sensors_config.yaml"
            ) from error
        depth_image, colour_image = messages[depth_topic], messages[colour_topic]
        try:
            depth, colour = depth_array(depth_image), colour_array(colour_image)
        except ValueError as error:
            raise NoCandidatesError(
                f"an image of '{depth_topic}' or '{colour_topic}' cannot be read: {error}"
            ) from error
        if depth.shape != colour.shape[:2]:
            raise NoCandidatesError(
                f"'{depth_topic}' has {depth.shape} pixels and '{colour_topic}' {colour.shape[:2]}; "
                "they must be registered"
            )
        return CameraView(depth, colour, np.array(messages[info_topic].K).reshape(3, 3), self._pose(depth_image, frame))

    def _pose(self, image: Image, frame: str) -> np.ndarray:
        header = image.header
        stamps = self._transforms.stamps(frame, [header.frame_id], header.stamp, TRANSFORM_TIMEOUT_S)
        if header.frame_id not in stamps:
            raise NoCandidatesError(
                f"the depth image is in frame '{header.frame_id}', which has no transform to '{frame}' at its time "
                f"{header.stamp.to_sec():.3f} s; frames of TF: {', '.join(self._transforms.frames) or 'none'}"
            )
        return self._transforms.matrix(frame, header.frame_id, stamps[header.frame_id])


def _topic(parameter: str) -> str:
    topic = str(rospy.get_param(parameter, ""))
    if not topic:
        raise NoCandidatesError(f"the method needs a camera; set parameter '{rospy.resolve_name(parameter)}'")
    return topic
