# SPDX-License-Identifier: BSD-3-Clause
"""Controls the process that renders cameras: sends changes of the scene while a camera has subscribers."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

import rospy

from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.physics.physics_world import WORLD_FRAMES
from modular_framework_simulation.physics.robot_body import RobotBody
from modular_framework_simulation.sensors.camera_config import read_cameras
from modular_framework_simulation.sensors.cameras import Camera
from modular_framework_simulation.sensors.visible_scene import SceneReport, SceneTracker

_END_TIMEOUT_S = 5.0


class CameraProcess:
    """Runs the cameras in another process, which starts with the first camera.

    The physics never waits for the process: while an image is rendered, no other image is requested, so the next image
    may be late. A new subscriber gets an image of the current state, even while time is stopped.

    Args:
        make_tracker: Function that creates the scene tracker; called for the first camera.
        fixed: Cameras of the parameter `~sensors`, which are never removed.
        renderer: Value of the parameter `~renderer`.
    """

    def __init__(self, make_tracker: Callable[[], SceneTracker], fixed: Sequence[Camera], renderer: str) -> None:
        self._make_tracker, self._renderer = make_tracker, renderer
        self._tracker: SceneTracker | None = None
        self._fixed = tuple(fixed)
        self._cameras = {camera.name: camera for camera in fixed}
        self._due_ns: dict[str, int] = {}
        self._sent = 0
        self._report = SceneReport(0, {})
        self._process: subprocess.Popen[bytes] | None = None
        self._pipe: Connection | None = None
        self._connected = False
        self._ending = threading.Event()

    def connect(self) -> None:
        """Starts the process, immediately or with the first camera."""
        self._connected = True
        rospy.on_shutdown(self._ending.set)
        if not self._cameras:
            return
        self._tracker = self._make_tracker()
        self._pipe, other_end = Pipe()
        remappings = [each for each in sys.argv[1:] if ":=" in each and not each.startswith("__")]
        command = [sys.executable, "-m", "modular_framework_simulation.gazebo_ros.camera_node"]
        arguments = [str(other_end.fileno()), self._renderer, f"__name:={ros_names.CAMERAS_NODE}", *remappings]
        self._process = subprocess.Popen([*command, *arguments], pass_fds=[other_end.fileno()])
        other_end.close()
        threading.Thread(target=self._listen, args=(self._pipe, self._process), name="cameras", daemon=True).start()
        self._send_cameras(self._pipe)

    def _send_cameras(self, pipe: Connection) -> None:
        pipe.send(tuple(self._cameras.values()))
        for camera in self._cameras.values():
            if camera.name not in self._due_ns:
                self._due_ns[camera.name] = 0
                rospy.loginfo(
                    "camera '%s' on '%s': %d x %d at %g Hz", camera.name, camera.parent, camera.pinhole.width,
                    camera.pinhole.height, camera.rate_hz,
                )  # fmt: skip

    def set_cameras(self, cameras: Sequence[Camera]) -> None:
        """Sets the cameras of all models, which are added and removed; called by the loop's thread.

        Args:
            cameras: All cameras except the fixed cameras.
        """
        new_cameras = {camera.name: camera for camera in (*self._fixed, *cameras)}
        if new_cameras == self._cameras:
            return
        self._cameras = new_cameras
        self._due_ns = {name: due_ns for name, due_ns in self._due_ns.items() if name in new_cameras}
        if not self._connected:
            return
        if self._process is None:
            self.connect()
        elif self._pipe is not None:
            with contextlib.suppress(OSError):  # the process has ended, which the log reports
                self._send_cameras(self._pipe)

    def _listen(self, pipe: Connection, process: subprocess.Popen[bytes]) -> None:
        try:
            while True:
                before, self._report = self._report, pipe.recv()
                for name, subscriptions in self._report.wanted.items():
                    if subscriptions > before.wanted.get(name, 0):
                        self._due_ns[name] = 0
        except (EOFError, OSError):
            self._report = SceneReport(0, {})
        code = process.wait()
        # The interrupt at the end of a launch reaches both processes, and the cameras may end first.
        if not self._ending.wait(_END_TIMEOUT_S):
            rospy.logerr("the camera process ended with code %d; cameras publish no more images", code)

    def tick(self, time_ns: int) -> None:
        """Requests due images of cameras with subscribers; called by the loop's thread.

        Args:
            time_ns: Simulated time [ns].
        """
        report = self._report
        if not report.wanted or report.images < self._sent or self._pipe is None or self._tracker is None:
            return
        names = (name for name in report.wanted if name in self._cameras)
        due = [self._cameras[name] for name in names if self._is_due(name, time_ns)]
        if due:
            self._sent += 1
            try:
                self._pipe.send(self._tracker.update(due))
            except OSError:
                self._report = SceneReport(0, {})

    def _is_due(self, name: str, time_ns: int) -> bool:
        period_ns = round(1e9 / self._cameras[name].rate_hz)
        due_ns = self._due_ns[name]
        if due_ns - period_ns > time_ns:  # the clock was reset
            due_ns = time_ns
        if time_ns < due_ns:
            return False
        behind = time_ns - due_ns >= period_ns
        self._due_ns[name] = (time_ns if behind else due_ns) + period_ns
        return True

    def close(self) -> None:
        """Ends the process; may be called twice."""
        self._connected = False
        self._ending.set()
        pipe, self._pipe = self._pipe, None
        if pipe is None or self._process is None:
            return
        with contextlib.suppress(OSError):  # the process has already ended
            pipe.send(None)
        try:
            self._process.wait(_END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def configured_cameras(settings: Mapping[str, Any], robot: RobotBody | None, seed: int) -> list[Camera]:
    """Reads the cameras of the parameter `~sensors` (a `sensors_config.yaml`), and logs faults.

    Args:
        settings: Value of the parameter.
        robot: The robot; None for a world without a robot.
        seed: Random seed of the noise.
    """
    name = robot.body.name if robot is not None else ""

    def locate(frame: str) -> str | None:
        if frame in WORLD_FRAMES:
            return ros_names.WORLD_FRAME
        return f"{name}::{frame}" if robot is not None and frame in robot.body.link_indices else None

    cameras, faults = read_cameras(settings, f"parameter {rospy.resolve_name('~sensors')}", locate, seed)
    for fault in faults:
        rospy.logwarn(fault)
    return cameras
