# SPDX-License-Identifier: BSD-3-Clause
"""ROS node of the viewer, which shows world, robot, planning scene and plan of public topics in a browser."""

from __future__ import annotations

import contextlib
import logging
import os
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import rospkg
import rospy
from moveit_msgs.msg import DisplayTrajectory, PlanningScene
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String

from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.parameter_search import nearest_parameter
from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.sensors.scene_text import ScenePoses, models_from_text, poses_from_text
from modular_framework_simulation.viewer.control_panel import ControlPanel
from modular_framework_simulation.viewer.layers import Layer
from modular_framework_simulation.viewer.pictures import picture_of
from modular_framework_simulation.viewer.plan_playback import plan_of
from modular_framework_simulation.viewer.planning_scene_view import PlanningSceneView
from modular_framework_simulation.viewer.robot_links import finite_positions
from modular_framework_simulation.viewer.robot_view import PlanView, RobotView
from modular_framework_simulation.viewer.ros_feed import BasePose, Feed
from modular_framework_simulation.viewer.ros_gazebo_commands import GazeboCommands
from modular_framework_simulation.viewer.ros_status_line import StatusLine
from modular_framework_simulation.viewer.simulation_status import Phase, SimulationWatch
from modular_framework_simulation.viewer.web_server import WebServer, free_port
from modular_framework_simulation.viewer.world_view import WorldView

_NODE = "viewer"
_NICENESS = 5
"""Lower priority of the drawing thread than of physics and controllers on a busy CPU."""
_RATE_HZ = 25.0
_IDLE_PERIOD_S = 0.2
"""Maximum delay until the scene is drawn for a new client [s]."""
_SEARCH_PERIOD_S = 2.0
_SEARCH_DELAY_S = 0.5
"""Delay of the first search, so that the world, which is small, is drawn before the meshes of a robot are read [s]."""
_MAX_PAUSE_S = 0.2
"""Maximum pause after a late frame [s]. viser sends nothing while a frame is drawn, so its server needs the pause."""
_IMAGE_PERIOD_S = 0.2
_SCENE_MESSAGES = 1000


class ViewerNode:
    """Draws the scene while a browser is connected, and is idle otherwise.

    Parameters: see `parameters/viewer.yaml`.

    Subscribes, while a browser is connected: /gazebo/visible_models and /gazebo/visible_poses (std_msgs/String),
    joint_states (sensor_msgs/JointState), and /tf and /tf_static if the robot's root link is not the fixed frame. Only
    while shown: /move_group/monitored_planning_scene (moveit_msgs/PlanningScene),
    /move_group/display_planned_path (moveit_msgs/DisplayTrajectory) and an image topic (sensor_msgs/Image).

    Publishes: ~page_address (std_msgs/String, latched), the viewer's address with its token, for pages that embed the
        viewer.

    Services called: see `GazeboCommands`.

    Args:
        server: Server of the page.
        fixed_frame: Frame that is drawn at the origin.
        read_only: Whether the page cannot change the simulation.
    """

    def __init__(self, server: WebServer, fixed_frame: str, read_only: bool) -> None:
        self._server = server
        self._panel = ControlPanel(server.viser, GazeboCommands(), rospy.logwarn, read_only=read_only)
        self._layers = {name: Layer(server.viser, name) for name in ("world", "robot", "planning scene", "plan")}
        self._world = WorldView(self._layers["world"], rospy.logwarn)
        self._plan = PlanView(self._layers["plan"], server.viser)
        self._scene = PlanningSceneView(self._layers["planning scene"], rospy.logwarn)
        self._robot: RobotView | None = None
        self._description = ""
        self._base = BasePose(fixed_frame)
        self._models = Feed(ros_names.VISIBLE_MODELS, String)
        self._poses = Feed(ros_names.VISIBLE_POSES, String, on_message=self._hear_poses)
        self._joints = Feed("joint_states", JointState, keep=20)
        self._scenes = Feed(ros_names.MONITORED_PLANNING_SCENE, PlanningScene, keep=_SCENE_MESSAGES)
        self._paths = Feed(ros_names.DISPLAY_PLANNED_PATH, DisplayTrajectory)
        self._images: Feed | None = None
        self._watch = SimulationWatch()
        self._status = StatusLine(self._panel, self._watch, lambda: server.has_clients, self._guard)
        self._new_poses: ScenePoses | None = None
        self._time_ns = 0
        self._replay_from_s: float | None = None
        self._scrub_position: float | None = None
        self._due_s: dict[str, float] = {}
        self._faults: dict[str, str] = {}
        self._had_clients = False
        self._is_layer_chosen = False
        self._ended = threading.Event()
        self._panel.on_replay(self._start_replay)
        self._panel.on_position(self._scrub)

    def run(self) -> None:
        """Draws the scene until ROS shuts down.

        Drawing has its own thread that the end of the process interrupts: a large mesh takes seconds on a busy CPU.
        """
        rospy.on_shutdown(self._ended.set)
        address = rospy.Publisher("~page_address", String, queue_size=1, latch=True)
        address.publish(String(self._server.address))
        for function in (self._draw_always, self._status.run):
            threading.Thread(target=function, daemon=True).start()
        self._ended.wait()

    def _draw_always(self) -> None:
        os.nice(_NICENESS)  # of this thread
        with self._activity("Starting to draw."):
            import trimesh.exchange.gltf  # noqa: F401  (takes a second, so not after a browser has connected)
        while not rospy.is_shutdown():
            start_s = time.monotonic()
            has_clients = self._server.has_clients
            self._guard("drawing", self._draw if has_clients else self._unsubscribe)
            self._had_clients = has_clients
            period_s = 1 / _RATE_HZ if has_clients else _IDLE_PERIOD_S
            drawn_s = time.monotonic() - start_s
            time.sleep(max(min(drawn_s, _MAX_PAUSE_S), period_s - drawn_s))

    @contextlib.contextmanager
    def _activity(self, text: str) -> Iterator[None]:
        """Adds an activity to the status line."""
        self._status.activity = text
        try:
            yield
        finally:
            self._status.activity = ""

    def _unsubscribe(self) -> None:
        for feed in (self._models, self._poses, self._joints, self._scenes, self._paths, self._images):
            if feed is not None:
                feed.switch(False)
        self._base.close()
        self._is_layer_chosen = False

    def _draw(self) -> None:
        if not self._had_clients:
            self._due_s = {"search": time.monotonic() + _SEARCH_DELAY_S}
        for feed in (self._models, self._poses, self._joints):
            feed.switch(True)
        self._paths.switch(self._panel.shows("plan"))
        self._follow_simulation()
        for name, layer in self._layers.items():
            layer.visible = self._panel.shows(name)
        self._server.show_grid(self._panel.shows("grid"))
        self._server.show_shadows(self._panel.shows("shadows"))
        self._take(self._models, self._show_world)
        with self._server.viser.atomic():
            self._place_world()
            self._draw_robot()
            self._draw_scene()
            self._draw_plan()
        self._draw_image()
        if self._is_due("search", _SEARCH_PERIOD_S):
            self._guard("looking for robot and cameras", self._search)

    def _take(self, feed: Feed, function: Callable[[Any], None]) -> None:
        for message in feed.take():
            self._guard(feed.topic, lambda message=message: function(message))  # type: ignore[misc]

    def _guard(self, name: str, function: Callable[[], None]) -> None:
        """Runs a function; an exception is logged once, and the viewer continues."""
        try:
            function()
        except Exception as error:  # any node may publish invalid messages
            if self._ended.is_set():
                return  # the server is closing
            known = isinstance(error, SimulationError | ValueError)
            fault = str(error) if known else f"unexpected {type(error).__name__}: {error}"
            if self._faults.get(name) != fault:
                self._faults[name] = fault
                rospy.logwarn("%s: %s", name, fault)

    def _is_due(self, name: str, period_s: float) -> bool:
        now_s = time.monotonic()
        if now_s < self._due_s.get(name, 0.0):
            return False
        self._due_s[name] = now_s + period_s
        return True

    def _follow_simulation(self) -> None:
        """Clears the world after the end of a simulation, and chooses the layer that a robot without simulation has."""
        phase = self._watch.status(time.monotonic()).phase
        is_absent = phase is Phase.ABSENT
        if is_absent and not self._world.is_empty:
            self._world.show(())
            self._models.switch(False)  # the next subscription receives the latched models again
        if not self._is_layer_chosen and phase in (Phase.ABSENT, Phase.WAITING, Phase.RUNNING):
            self._is_layer_chosen = True
            if is_absent:
                self._panel.show_planning_scene()

    def _search(self) -> None:
        """Searches for a robot and cameras."""
        images = [name for name, kind in rospy.get_published_topics() if kind == Image._type]
        self._panel.offer_cameras(images)
        text = rospy.get_param(nearest_parameter("robot_description"), "")
        if isinstance(text, str) and text and text != self._description:
            self._description = text
            find_package = rospkg.RosPack().get_path
            with self._activity("Loading the robot."):
                self._robot = RobotView(self._layers["robot"], text, find_package, rospy.logwarn)
            self._plan.show(None, self._robot)
            self._server.look_at(np.array([pose.position for pose in self._robot.in_world.values()]))

    def _hear_poses(self, message: Any) -> None:
        def note() -> None:
            poses = poses_from_text(message.data)
            self._watch.note_poses(poses, time.monotonic())
            self._new_poses = poses

        self._guard(self._poses.topic, note)

    def _show_world(self, message: Any) -> None:
        with self._activity("Loading the world."):
            self._world.show(models_from_text(message.data))

    def _place_world(self) -> None:
        poses, self._new_poses = self._new_poses, None
        if poses is None:
            return
        if poses.time_ns < self._time_ns:
            self._base.close()  # its buffer rejects transforms that are older than its latest
        self._time_ns = poses.time_ns
        self._world.place(poses)

    def _draw_robot(self) -> None:
        robot = self._robot
        if robot is None:
            self._joints.take()
            return
        positions: dict[str, float] = {}
        self._take(self._joints, lambda message: positions.update(_positions_of(message)))
        base = self._base.find(robot.links.root)
        if positions or base != robot.base:
            robot.place(positions, base)

    def _draw_scene(self) -> None:
        shown = self._panel.shows("planning scene")
        self._scenes.switch(shown)
        if not shown:
            self._scene.clear()
            return
        self._take(self._scenes, self._scene.apply)
        self._scene.place(self._robot.in_world if self._robot is not None else {})

    def _draw_plan(self) -> None:
        robot = self._robot
        if robot is None:
            return

        def show(message: Any) -> None:
            self._plan.show(plan_of(message), robot)
            self._start_replay()

        self._take(self._paths, show)
        fraction, self._scrub_position = self._scrub_position, None
        if fraction is not None:
            self._replay_from_s = None
            self._plan.show_ghost(fraction * self._plan.duration_s)
        if self._replay_from_s is None:
            return
        elapsed_s = time.monotonic() - self._replay_from_s
        if elapsed_s <= self._plan.duration_s:
            self._plan.show_ghost(elapsed_s)
        elif self._panel.repeats and self._plan.duration_s > 0.0:
            self._start_replay()
        else:
            self._replay_from_s = None
            self._plan.hide_ghost()

    def _start_replay(self) -> None:
        self._replay_from_s = time.monotonic()

    def _scrub(self, fraction: float) -> None:
        self._scrub_position = fraction

    def _draw_image(self) -> None:
        topic = self._panel.camera
        if topic != (self._images.topic if self._images is not None else ""):
            if self._images is not None:
                self._images.switch(False)
            self._images = Feed(topic, Image) if topic else None
            self._panel.show_image(None)
        if self._images is not None:
            self._images.switch(True)
            if self._is_due("image", _IMAGE_PERIOD_S):
                self._take(self._images, lambda message: self._panel.show_image(picture_of(message)))


def _positions_of(message: Any) -> dict[str, float]:
    return finite_positions(message.name, message.position) if message.position else {}


def main() -> int:
    """Runs the node.

    Returns:
        Exit code: 0 after a regular shutdown, 1 if the page cannot be served.
    """
    # Without simulated time, the viewer continues while time is paused.
    rospy.init_node(_NODE, disable_rostime=True)
    read = DeclaredParameters("modular_framework_simulation", "viewer").values
    try:
        host, port, frame, read_only = read("~address", "~port", "~fixed_frame", "~read_only")
        server = WebServer(host, free_port(host, port))
    except (SimulationError, ParameterError, ValueError) as error:
        rospy.logfatal("the viewer cannot start: %s", error)
        return 1
    if server.port != port:
        rospy.logwarn("port %s is in use; the viewer uses port %d", port, server.port)
    rospy.loginfo("viewer: open %s in a browser", server.address)
    ViewerNode(server, frame, read_only).run()
    server.close()
    logging.shutdown()
    os._exit(0)  # the interpreter would wait for a thread that loads a mesh, which takes seconds on a busy CPU
