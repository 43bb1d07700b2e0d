# SPDX-License-Identifier: BSD-3-Clause
"""Takes one point cloud from a camera when it is needed, with the transforms of its time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import rospy
import tf2_ros
import yaml
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2

from modular_framework_core.grasp_generation.grasp_candidates import NoCandidatesError
from modular_framework_ros.calls import wait_until
from modular_framework_ros.point_clouds import PointCloudError, point_array
from modular_framework_ros.simulated_time import SimulatedTime

Array = npt.NDArray[np.float64]

CONNECTION_TIMEOUT_S = 1.0
CAMERA_PERIOD_S, ANSWER_S = 0.1, 0.5
"""Where nodes hold simulated time: so much of it passes for an image, and so long is then waited for the message."""
TRANSFORM_TIMEOUT_S, WARNING_PERIOD_S = 2.0, 30.0
BUFFER_BYTES = 1 << 25


@dataclass(frozen=True, slots=True)
class SeenCloud:
    """What a camera saw.

    Attributes:
        points: (n, 3) in the planning frame, all finite [m].
        stamp: When.
        frame: The camera's frame.
    """

    points: Array
    stamp: rospy.Time
    frame: str


class CloudSource:
    """Takes point clouds; subscribes to the camera only while it waits for one, since a camera draws for subscribers.

    Subscribers: the topic of the cloud (sensor_msgs/PointCloud2), ``tf`` and ``tf_static`` from the first cloud on.
    """

    def __init__(self) -> None:
        """Connects to nothing yet."""
        self._transforms: Any = None
        self._time = SimulatedTime()

    def take(self, topic: str, frame: str, timeout_s: float) -> SeenCloud:
        """Waits for a cloud that is not older than this call, and brings it to a frame.

        Args:
            topic: Topic of the cloud.
            frame: Frame of the result.
            timeout_s: Longest wait [s of real time].

        Raises:
            NoCandidatesError: There is none in time, or it cannot be used; the text says why.
            CallError: The simulation does not let its time pass.
        """
        if self._transforms is None:
            self._transforms = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(self._transforms)
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
        if not self._await(lambda: self._can_transform(frame, header.frame_id, header.stamp), TRANSFORM_TIMEOUT_S):
            raise NoCandidatesError(
                f"{where} is in frame '{header.frame_id}', which has no transform to '{frame}' at the cloud's time "
                f"{header.stamp.to_sec():.3f} s, waited for {TRANSFORM_TIMEOUT_S:g} s; frames of TF: "
                f"{', '.join(sorted(yaml.safe_load(self._transforms.all_frames_as_yaml()) or [])) or 'none'}"
            )
        transform = self._matrix(frame, header.frame_id, header.stamp)
        return SeenCloud(points @ transform[:3, :3].T + transform[:3, 3], header.stamp, header.frame_id)

    def link_poses(self, links: Iterable[str], frame: str, stamp: rospy.Time) -> dict[str, Array]:
        """Returns the pose (4, 4) of each link in a frame at a time; a link without one is left out, and logged."""
        links = list(links)
        known = [link for link in links if self._can_transform(frame, link, rospy.Time(0))]
        self._await(lambda: all(self._can_transform(frame, link, stamp) for link in known), TRANSFORM_TIMEOUT_S)
        found = {link: self._matrix(frame, link, stamp) for link in known if self._can_transform(frame, link, stamp)}
        if missing := [link for link in links if link not in found]:
            rospy.logwarn_throttle(
                WARNING_PERIOD_S,
                f"{rospy.get_name()}: no transform from {', '.join(missing)} to '{frame}' at {stamp.to_sec():.3f} s; "
                "points on these links count as obstacles. Is robot_state_publisher running?",
            )
        return found

    def _message(self, topic: str, timeout_s: float) -> PointCloud2:
        """Returns the first message that shows the world as it is now, or later."""
        begun, messages = rospy.Time.now(), []

        def keep(message: PointCloud2) -> None:
            if message.header.stamp >= begun or message.header.stamp.is_zero():
                messages.append(message)

        subscriber = rospy.Subscriber(topic, PointCloud2, keep, queue_size=1, buff_size=BUFFER_BYTES)
        try:
            wait_until(lambda: subscriber.get_num_connections() > 0, min(CONNECTION_TIMEOUT_S, timeout_s))
            if not self._await(lambda: bool(messages), timeout_s):
                published = subscriber.get_num_connections()
                raise NoCandidatesError(
                    f"no point cloud arrived on topic '{subscriber.resolved_name}' within {timeout_s:g} s, "
                    + (
                        f"from {published} publisher(s); is the camera running and its clock the one of ROS?"
                        if published
                        else "nobody publishes it; start the camera, or set pointcloud_topic_name in "
                        "sensors_config.yaml"
                    )
                )
        finally:
            subscriber.unregister()
        return messages[0]

    def _await(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Waits for a condition [real time]; where nodes hold simulated time, lets it pass by steps."""
        deadline = time.monotonic() + timeout_s
        while not condition():
            left_s = deadline - time.monotonic()
            if left_s <= 0.0 or rospy.is_shutdown():
                return False
            if self._time.enabled:
                self._time.sleep(CAMERA_PERIOD_S)
            wait_until(condition, min(left_s, ANSWER_S))
        return True

    def _can_transform(self, frame: str, other: str, stamp: rospy.Time) -> bool:
        return bool(self._transforms.can_transform(frame, other, stamp))

    def _matrix(self, frame: str, other: str, stamp: rospy.Time) -> Array:
        """Returns the transform (4, 4) from another frame to a frame at a time."""
        found = self._transforms.lookup_transform(frame, other, stamp).transform
        matrix = np.eye(4)
        turn, at = found.rotation, found.translation
        matrix[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
        matrix[:3, 3] = at.x, at.y, at.z
        return matrix
