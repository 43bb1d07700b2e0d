# SPDX-License-Identifier: BSD-3-Clause
"""Loads and starts the controllers of a robot as soon as its hardware is ready."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rospkg
import rospy
from controller_manager_msgs.srv import (
    ListControllers,
    LoadController,
    SwitchController,
    SwitchControllerRequest,
)
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Bool

from modular_framework_core.launching.robot_controllers_spawner import (
    JOINT_STATES_NAME,
    JOINT_STATES_RATE_HZ,
    JOINT_STATES_TYPE,
    ControllerFileError,
    SpawnPlan,
    plan_spawn,
    read_controller_file,
    with_joint_states,
)
from modular_framework_ros.calls import CallError, call_service, is_advertised
from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.start_up import start_timeout

LOOP_STATUS = ": control loop"
"""Suffix of the control loop's status name in `/diagnostics`."""
CALL_TIMEOUT_S = 30.0
"""Timeout of calls to the controller manager [s]; the manager itself waits 10 s for a stopped loop."""


class SpawnError(Exception):
    """The controllers could not be spawned."""


class RobotControllersSpawner:
    """Node `custom_controller_spawner`.

    Parameters: see `parameters/robot_controllers_spawner.yaml`; `/<hardware>/topic_to_wait_for`.
    Subscribers: `topic_to_wait_for` of each hardware (std_msgs/Bool), and `/diagnostics` for hardware faults.
    Services called: `controller_manager/{list_controllers, load_controller, switch_controller}`.
    Uploads the controller file to the root of the parameter server.

    Args:
        robot_package: ROS package with a folder `controllers`.
        controller_file: File in that folder.

    Attributes:
        stay_alive: Whether the node keeps running after success, for launch files that require it.
    """

    def __init__(self, robot_package: str, controller_file: str) -> None:
        self._faults: dict[str, str] = {}
        read = DeclaredParameters("modular_framework_core", "robot_controllers_spawner").values
        self._warn_after_s, give_up_after_s, self.stay_alive, self._hardware = read(
            "~timeout", "~give_up_after", "~stay_alive", "/robot_hardware"
        )
        self._give_up_after_s = give_up_after_s or start_timeout()
        try:
            folder = Path(rospkg.RosPack().get_path(robot_package))
        except rospkg.ResourceNotFound as error:
            raise SpawnError(f"robot package '{robot_package}' is not found on ROS_PACKAGE_PATH") from error
        try:
            self._file = read_controller_file(folder / "controllers" / controller_file)
        except ControllerFileError as error:
            raise SpawnError(str(error)) from error

    def run(self) -> None:
        """Uploads the parameters, waits for the hardware, starts the controllers and checks that they run.

        Raises:
            SpawnError: Hardware or a service is missing, or a controller does not run.
        """
        for name, value in self._file.parameters.items():
            rospy.set_param(f"/{name}", value)
        self._wait_for_hardware()
        self._add_joint_states()
        plan = plan_spawn(self._file.controllers, self._states())
        self._execute(plan)
        states = self._states()
        idle = [
            f"'{name}' is {states.get(name, 'not loaded')}"
            for name in self._file.controllers
            if states.get(name) != "running"
        ]
        if idle:
            raise SpawnError(
                f"controllers of {self._file.path} do not run: {', '.join(idle)}; see the log of the controller manager"
            )
        rospy.loginfo(
            "controllers running: %s (loaded now: %s)",
            ", ".join(self._file.controllers),
            ", ".join(plan.load) or "none",
        )

    def _add_joint_states(self) -> None:
        """Adds a joint state controller if none is loaded or listed, so that joint positions are published."""
        loaded = self._call("list_controllers", ListControllers).controller
        file = with_joint_states(self._file, [entry.type for entry in loaded])
        if file is not self._file:
            self._file = file
            rospy.set_param(f"/{JOINT_STATES_NAME}", file.parameters[JOINT_STATES_NAME])
            rospy.loginfo(
                "%s lists no joint state controller; '%s' (%s, %.0f Hz) is started, so that the joint "
                "positions are published",
                file.path,
                JOINT_STATES_NAME,
                JOINT_STATES_TYPE,
                JOINT_STATES_RATE_HZ,
            )

    def _execute(self, plan: SpawnPlan) -> None:
        for name in plan.load:
            if not self._call("load_controller", LoadController, name).ok:
                raise SpawnError(
                    f"controller '{name}' of {self._file.path} could not be loaded; see the log of "
                    "the controller manager"
                )
        if plan.start:
            self._call(
                "switch_controller",
                SwitchController,
                list(plan.start),
                [],
                SwitchControllerRequest.BEST_EFFORT,
                False,
                0.0,
            )

    def _states(self) -> dict[str, str]:
        return {entry.name: entry.state for entry in self._call("list_controllers", ListControllers).controller}

    def _call(self, name: str, kind: Any, *arguments: Any) -> Any:
        service = rospy.resolve_name(f"controller_manager/{name}")
        self._wait(
            lambda: is_advertised(service),
            lambda: f"service {service}",
            "is the simulation or the node robot_hw running?",
        )
        try:
            return call_service(rospy.ServiceProxy(service, kind), kind._request_class(*arguments), CALL_TIMEOUT_S)
        except CallError as error:
            raise SpawnError(str(error)) from error

    def _wait_for_hardware(self) -> None:
        topics = {name: rospy.get_param(f"/{name}/topic_to_wait_for", "") for name in self._hardware}
        topics = {name: topic for name, topic in topics.items() if topic}
        for name, topic in topics.items():
            if not isinstance(topic, str):
                raise SpawnError(f"parameter '/{name}/topic_to_wait_for' is {topic!r}; allowed: the name of a topic")
        ready = {hardware: threading.Event() for hardware in topics}
        subscribers = [
            rospy.Subscriber(topic, Bool, _set_when_true, ready[hardware]) for hardware, topic in topics.items()
        ]

        def missing_signals() -> str:
            return ", ".join(
                f"True on topic {rospy.resolve_name(topics[name])} of hardware '{name}'"
                for name, event in ready.items()
                if not event.is_set()
            )

        subscribers.append(rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_diagnostics))
        self._wait(lambda: not missing_signals(), missing_signals, "is the hardware connected and its driver running?")
        for subscriber in subscribers:
            subscriber.unregister()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith(LOOP_STATUS):
                self._faults[status.name] = next((value.value for value in status.values if value.key == "fault"), "")

    def _wait(self, done: Callable[[], bool], describe_event: Callable[[], str], advice: str) -> None:
        """Polls a condition in wall time, warns every `~timeout` and gives up after `~give_up_after`.

        Args:
            done: Condition.
            describe_event: Function that returns a description of the awaited event.
            advice: Advice to the user if no hardware fault is known.
        """
        started = warned = time.monotonic()
        while not done():
            now, cause = time.monotonic(), "; ".join(filter(None, self._faults.values()))
            if rospy.is_shutdown():
                raise SpawnError(f"shut down while waiting for {describe_event()}")
            if now - started > self._give_up_after_s:
                raise SpawnError(f"waited {now - started:.0f} s for {describe_event()} in vain; {cause or advice}")
            if now - warned > self._warn_after_s:
                warned = now
                rospy.logwarn("still waiting for %s after %.0f s; %s", describe_event(), now - started, cause or advice)
            time.sleep(0.05)


def _set_when_true(message: Bool, event: threading.Event) -> None:
    if message.data:
        event.set()


def main() -> int:
    """Runs the node and returns the exit code: 0 if all controllers run, 1 if not, 2 for a wrong command line."""
    rospy.init_node("custom_controller_spawner", disable_rostime=True)  # does not need /clock
    arguments = rospy.myargv(sys.argv)[1:]
    if len(arguments) != 2:
        rospy.logfatal("usage: robot_controllers_spawner ROBOT_PACKAGE CONTROLLER_FILE; got %s", arguments)
        return 2
    try:
        spawner = RobotControllersSpawner(*arguments)
        spawner.run()
    except SpawnError as error:
        (rospy.loginfo if rospy.is_shutdown() else rospy.logfatal)("controllers not spawned: %s", error)
        return 1
    if spawner.stay_alive:
        rospy.spin()
    return 0
