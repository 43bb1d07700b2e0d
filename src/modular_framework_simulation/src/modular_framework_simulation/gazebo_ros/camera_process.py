# SPDX-License-Identifier: BSD-3-Clause
"""The simulation's end of the cameras: sends what changed to the process that draws, when somebody subscribes."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from multiprocessing import Pipe
from multiprocessing.connection import Connection

import rospy

from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.physics.physics_world import WORLD_FRAMES, PhysicsWorld
from modular_framework_simulation.physics.robot_body import RobotBody
from modular_framework_simulation.sensors.camera_config import read_cameras
from modular_framework_simulation.sensors.cameras import Camera
from modular_framework_simulation.sensors.robot_visuals import read_robot_visuals
from modular_framework_simulation.sensors.urdf_cameras import read_urdf_cameras
from modular_framework_simulation.sensors.visible_scene import LinkVisuals, SceneReport, SceneTracker
from modular_framework_urdf.mesh_paths import PackageFinder

_END_TIMEOUT_S = 5.0


class CameraProcess:
    """Cameras that are drawn in another process.

    Physics never waits for it: while an image is drawn, no other is asked for, and the next one is late. A new
    subscriber gets an image of now, also while time stands still.

    Args:
        cameras: The cameras; without any, no process is started.
        tracker: Describes what they see.
    """

    def __init__(self, cameras: Sequence[Camera], tracker: SceneTracker) -> None:
        self._cameras = {camera.name: camera for camera in cameras}
        self._tracker = tracker
        self._due_ns = dict.fromkeys(self._cameras, 0)
        self._sent = 0
        self._report = SceneReport(0, {})
        self._process: subprocess.Popen[bytes] | None = None
        self._pipe: Connection | None = None

    def connect(self) -> None:
        """Starts the process."""
        if not self._cameras:
            return
        self._pipe, other_end = Pipe()
        remappings = [each for each in sys.argv[1:] if ":=" in each and not each.startswith("__")]
        command = [sys.executable, "-m", "modular_framework_simulation.gazebo_ros.camera_node", str(other_end.fileno())]
        name = f"__name:={ros_names.CAMERAS_NODE}"
        self._process = subprocess.Popen([*command, name, *remappings], pass_fds=[other_end.fileno()])
        other_end.close()
        self._pipe.send(tuple(self._cameras.values()))
        threading.Thread(target=self._listen, args=(self._pipe, self._process), name="cameras", daemon=True).start()
        for camera in self._cameras.values():
            rospy.loginfo(
                "camera '%s' on '%s': %d x %d at %g Hz", camera.name, camera.parent, camera.pinhole.width,
                camera.pinhole.height, camera.rate_hz,
            )  # fmt: skip

    def _listen(self, pipe: Connection, process: subprocess.Popen[bytes]) -> None:
        try:
            while True:
                before, self._report = self._report, pipe.recv()
                for name, subscriptions in self._report.wanted.items():
                    if subscriptions > before.wanted.get(name, 0):
                        self._due_ns[name] = 0
        except (EOFError, OSError):
            self._report = SceneReport(0, {})
        if self._pipe is not None and not rospy.is_shutdown():
            code = process.wait()
            rospy.logerr("the process that draws what cameras see ended with code %d: cameras are silent now", code)

    def tick(self, time_ns: int) -> None:
        """Asks for the images that are due and have a subscriber; called by the loop's thread.

        Args:
            time_ns: Simulated time [ns].
        """
        report = self._report
        if not report.wanted or report.images < self._sent or self._pipe is None:
            return
        due = [self._cameras[name] for name in report.wanted if self._is_due(name, time_ns)]
        if due:
            self._sent += 1
            try:
                self._pipe.send(self._tracker.update(due))
            except OSError:
                self._report = SceneReport(0, {})

    def _is_due(self, name: str, time_ns: int) -> bool:
        period_ns = round(1e9 / self._cameras[name].rate_hz)
        due_ns = self._due_ns[name]
        if due_ns - period_ns > time_ns:  # the clock went back
            due_ns = time_ns
        if time_ns < due_ns:
            return False
        behind = time_ns - due_ns >= period_ns
        self._due_ns[name] = (time_ns if behind else due_ns) + period_ns
        return True

    def close(self) -> None:
        """Ends the process; may be called twice."""
        pipe, self._pipe = self._pipe, None
        if pipe is None or self._process is None:
            return
        with contextlib.suppress(OSError):  # it has ended before
            pipe.send(None)
        try:
            self._process.wait(_END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def simulated_cameras(
    world: PhysicsWorld, robot: RobotBody | None, description: str, find_package: PackageFinder
) -> CameraProcess:
    """Reads the cameras of parameter `~sensors` (a `sensors_config.yaml`) and of the robot's description.

    Args:
        world: What is seen.
        robot: The robot, if there is one.
        description: Its URDF.
        find_package: Looks up the packages of package:// URIs.
    """
    name = robot.body.name if robot is not None else ""

    def locate(frame: str) -> str | None:
        if frame in WORLD_FRAMES:
            return ros_names.WORLD_FRAME
        return f"{name}::{frame}" if robot is not None and frame in robot.body.link_indices else None

    settings = rospy.get_param("~sensors", {})
    where = rospy.resolve_name("~sensors")
    if not isinstance(settings, Mapping):
        rospy.logwarn("parameter %s: got %r; expected the contents of a sensors_config.yaml", where, settings)
        settings = {}
    cameras, faults = read_cameras(settings, f"parameter {where}", locate)
    visuals: dict[str, LinkVisuals] = {}
    if robot is not None:
        more, more_faults = read_urdf_cameras(description, name)
        cameras, faults = cameras + more, faults + more_faults
        if cameras:
            visuals[name] = read_robot_visuals(description, find_package, rospy.logwarn)
    for fault in faults:
        rospy.logwarn(fault)
    return CameraProcess(cameras, SceneTracker(world, visuals))
