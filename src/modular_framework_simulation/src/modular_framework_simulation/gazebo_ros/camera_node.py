# SPDX-License-Identifier: BSD-3-Clause
"""Process that renders and publishes camera images; started by the simulation."""

from __future__ import annotations

import os
import signal
import sys
from multiprocessing.connection import Connection
from typing import Any

import rospy
from sensor_msgs.msg import CameraInfo, Image, PointCloud2

from modular_framework_simulation.gazebo_ros import camera_messages, ros_names
from modular_framework_simulation.models.mesh_files import default_cache_folder
from modular_framework_simulation.models.visual_meshes import VisualMeshes
from modular_framework_simulation.sensors.cameras import Camera
from modular_framework_simulation.sensors.drawing_choice import resolved_drawing
from modular_framework_simulation.sensors.noise import NoiseSource
from modular_framework_simulation.sensors.renderer import Renderer
from modular_framework_simulation.sensors.visible_scene import SceneReport, SceneUpdate

_NICENESS = 5
"""Lower priority than physics on a busy CPU."""
_POLL_S = 0.1
"""Maximum delay until the simulation knows a new subscriber [s]."""


class CameraPublisher:
    """Publishes the topics of one camera.

    Publishes: colour image, depth image, their camera_info, and point cloud, with the names in `CameraTopics`.

    Args:
        camera: The camera.

    Attributes:
        subscriptions: Total number of subscriptions so far.
    """

    def __init__(self, camera: Camera) -> None:
        self.camera, self.subscriptions = camera, 0
        self._noise = NoiseSource(camera.seed, camera.name, (camera.noise,))
        topics = camera.topics
        self._image = self._publisher(topics.image, Image)
        self._depth = self._publisher(topics.depth, Image)
        self._points = self._publisher(topics.points, PointCloud2)
        self._infos = [self._publisher(name, CameraInfo) for name in {topics.image_info, topics.depth_info}]

    def _publisher(self, topic: str, kind: type) -> Any:
        return rospy.Publisher(topic, kind, queue_size=1, subscriber_listener=_Counter(self)) if topic else None

    @property
    def needs_image(self) -> bool:
        """Returns whether an image topic has a subscriber."""
        return any(_has_subscribers(each) for each in (self._image, self._depth, self._points))

    @property
    def has_subscribers(self) -> bool:
        """Returns whether any topic has a subscriber."""
        return self.needs_image or any(_has_subscribers(each) for each in self._infos)

    def publish(self, update: SceneUpdate, renderer: Renderer) -> None:
        """Renders an image, and publishes the topics with subscribers."""
        camera = self.camera
        message_header = camera_messages.header(camera.frame_id, update.time_ns)
        for info in self._infos:
            if _has_subscribers(info):
                info.publish(camera_messages.camera_info(camera.pinhole, message_header))
        if not self.needs_image:
            return
        image = renderer.image(camera.pinhole, update.cameras[camera.name]).with_depth_range(camera.depth_range)
        image = image.with_noise(self._noise, update.time_ns)
        if _has_subscribers(self._image):
            self._image.publish(camera_messages.rgb_image(image, message_header))
        if _has_subscribers(self._depth):
            self._depth.publish(camera_messages.depth_image(image, message_header))
        if _has_subscribers(self._points):
            self._points.publish(camera_messages.point_cloud(camera.pinhole, image, message_header))

    def close(self) -> None:
        """Closes the topics."""
        for publisher in (self._image, self._depth, self._points, *self._infos):
            if publisher is not None:
                publisher.unregister()


class _Counter(rospy.SubscribeListener):
    """Counts the subscriptions of a camera; called by rospy."""

    def __init__(self, counted: CameraPublisher) -> None:
        super().__init__()
        self._counted = counted

    def peer_subscribe(self, *_: Any) -> None:
        self._counted.subscriptions += 1


def _has_subscribers(publisher: Any) -> bool:
    return publisher is not None and publisher.get_num_connections() > 0


def updated_publishers(publishers: list[CameraPublisher], cameras: tuple[Camera, ...]) -> list[CameraPublisher]:
    """Returns publishers for new cameras; publishers of unchanged cameras are kept with their subscribers."""
    unchanged = {each.camera.name: each for each in publishers if each.camera in cameras}
    for each in publishers:
        if each.camera.name not in unchanged:
            each.close()
    return [unchanged.get(camera.name) or CameraPublisher(camera) for camera in cameras]


def serve(pipe: Connection, drawing_name: str) -> None:
    """Renders the images that the simulation requests through a pipe.

    The simulation sends the cameras after every change, updates of the scene, and None at the end. The first update
    selects the renderer, which is set as the parameter ``~renderer`` of this node.

    Args:
        pipe: End of the pipe.
        drawing_name: Parameter `~renderer` of the simulation.
    """
    publishers: list[CameraPublisher] = []
    renderer: Renderer | None = None
    images_done, last_report = 0, SceneReport(0, {})
    while not rospy.is_shutdown():
        report = SceneReport(
            images_done, {each.camera.name: each.subscriptions for each in publishers if each.has_subscribers}
        )
        if report != last_report:
            pipe.send(report)
            last_report = report
        if not pipe.poll(_POLL_S):
            continue
        update: SceneUpdate | tuple[Camera, ...] | None = pipe.recv()
        if update is None:
            return
        if isinstance(update, tuple):
            publishers = updated_publishers(publishers, update)
            continue
        if renderer is None:
            meshes = VisualMeshes(default_cache_folder())
            drawing = resolved_drawing(drawing_name)
            rospy.loginfo("cameras use the renderer '%s'", drawing.value)
            rospy.set_param("~renderer", drawing.value)  # for the records of an experiment
            renderer = Renderer(drawing, meshes, rospy.logwarn)
        renderer.apply(update)
        for each in publishers:
            if each.camera.name in update.cameras:
                each.publish(update, renderer)
        images_done += 1


def _silence_native_output() -> None:
    """Discards terminal output of the engine and of graphics drivers in C++, and keeps Python's output."""
    sys.stdout, sys.stderr = (os.fdopen(os.dup(stream), "w", buffering=1) for stream in (1, 2))
    with open(os.devnull, "w") as devnull:
        for stream in (1, 2):
            os.dup2(devnull.fileno(), stream)


def main() -> int:
    """Runs the node; its arguments are the file descriptor of the pipe and the renderer.

    Returns:
        Exit code: 0.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    _silence_native_output()
    os.nice(_NICENESS)
    arguments = rospy.myargv(sys.argv)
    # Simulated time is not needed, because the simulation sends the times of messages.
    rospy.init_node(ros_names.CAMERAS_NODE, disable_rostime=True)
    try:
        serve(Connection(int(arguments[1])), arguments[2])
    except (EOFError, ConnectionError):
        rospy.logdebug("the simulation has ended")
    return 0


if __name__ == "__main__":
    sys.exit(main())
