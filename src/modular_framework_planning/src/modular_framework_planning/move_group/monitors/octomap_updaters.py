# SPDX-License-Identifier: BSD-3-Clause
"""MoveIt's two octomap updaters, which insert depth images and point clouds into the octomap."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections import deque
from typing import Any, Protocol

import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField

from modular_framework_planning.errors import PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.perception.depth_images import (
    Pinhole,
    SeenPoints,
    cloud_array,
    depth_array,
    points_of_cloud,
    points_of_depth,
)
from modular_framework_planning.perception.self_filter import FilterMaker, depth_self_filter, self_filter_of
from modular_framework_planning.perception.sensor_settings import DepthImageSettings, PointCloudSettings, SensorSettings

FLOAT32 = np.dtype("<f4")


class InsertPointCloud(Protocol):
    """Inserts a point cloud into the map; see OctomapMonitor.insert_point_cloud."""

    def __call__(
        self, frame: str, stamp: rospy.Time, seen: SeenPoints, make_filter: FilterMaker, shadow: float = 0.0
    ) -> Array:
        """Returns whether each point lies on the robot or on a known object."""
        ...


class _Updater(ABC):
    """Processes messages in a separate thread; the oldest messages are dropped if the queue is full."""

    def __init__(self, settings: SensorSettings, insert: InsertPointCloud, queue_size: int) -> None:
        self._settings: Any = settings
        self._insert = insert
        self._messages: deque[Any] = deque(maxlen=queue_size)
        self._arrived = threading.Event()
        self._last_accepted = rospy.Time()
        self._filtered: Any = None

    def _connect(self, topic: str, kind: Any, filtered_kind: Any) -> None:
        if self._settings.filtered_cloud_topic:
            name = "/".join(part for part in (self._settings.ns, self._settings.filtered_cloud_topic) if part)
            self._filtered = rospy.Publisher(f"~{name}", filtered_kind, queue_size=2)
        rospy.Subscriber(topic, kind, self._enqueue, queue_size=2, buff_size=1 << 24)
        threading.Thread(target=self._run, name=f"octomap from {topic}", daemon=True).start()

    def _enqueue(self, message: Any) -> None:
        now = rospy.Time.now()
        rate = self._settings.max_update_rate
        if now < self._last_accepted:  # clock reset
            self._last_accepted = rospy.Time()
        if rate and (now - self._last_accepted).to_sec() <= 1.0 / rate:
            return
        self._last_accepted = now
        self._messages.append(message)
        self._arrived.set()

    def _run(self) -> None:
        while not rospy.is_shutdown():
            if not self._arrived.wait(0.2):
                continue
            self._arrived.clear()
            while self._messages:
                message = self._messages.popleft()
                try:
                    self._process(message)
                except PlanningError as error:
                    rospy.logwarn_throttle(5.0, "octomap: a sensor message is ignored: %s", error.reason)
                except rospy.ROSException as error:  # shutdown
                    rospy.logdebug("octomap: %s", error)

    @abstractmethod
    def _process(self, message: Any) -> None:
        """Inserts one message into the map."""


class PointCloudUpdater(_Updater):
    """Subscribes to a PointCloud2 and publishes the points that lie neither on the robot nor on known objects."""

    def __init__(self, settings: PointCloudSettings, insert: InsertPointCloud) -> None:
        super().__init__(settings, insert, 1)

    def connect(self) -> None:
        """Subscribes to the point cloud."""
        self._connect(self._settings.point_cloud_topic, PointCloud2, PointCloud2)

    def _process(self, message: PointCloud2) -> None:
        s = self._settings
        seen = points_of_cloud(cloud_array(message), s.max_range, s.point_subsample)
        on_known_body = self._insert(
            message.header.frame_id,
            message.header.stamp,
            seen,
            lambda regions, bodies, _: self_filter_of(regions, bodies, s.padding_scale, s.padding_offset),
        )
        if self._filtered is not None:
            self._filtered.publish(_cloud_message(message.header, seen.ends[~on_known_body]))


class DepthImageUpdater(_Updater):
    """Subscribes to a depth image and its camera_info; publishes the image with robot and known objects removed."""

    def __init__(self, settings: DepthImageSettings, insert: InsertPointCloud) -> None:
        super().__init__(settings, insert, settings.queue_size)
        self._camera: Pinhole | None = None

    def connect(self) -> None:
        """Subscribes to image and camera_info."""
        namespace = rospy.resolve_name(self._settings.image_topic).rsplit("/", 1)[0]
        rospy.Subscriber(f"{namespace}/camera_info", CameraInfo, self._on_info, queue_size=1)
        self._connect(self._settings.image_topic, Image, Image)

    def _on_info(self, message: CameraInfo) -> None:
        try:
            self._camera = Pinhole(message.K[0], message.K[4], message.K[2], message.K[5])
        except PlanningError as error:
            rospy.logwarn_throttle(5.0, "octomap: %s", error.reason)

    def _process(self, message: Image) -> None:
        s = self._settings
        if self._camera is None:
            rospy.logwarn_throttle(
                5.0,
                "octomap: no valid camera_info for '%s' yet; images are ignored",
                rospy.resolve_name(s.image_topic),
            )
            return
        depth = depth_array(
            message.data, message.encoding, (message.height, message.width), message.step, bool(message.is_bigendian)
        )
        seen = points_of_depth(
            depth,
            self._camera,
            s.near_clipping_plane_distance,
            s.far_clipping_plane_distance,
            (s.skip_vertical_pixels, s.skip_horizontal_pixels),
        )
        on_known_body = self._insert(
            message.header.frame_id,
            message.header.stamp,
            seen,
            lambda regions, bodies, origin: depth_self_filter(
                regions, bodies, origin, s.padding_scale, s.padding_offset
            ),
            s.shadow_threshold,
        )
        if self._filtered is not None:
            filtered = np.zeros(depth.size)
            kept_pixels = seen.pixels[~on_known_body]
            filtered[kept_pixels] = depth.ravel()[kept_pixels]
            data = np.clip(np.round(filtered * 1000.0), 0, 65535).astype("<u2").tobytes()
            self._filtered.publish(
                Image(
                    header=message.header,
                    height=message.height,
                    width=message.width,
                    encoding="16UC1",
                    step=2 * message.width,
                    data=data,
                )
            )


def _cloud_message(header: Any, points: Any) -> PointCloud2:
    fields = [PointField(name, 4 * index, PointField.FLOAT32, 1) for index, name in enumerate("xyz")]
    data = np.ascontiguousarray(points, dtype=FLOAT32).tobytes()
    return PointCloud2(
        header=header,
        height=1,
        width=len(points),
        fields=fields,
        point_step=12,
        row_step=12 * len(points),
        data=data,
        is_dense=True,
    )


def updater_of(settings: SensorSettings, insert: InsertPointCloud) -> PointCloudUpdater | DepthImageUpdater:
    """Returns the updater of a sensor."""
    match settings:
        case PointCloudSettings():
            return PointCloudUpdater(settings, insert)
        case DepthImageSettings():
            return DepthImageUpdater(settings, insert)
