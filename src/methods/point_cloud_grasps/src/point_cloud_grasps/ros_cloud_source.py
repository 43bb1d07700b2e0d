# SPDX-License-Identifier: BSD-3-Clause
"""Receives one point cloud from a camera on demand, with the transforms at its time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import rospy
from sensor_msgs.msg import PointCloud2

from modular_framework_core.grasp_generation.grasp_candidates import NoCandidatesError
from modular_framework_core.grasp_generation.ros_fresh_messages import FreshMessages, NoMessageError
from modular_framework_core.grasp_generation.ros_transforms import Transforms
from modular_framework_ros.messages.point_clouds import PointCloudError, point_array

Array = npt.NDArray[np.float64]

TRANSFORM_TIMEOUT_S = 5.0
"""Maximum wait for the transforms at a cloud's time [s of real time]; only a failure takes as long."""
WARNING_PERIOD_S = 30.0


@dataclass(frozen=True, slots=True)
class SeenCloud:
    """A point cloud in the planning frame.

    Attributes:
        points: Finite points in the planning frame, shape (n, 3) [m].
        stamp: Time stamp of the message.
        frame: Frame of the camera.
    """

    points: Array
    stamp: rospy.Time
    frame: str


class CloudSource:
    """Receives point clouds; subscribes to the camera only while waiting.

    Subscribers: topic of the cloud (sensor_msgs/PointCloud2); permanently, the topics of :class:`Transforms`.
    """

    def __init__(self) -> None:
        """Creates the source without any subscription, see :meth:`connect`."""
        self._transforms = Transforms()
        self._messages = FreshMessages()

    def connect(self) -> None:
        """Subscribes to TF."""
        self._transforms.connect()

    def take(self, topic: str, frame: str, timeout_s: float) -> SeenCloud:
        """Waits for a cloud that is not older than this call, and transforms it to a frame.

        Args:
            topic: Topic of the cloud.
            frame: Target frame.
            timeout_s: Maximum wait [s of the ROS clock; s of real time without a publisher].

        Raises:
            NoCandidatesError: No usable cloud arrived in time; the message gives the reason.
        """
        message = self._message(topic, timeout_s)
        where = f"the cloud of topic '{rospy.resolve_name(topic)}'"
        try:
            points = point_array(message).reshape(-1, 3)
        except PointCloudError as error:
            raise NoCandidatesError(f"{where} cannot be read: {error}") from error
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            raise NoCandidatesError(
                f"{where} has no finite point among {message.width} x {message.height}; is the camera covered?"
            )
        header = message.header
        stamp = self._stamps(frame, [header.frame_id], header.stamp).get(header.frame_id)
        if stamp is None:
            raise NoCandidatesError(
                f"{where} is in frame '{header.frame_id}', which has no transform to '{frame}' at the cloud's time "
                f"{header.stamp.to_sec():.3f} s; frames of TF: "
                f"{', '.join(self._transforms.frames) or 'none'}"
            )
        transform = self._transforms.matrix(frame, header.frame_id, stamp)
        return SeenCloud(points @ transform[:3, :3].T + transform[:3, 3], header.stamp, header.frame_id)

    def link_poses(self, links: Sequence[str], frame: str, stamp: rospy.Time) -> dict[str, Array]:
        """Returns the pose (4, 4) of each link; missing links are logged and omitted.

        Args:
            links: Names of the links.
            frame: Target frame.
            stamp: Time of the poses.
        """
        stamps = self._stamps(frame, links, stamp)
        if missing := [link for link in links if link not in stamps]:
            rospy.logwarn_throttle(
                WARNING_PERIOD_S,
                f"{rospy.get_name()}: no transform from {', '.join(missing)} to '{frame}' at {stamp.to_sec():.3f} s; "
                "points on these links count as obstacles. Is robot_state_publisher running?",
            )
        return {link: self._transforms.matrix(frame, link, found_stamp) for link, found_stamp in stamps.items()}

    def _stamps(self, frame: str, sources: Sequence[str], stamp: rospy.Time) -> dict[str, rospy.Time]:
        return self._transforms.stamps(frame, sources, stamp, TRANSFORM_TIMEOUT_S)

    def _message(self, topic: str, timeout_s: float) -> PointCloud2:
        try:
            return self._messages.take({topic: PointCloud2}, timeout_s)[topic]
        except NoMessageError as error:
            raise NoCandidatesError(
                f"no point cloud arrived on topic '{error.topic}' within {timeout_s:g} s, "
                + (
                    f"from {error.publishers} publisher(s); is the camera running, and does it use the ROS clock?"
                    if error.publishers
                    else "nobody publishes it; start the camera, or set pointcloud_topic_name in sensors_config.yaml"
                )
            ) from error
