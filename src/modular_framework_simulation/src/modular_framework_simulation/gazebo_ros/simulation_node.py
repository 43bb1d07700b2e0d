# SPDX-License-Identifier: BSD-3-Clause
"""ROS node of the simulation, with world, robot, controllers and clock in one process."""

from __future__ import annotations

import logging
import math
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import rospkg
import rospy

from modular_framework_control.hardware_interface.interfaces import HardwareInterfaceError
from modular_framework_control.ros.ros_controller_manager import RosControllerManager
from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.ros_node_handle import RosNodeHandle
from modular_framework_simulation.errors import DescriptionError, SimulationError
from modular_framework_simulation.gazebo_ros.camera_process import CameraProcess, configured_cameras
from modular_framework_simulation.gazebo_ros.gazebo_services import GazeboServices
from modular_framework_simulation.gazebo_ros.planning_scene import PlanningScenePublisher
from modular_framework_simulation.gazebo_ros.ros_names import RESTART
from modular_framework_simulation.gazebo_ros.sensor_topics import SensorTopics, noise_seed
from modular_framework_simulation.gazebo_ros.starting_pose import parse_starting_pose
from modular_framework_simulation.gazebo_ros.time_services import TimeServices
from modular_framework_simulation.gazebo_ros.visible_scene_topics import VisibleSceneTopics
from modular_framework_simulation.gazebo_ros.world_files import find_world_file
from modular_framework_simulation.gazebo_ros.world_topics import ClockTopic, WorldTopics, init_node
from modular_framework_simulation.loop.pacing import Pacer
from modular_framework_simulation.loop.perception_errors import PerceptionErrors
from modular_framework_simulation.loop.request_queue import RequestQueue
from modular_framework_simulation.loop.simulation_loop import Actors, Hook, SimulationLoop
from modular_framework_simulation.loop.snapshots import WorldSnapshot, take_snapshot
from modular_framework_simulation.loop.time_holds import TimeHolds
from modular_framework_simulation.loop.world_digest import WorldDigest
from modular_framework_simulation.models import sdf_specs
from modular_framework_simulation.models.mesh_files import ConvexParts, default_cache_folder
from modular_framework_simulation.models.model_search import ros_resources
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import STANDARD_GRAVITY, read_world
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import RobotBody
from modular_framework_simulation.physics.simulated_robot_hw import SimulatedRobotHW
from modular_framework_simulation.robots.end_effector_joints import end_effector_joints
from modular_framework_simulation.robots.robot_description import read_robot
from modular_framework_simulation.sensors.robot_visuals import read_robot_visuals
from modular_framework_simulation.sensors.sensor_reader import read_robot_sensors
from modular_framework_simulation.sensors.visible_scene import SceneTracker

_PACKAGE = "modular_framework_simulation"
_STATES_RATE_HZ = 50
_GRASP_RATE_HZ = 50
_PERFORMANCE_RATE_HZ = 5
_CAMERA_RATE_HZ = 500
"""Rate of the checks for due images [Hz]."""
_SNAPSHOT_RATE_HZ = 20
_PACE_REPORT_S = 30
_SWITCH_INTERVAL_S = 0.0005
_STOP_TIMEOUT_S, _RESPONSE_TIMEOUT_S = 5.0, 30.0


def _pacer(parameters: Mapping[str, Any], requests: RequestQueue) -> Pacer:
    """Returns the pacer; between episodes, an idle limit leaves the CPU to nodes that start or compute."""
    idle_limit = 1.0 if parameters["/wait_for_planning"] else None
    return Pacer(parameters["~real_time_factor"], sleep=requests.serve, idle_limit=idle_limit)


class SimulationNode:
    """Builds the world from parameters and runs it.

    Parameters: see `parameters/simulation.yaml`. Topics and services: see `WorldTopics`, `VisibleSceneTopics`,
    `GazeboServices`, `TimeServices`, `PlanningScenePublisher`, `SensorTopics`, `CameraPublisher` and, for the
    controllers, `RosControllerManager`.

    Args:
        parameters: Declared parameters by name.

    Raises:
        SimulationError: The world or the robot is invalid.
        HardwareInterfaceError: A transmission of the robot names an unknown hardware interface.
        ParameterError: A parameter of the joint limits has the wrong type.
    """

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        self._resources = ros_resources(parameters["/gazebo_model_path"])
        self._settings = PhysicsSettings(round(parameters["~time_step"] * 1e9))
        self._parts = ConvexParts(default_cache_folder(), rospy.loginfo)
        self._world = self._build_world(parameters)
        self._controllers: RosControllerManager | None = None
        actors = self._build_robot(parameters)
        self._clock = ClockTopic(self._world)
        self._topics = WorldTopics(self._world) if parameters["~enable_ros_network"] else None
        requests = RequestQueue()
        self._loop = SimulationLoop(
            self._world,
            _pacer(parameters, requests),
            requests,
            actors,
            on_paused_tick=self._on_paused_tick,
            holds=TimeHolds(rospy.logwarn),
        )
        if parameters["~paused"]:
            self._loop.pause()
        self._visible = VisibleSceneTopics(self._world, lambda: self._loop.paused) if self._topics else None
        self._perception = PerceptionErrors()
        self._services = GazeboServices(self._loop, self._resources, self._perception)
        self._scene = PlanningScenePublisher()
        self._last_snapshot: WorldSnapshot | None = None
        digest = WorldDigest(self._world, actors.robot if actors else None) if parameters["~state_digest"] else None
        self._time_services = TimeServices(
            self._loop,
            self._scene,
            self._snapshot,
            may_hold=parameters["/wait_for_planning"],
            digest=digest,
            after_restart=self._after_restart,
        )
        self._sensors, self._cameras = self._build_sensors(parameters, actors)
        self._add_hooks(parameters["~pub_clock_frequency"])
        self._thread = threading.Thread(target=self._run_loop, name="simulation loop", daemon=True)
        self._failed = False

    def _build_world(self, parameters: Mapping[str, Any]) -> PhysicsWorld:
        spec = sdf_specs.World("empty", STANDARD_GRAVITY, (), ())
        if parameters["~world_file"]:
            own_worlds = Path(rospkg.RosPack().get_path(_PACKAGE))
            file = find_world_file(parameters["~world_file"], (*self._resources.resource_folders, own_worlds))
            spec = read_world(file, self._resources)
            for line in spec.unknown:
                rospy.logwarn(line)
            if spec.ignored:
                rospy.logwarn("elements of the world without effect: %s", ", ".join(spec.ignored))
            step_s = self._settings.time_step_s
            if spec.step_s is not None and not math.isclose(spec.step_s, step_s):
                rospy.logwarn(
                    "the world file sets a step of %g s; the parameter time_step of %g s is used", spec.step_s, step_s
                )
        engine = parameters["~physics_engine"]
        world = PhysicsWorld(
            self._settings,
            self._parts,
            spec.gravity,
            gui=parameters["~gui"],
            log=rospy.logwarn,
            engine=engine,
        )
        world.weld_grasps = parameters["~weld_grasps"]
        if world.weld_grasps:
            rospy.logwarn("~weld_grasps is true: held objects are welded to the gripper and cannot slip")
        if parameters["~gui_required"] and not world.engine.has_window:
            raise SimulationError("~gui_required is true, but no window is available; set ~gui_required to false")
        for model in spec.models:
            world.spawn(model, keep=True)
        names = ", ".join(world.names()) or "none"
        rospy.loginfo("world '%s' with %d models, physics engine %s: %s", spec.name, len(spec.models), engine, names)
        return world

    def _build_robot(self, parameters: Mapping[str, Any]) -> Actors | None:
        if not parameters["/robot_description"]:
            rospy.logwarn("no parameter robot_description: the world has no robot")
            return None
        try:
            grippers = end_effector_joints(parameters["/robot_description_semantic"], parameters["/robot_description"])
        except DescriptionError as error:  # Gazebo reads no SRDF
            rospy.logwarn("%s; only grippers with mimic joints can hold objects", error)
            grippers = frozenset()
        description = read_robot(
            parameters["/robot_description"],
            self._resources.find_package,
            self._parts,
            self._world.engine.has_window,
            grippers,
        )
        name = parameters["~robot_name"] or description.name
        positions = description.initial_positions | parse_starting_pose(parameters["~starting_pose"])
        robot = RobotBody(self._world, description, name, Pose(), positions)
        hardware = SimulatedRobotHW(robot)
        handle = RosNodeHandle("/")
        hardware.init(handle, handle)
        self._controllers = RosControllerManager(hardware)
        return Actors(robot, hardware, self._controllers)

    def _build_sensors(
        self, parameters: Mapping[str, Any], actors: Actors | None
    ) -> tuple[SensorTopics, CameraProcess]:
        description = parameters["/robot_description"]
        robot, find_package, seed = actors.robot if actors else None, self._resources.find_package, noise_seed()
        robots = [read_robot_sensors(description, robot.body.name, find_package, seed)] if robot else []

        def make_tracker() -> SceneTracker:
            robot_visuals = (
                {robot.body.name: read_robot_visuals(description, find_package, rospy.logwarn)} if robot else {}
            )
            return SceneTracker(self._world, robot_visuals)

        cameras = CameraProcess(
            make_tracker, configured_cameras(parameters["~sensors"], robot, seed), parameters["~renderer"]
        )
        return SensorTopics(self._world, robots, seed, cameras.set_cameras), cameras

    def _add_hooks(self, clock_rate_hz: float) -> None:
        def period_ns(rate_hz: float) -> int:
            return round(1e9 / rate_hz) if rate_hz else 0

        self._loop.add_hook(
            Hook(period_ns(clock_rate_hz), self._clock.publish_within_limit if clock_rate_hz else self._clock.publish)
        )
        if self._topics is not None:
            self._loop.add_hook(Hook(period_ns(_STATES_RATE_HZ), self._topics.publish_models))
            self._loop.add_hook(Hook(period_ns(_STATES_RATE_HZ), self._topics.publish_links))
            self._loop.add_hook(Hook(period_ns(_PERFORMANCE_RATE_HZ), self._topics.publish_performance))
        if self._visible is not None:
            self._loop.add_hook(Hook(period_ns(_STATES_RATE_HZ), self._visible.publish))
        self._loop.add_hook(Hook(period_ns(_GRASP_RATE_HZ), self._watch_grasps))
        self._loop.add_hook(Hook(period_ns(_STATES_RATE_HZ), self._loop.record.sample))
        self._loop.add_hook(Hook(period_ns(_CAMERA_RATE_HZ), lambda: self._cameras.tick(self._world.time_ns)))
        self._loop.add_hook(Hook(0, self._sensors.tick))
        self._loop.add_hook(Hook(period_ns(_SNAPSHOT_RATE_HZ), self._publish_snapshot))
        self._loop.add_hook(Hook(period_ns(1 / _PACE_REPORT_S), self._report_pace))

    def _watch_grasps(self) -> None:
        before = [watch.held for watch in self._loop.grasp_watches]
        self._loop.watch_grasps()
        held = [watch.held for watch in self._loop.grasp_watches]
        if self._topics is not None:  # also after a reset, which releases the held objects
            self._topics.publish_grasped(sorted({name for name in held if name is not None}))
        for old, now in zip(before, held, strict=True):
            if now != old:
                suffix = " by a weld" if self._world.weld_grasps else ""
                rospy.loginfo("the gripper %s", f"holds '{now}'{suffix}" if now else f"let go of '{old}'")
        if held != before:
            self._publish_snapshot()

    def _on_paused_tick(self) -> None:
        """Publishes the state while time is paused, because models may be spawned, moved and deleted meanwhile."""
        self._clock.publish()
        self._sensors.follow()
        if self._visible is not None:
            self._visible.publish()
        self._publish_snapshot()
        self._cameras.tick(self._world.time_ns)

    def _publish_snapshot(self) -> None:
        self._last_snapshot = take_snapshot(self._world, self._loop.held_objects(), self._last_snapshot)
        self._scene.show(self._perception.perceived_snapshot(self._last_snapshot))

    def _snapshot(self) -> WorldSnapshot:
        return self._perception.perceived_snapshot(take_snapshot(self._world, self._loop.held_objects()))

    def _after_restart(self) -> None:
        self._loop.requests.call(RESTART, self._perception.clear, _RESPONSE_TIMEOUT_S)
        self._services.refresh()

    def _report_pace(self) -> None:
        if self._world.time_ns == 0:
            return
        pace = self._loop.pacer.report(self._world.time_ns * 1e-9)
        text = "real time factor %.3f, %.0f us per step, busy %.0f %% of the time"
        rospy.loginfo(text, pace.factor, pace.step_cost_s * 1e6, pace.busy_fraction * 100)

    def _run_loop(self) -> None:
        try:
            self._loop.run()
            self._report_pace()
        except Exception as error:  # any failure of the loop shuts the node down
            rospy.logfatal("the simulation loop ended with %s: %s", type(error).__name__, error)
            self._failed = True
            rospy.signal_shutdown("the simulation loop failed")

    def run(self) -> int:
        """Runs until ROS shuts down.

        Returns:
            Exit code of the process: 0 after a regular shutdown, 1 if the loop failed.
        """
        # Threads that handle messages return the interpreter lock to the loop within this time.
        sys.setswitchinterval(_SWITCH_INTERVAL_S)
        # A shutdown closes the topics, so the loop must end first.
        rospy.on_shutdown(self._stop_loop)
        self._clock.publish()
        self._cameras.connect()
        self._thread.start()
        if self._controllers is not None:
            self._controllers.connect()
        if self._topics is not None:
            self._services.connect()
        else:
            rospy.loginfo("~enable_ros_network is false: except /clock, Gazebo's topics and services are not provided")
        self._time_services.connect()
        self._scene.connect()
        rospy.loginfo("simulation is running%s", " (paused)" if self._loop.paused else "")
        rospy.spin()
        self.close()
        return 1 if self._failed else 0

    def _stop_loop(self) -> None:
        self._loop.stop()
        if threading.current_thread() is not self._thread and self._thread.is_alive():
            self._thread.join(timeout=_STOP_TIMEOUT_S)

    def close(self) -> None:
        """Stops the loop and closes the world; may be called twice."""
        self._services.close()
        self._time_services.close()
        self._scene.close()
        self._stop_loop()
        self._cameras.close()
        if self._controllers is not None:
            self._controllers.close()
            self._controllers = None
        if not self._thread.is_alive():
            self._sensors.close()
            self._world.close()


def main() -> int:
    """Runs the node.

    Returns:
        Exit code: 0 after a regular shutdown, 1 if the world is invalid or the loop failed.
    """
    init_node()
    try:
        parameters = DeclaredParameters(_PACKAGE, "simulation").all()
        if parameters["~verbose"]:
            logging.getLogger("rosout").setLevel(logging.DEBUG)
        if parameters["~unsupported"]:
            rospy.logwarn("arguments without effect in this simulation: %s", parameters["~unsupported"])
        node = SimulationNode(parameters)
    except (SimulationError, HardwareInterfaceError, ParameterError, ValueError) as error:
        rospy.logfatal("the simulation cannot start: %s", error)
        return 1
    return node.run()
