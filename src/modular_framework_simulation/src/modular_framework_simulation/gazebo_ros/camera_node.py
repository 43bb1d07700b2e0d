# SPDX-License-Identifier: BSD-3-Clause
"""The process that draws and publishes what cameras see, beside the simulation, which starts it."""

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
"""Physics comes first where processors are scarce."""
_POLL_S = 0.1
"""How long a new subscriber may wait until the simulation knows of it [s]."""


class CameraPublisher:
    """The topics of one camera.

    Publishes: colour image, depth image and their camera_info, and point cloud, under the names in `CameraTopics`.

    Args:
        camera: The camera.

    Attributes:
        subscriptions: How many there have been so far.
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
    def draws(self) -> bool:
        """Whether somebody subscribes to what has to be drawn."""
        return any(_subscribed(each) for each in (self._image, self._depth, self._points))

    @property
    def wanted(self) -> bool:
        """Whether somebody subscribes to anything."""
        return self.draws or any(_subscribed(each) for each in self._infos)

    def publish(self, update: SceneUpdate, renderer: Renderer) -> None:
        """Draws and publishes what somebody subscribes to."""
        camera = self.camera
        head = camera_messages.header(camera.frame_id, update.time_ns)
        for info in self._infos:
            if _subscribed(info):
                info.publish(camera_messages.camera_info(camera.pinhole, head))
        if not self.draws:
            return
        image = renderer.image(camera.pinhole, update.cameras[camera.name]).within(camera.depth_range)
        image = image.with_noise(self._noise, update.time_ns)
        if _subscribed(self._image):
            self._image.publish(camera_messages.rgb_image(image, head))
        if _subscribed(self._depth):
            self._depth.publish(camera_messages.depth_image(image, head))
        if _subscribed(self._points):
            self._points.publish(camera_messages.point_cloud(camera.pinhole, image, head))

    def close(self) -> None:
        """Ends the topics."""
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


def _subscribed(publisher: Any) -> bool:
    return publisher is not None and publisher.get_num_connections() > 0


def replaced(publishers: list[CameraPublisher], cameras: tuple[Camera, ...]) -> list[CameraPublisher]:
    """Returns the publishers of other cameras; those of cameras that stay keep their subscribers."""
    kept = {each.camera.name: each for each in publishers if each.camera in cameras}
    for each in publishers:
        if each.camera.name not in kept:
            each.close()
    return [kept.get(camera.name) or CameraPublisher(camera) for camera in cameras]


def serve(pipe: Connection, drawing_name: str) -> None:
    """Draws what the simulation at the other end of a pipe asks for.

    It sends the cameras, whenever they change, updates of the scene, and None at the end. What draws is resolved with
    the first update, and set as the parameter ``~renderer`` of this node.

    Args:
        pipe: This end of the pipe.
        drawing_name: Parameter `~renderer` of the simulation.
    """
    publishers: list[CameraPublisher] = []
    renderer: Renderer | None = None
    done, reported = 0, SceneReport(0, {})
    while not rospy.is_shutdown():
        report = SceneReport(done, {each.camera.name: each.subscriptions for each in publishers if each.wanted})
        if report != reported:
            pipe.send(report)
            reported = report
        if not pipe.poll(_POLL_S):
            continue
        update: SceneUpdate | tuple[Camera, ...] | None = pipe.recv()
        if update is None:
            return
        if isinstance(update, tuple):
            publishers = replaced(publishers, update)
            continue
        if renderer is None:
            meshes = VisualMeshes(default_cache_folder())
            drawing = resolved_drawing(drawing_name)
            rospy.loginfo("cameras are drawn by the renderer '%s'", drawing.value)
            rospy.set_param("~renderer", drawing.value)  # for records of what drew the images
            renderer = Renderer(drawing, meshes, rospy.logwarn)
        renderer.apply(update)
        for each in publishers:
            if each.camera.name in update.cameras:
                each.publish(update, renderer)
        done += 1


def _keep_the_engine_off_the_terminal() -> None:
    """Leaves the terminal to Python: the engine and graphics drivers write to it from C++."""
    sys.stdout, sys.stderr = (os.fdopen(os.dup(stream), "w", buffering=1) for stream in (1, 2))
    with open(os.devnull, "w") as nothing:
        for stream in (1, 2):
            os.dup2(nothing.fileno(), stream)


def main() -> int:
    """Runs the node; arguments: number of the open file that leads to the simulation, renderer.

    Returns:
        Exit code: 0.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    _keep_the_engine_off_the_terminal()
    os.nice(_NICENESS)
    arguments = rospy.myargv(sys.argv)
    # Without simulated time: messages carry that of the simulation, and nothing here waits.
    rospy.init_node(ros_names.CAMERAS_NODE, disable_rostime=True)
    try:
        serve(Connection(int(arguments[1])), arguments[2])
    except (EOFError, ConnectionError):
        rospy.logdebug("the simulation has ended")
    return 0


if __name__ == "__main__":
    sys.exit(main())
