# SPDX-License-Identifier: BSD-3-Clause
"""Collects the messages of a stack's nodes during an episode."""

from __future__ import annotations

import json
import math
import threading
import time
from collections.abc import Callable
from typing import Any

import rosgraph
import roslib.message
import rospy
from control_msgs.msg import JointControllerState, JointTrajectoryControllerState
from moveit_msgs.msg import DisplayTrajectory
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from modular_framework_benchmark.episodes.ros_world import SIMULATION_NODE, TASK_NODE
from modular_framework_benchmark.records.episode_settings import from_json
from modular_framework_ros.component_report import ReportedMethod

ACTIONS = {"moveit_msgs/ExecuteTrajectoryActionGoal": "execution", "modular_framework_core/GraspActionGoal": "grasp"}
"""Component of an action, keyed by the type of its goal."""

CONTROLLER_STATE = "control_msgs/JointTrajectoryControllerState"
JOINT_CONTROLLER_STATE = "control_msgs/JointControllerState"
PLANNING_NODE = "/move_group"
MODELS, GRASPED, TASK_STATUS = "/gazebo/model_states", "/gazebo/grasped_object", "task_status"
REPORTS, PATHS = "/move_group/planning_report", "/move_group/display_planned_path"
COMPONENT_REPORTS = "component_reports"
RECORDED_COMPONENTS = frozenset({"planning", *ACTIONS.values()})
"""Components recorded from messages of the framework's nodes; other nodes must not report these components."""
SUCCEEDED = 3
"""Status of actionlib_msgs/GoalStatus."""


class Samples:
    """Messages of an episode with their real and simulated time of arrival.

    Subscribers: ``joint_states``, ``/gazebo/model_states``, ``/gazebo/grasped_object``, ``task_status``,
    ``component_reports``, ``/move_group/planning_report``, ``/move_group/display_planned_path``, the states of all
    trajectory controllers and single-joint controllers, goals and results of the actions in `ACTIONS`.

    Attributes:
        joints: Joint states.
        controllers: (name of the controller, state).
        set_points: (joint, control_msgs/JointControllerState) of single-joint controllers, such as a gripper's.
        planning: (real time [s], report of move_group).
        paths: Motions that move_group displays.
        components: (real time [s], report of a component).
        ends: Statuses of the task node on the ends of tasks.
        forgeries: (topic, sender) of dropped messages, whose sender must not publish on the topic.
    """

    def __init__(self) -> None:
        """Creates empty lists without connecting."""
        self._lock = threading.Lock()
        self._subscribers: dict[str, Any] = {}
        self._goals: dict[str, dict[str, Any]] = {}
        self._results: dict[str, dict[str, Any]] = {}
        self._servers: dict[str, str] = {}
        self.clear()

    def clear(self) -> None:
        """Removes all collected messages."""
        with self._lock:
            self.joints: list[Any] = []
            self.ends: list[dict[str, Any]] = []
            self.forgeries: set[tuple[str, str]] = set()
            self.controllers: list[tuple[str, Any]] = []
            self.set_points: list[tuple[str, Any]] = []
            self.planning: list[tuple[float, dict[str, Any]]] = []
            self.paths: list[Any] = []
            self.components: list[tuple[float, dict[str, Any]]] = []
            self._goals.clear()
            self._results.clear()

    def actions(self) -> list[dict[str, Any]]:
        """Returns the ended goals in order, with `component`, `goal`, begin and end, `succeeded`, `reason`.

        A result may arrive before its goal, because they come from two nodes.
        """
        with self._lock:
            pairs = [(goal, self._results[number]) for number, goal in self._goals.items() if number in self._results]
        ended = [goal | result | {"wall": min(goal["wall"], result["wall_end"])} for goal, result in pairs]
        return sorted(ended, key=lambda each: (each["ros_end"], each["wall_end"]))

    def process_methods(self) -> list[ReportedMethod]:
        """Returns the methods in their own process that the reports of components name."""
        return [from_json(ReportedMethod, report["method"]) for _, report in self.components if report.get("method")]

    def actions_ended(self) -> bool:
        """Returns whether all goals have a result, and all results have a goal."""
        with self._lock:
            return self._goals.keys() == self._results.keys()

    def latest_s(self) -> float:
        """Returns the stamp of the latest joint state [s]; minus infinity before the first message."""
        return float(self.joints[-1].header.stamp.to_sec()) if self.joints else -math.inf

    def connect(self) -> None:
        """Subscribes to all present topics; repeated calls add new topics."""
        for topic, kind, owner, callback in (
            ("joint_states", JointState, SIMULATION_NODE, lambda message: self.joints.append(message)),
            # The simulation records its world itself; these two are only to detect other publishers.
            (MODELS, rospy.AnyMsg, SIMULATION_NODE, lambda _: None),
            (GRASPED, String, SIMULATION_NODE, lambda _: None),
            (TASK_STATUS, String, TASK_NODE, self._on_status),
            (COMPONENT_REPORTS, String, "", self._on_component_report),
            (REPORTS, String, PLANNING_NODE, lambda message: self.planning.append(_timed_report(message))),
            (PATHS, DisplayTrajectory, PLANNING_NODE, lambda message: self.paths.append(message)),
        ):
            self._subscribe(topic, kind, callback, owner)
        for topic, type_name in rosgraph.Master(rospy.get_name()).getTopicTypes():
            if type_name == CONTROLLER_STATE:
                name = topic.strip("/").rpartition("/")[0]
                self._subscribe(topic, JointTrajectoryControllerState, self._controller(name), SIMULATION_NODE)
            elif type_name == JOINT_CONTROLLER_STATE:
                self._subscribe_joint_state(topic)
            elif type_name in ACTIONS:
                self._subscribe_action(topic, type_name)

    def _subscribe(self, topic: str, kind: Any, callback: Callable[[Any], None], owner: str = "") -> None:
        """Subscribes to a topic.

        Args:
            topic: Name of the topic.
            kind: Message class.
            callback: Receiver of the messages.
            owner: Only allowed sender; messages of other nodes are dropped and their senders noted. "" for any sender.
        """

        def receive(message: Any) -> None:
            sender = message._connection_header["callerid"]
            if owner in ("", sender):
                callback(message)
            else:
                self.forgeries.add((topic, sender))

        if topic not in self._subscribers:
            self._subscribers[topic] = rospy.Subscriber(topic, kind, receive, tcp_nodelay=True)

    def interference(self) -> str:
        """Returns the nodes that publish in place of the simulation, the task or another component, or ""."""
        return "; ".join(
            f"a node named '{sender}' publishes {topic}"
            for topic, sender in sorted(self.forgeries)
            if topic in (MODELS, GRASPED, TASK_STATUS, *self._servers) or topic.startswith(COMPONENT_REPORTS)
        )

    def _controller(self, name: str) -> Callable[[Any], None]:
        return lambda message: self.controllers.append((name, message))

    def _subscribe_joint_state(self, topic: str) -> None:
        """Subscribes to the state of a single-joint controller, CONTROLLER/state."""
        joint = rospy.get_param(f"{topic.rpartition('/')[0]}/joint", "")
        if joint:
            self._subscribe(
                topic, JointControllerState, lambda state: self.set_points.append((joint, state)), SIMULATION_NODE
            )

    def _subscribe_action(self, topic: str, type_name: str) -> None:
        name, component = topic.rpartition("/")[0], ACTIONS[type_name]
        goal = roslib.message.get_message_class(type_name)
        result = roslib.message.get_message_class(type_name.removesuffix("Goal") + "Result")
        if component == "execution":
            self._servers[f"{name}/result"] = PLANNING_NODE
        self._subscribe(topic, goal, lambda message: self.add_goal(component, message))
        self._subscribe(f"{name}/result", result, lambda message: self._on_result(f"{name}/result", message))

    def _on_result(self, topic: str, message: Any) -> None:
        """Adds a result of the action server, which is move_group or the first sender; records other senders."""
        sender = message._connection_header["callerid"]
        server = self._servers.setdefault(topic, sender)
        if sender == server:
            self.add_result(message)
        else:
            self.forgeries.add((topic, sender))

    def _on_component_report(self, message: String) -> None:
        """Adds the report of a component, unless the component is recorded from another node."""
        wall_s, report = _timed_report(message)
        if report["component"] in RECORDED_COMPONENTS:
            self.forgeries.add(
                (f"{COMPONENT_REPORTS} of '{report['component']}'", message._connection_header["callerid"])
            )
        else:
            self.components.append((wall_s, report))

    def _on_status(self, message: String) -> None:
        status = json.loads(message.data)
        if status["event"] == "task_end":
            self.ends.append(status)

    def add_goal(self, component: str, message: Any) -> None:
        """Adds a goal of a component's action."""
        started = {
            "component": component,
            "wall": time.monotonic(),
            "ros": message.header.stamp.to_sec(),
            "goal": message.goal,
        }
        with self._lock:
            self._goals[message.goal_id.id] = started

    def add_result(self, message: Any) -> None:
        """Adds the result of a goal."""
        code = getattr(getattr(message.result, "error_code", None), "val", 1)
        succeeded = message.status.status == SUCCEEDED and code == 1
        ended = {
            "wall_end": time.monotonic(),
            "ros_end": message.header.stamp.to_sec(),
            "succeeded": succeeded,
            "reason": "" if succeeded else message.status.text or f"error code {code}",
        }
        with self._lock:
            self._results[message.status.goal_id.id] = ended


def _timed_report(message: String) -> tuple[float, dict[str, Any]]:
    return time.monotonic(), json.loads(message.data)
