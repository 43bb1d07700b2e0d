# SPDX-License-Identifier: BSD-3-Clause
"""Feeds a task model from ROS topics: state machines of any node, reports of run_task, log lines, viewer address."""

from __future__ import annotations

from typing import Any

import rospy
from control_msgs.msg import JointTrajectoryControllerState
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState
from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure
from smach_ros.userdata_wire import UserdataError, decode
from std_msgs.msg import String

from modular_framework_core.task_constructor.machine_graph import Transition
from modular_framework_core.task_runner.userdata_text import value_text
from modular_framework_ui.joint_history import Quantity
from modular_framework_ui.messages import MachineStatus, MachineStructure, ReportError, read_report
from modular_framework_ui.task_model import TaskModel

STATUS_TOPIC = "/smach/container_status"
STRUCTURE_TOPIC = "/smach/container_structure"
VIEWER_TOPIC = "viewer/page_address"
JOINTS_TOPIC = "joint_states"
LEVELS = {Log.WARN: "WARN", Log.ERROR: "ERROR", Log.FATAL: "FATAL"}


class MachineFeed:
    """Subscriptions to an introspection server.

    Args:
        server: Prefix of the server's topics.
        model: Model that receives the messages.
    """

    def __init__(self, server: str, model: TaskModel) -> None:
        self._model = model
        self._roots: set[str] = set()
        self._was_heard = False
        self._structures = rospy.Subscriber(server + STRUCTURE_TOPIC, SmachContainerStructure, self._note_structure)
        self._statuses = rospy.Subscriber(server + STATUS_TOPIC, SmachContainerStatus, self._note_status)

    def check(self) -> None:
        """Notifies the model of a server that has ended or whose process was killed."""
        if self._was_heard and not _is_connected(self._statuses):
            self._was_heard = False
            self._note_lost()

    def close(self) -> None:
        """Unsubscribes, and notifies the model that the server has ended."""
        self._structures.unregister()
        self._statuses.unregister()
        self._note_lost()

    def _note_lost(self) -> None:
        for path in self._roots:
            self._model.note_lost_machine(path)

    def _note_structure(self, message: SmachContainerStructure) -> None:
        edges = zip(message.outcomes_from, message.internal_outcomes, message.outcomes_to, strict=False)
        self._model.note_structure(
            MachineStructure(
                path=message.path,
                children=tuple(message.children),
                transitions=tuple(
                    Transition(start=start, outcome=name, target=target) for start, name, target in edges
                ),
                outcomes=tuple(message.container_outcomes),
            )
        )

    def _note_status(self, message: SmachContainerStatus) -> None:
        if not any(message.path.startswith(f"{root}/") for root in self._roots):
            self._roots.add(message.path)
        self._was_heard = True
        self._model.note_status(
            MachineStatus(
                path=message.path,
                initial=tuple(message.initial_states),
                active=tuple(label for label in message.active_states if label != "None"),  # public smach: not started
                userdata=_read_userdata(message.local_data),
            )
        )


class TaskTopics:
    """All subscriptions of the page.

    Subscribers: ``<node>/smach/container_structure`` and ``<node>/smach/container_status`` (smach_msgs) of all nodes;
    ``task_status`` (std_msgs/String), reports of run_task; ``/rosout_agg`` (rosgraph_msgs/Log);
    ``viewer/page_address`` (std_msgs/String), the address of the viewer's page; ``joint_states``
    (sensor_msgs/JointState); the states of all trajectory controllers (control_msgs/JointTrajectoryControllerState).

    Args:
        model: Model that receives the messages.
    """

    def __init__(self, model: TaskModel) -> None:
        self._model = model
        self._feeds: dict[str, MachineFeed] = {}
        self._has_viewer = False
        self._viewer = rospy.Subscriber(VIEWER_TOPIC, String, self._note_viewer)
        self._reporting_root = ""
        self._reports = rospy.Subscriber("task_status", String, self._note_report)
        self._log = rospy.Subscriber("/rosout_agg", Log, self._note_log)
        self._joints = rospy.Subscriber(JOINTS_TOPIC, JointState, self._note_joints, queue_size=1)
        self._controllers: dict[str, rospy.Subscriber] = {}

    def search(self) -> None:
        """Subscribes to new state machines and unsubscribes from ended state machines; must be called periodically."""
        topics = dict(rospy.get_published_topics())
        controller_type = JointTrajectoryControllerState._type
        self._search_controllers({name for name, kind in topics.items() if kind == controller_type})
        published = {
            name.removesuffix(STATUS_TOPIC)
            for name, kind in topics.items()
            if kind == SmachContainerStatus._type and name.endswith(STATUS_TOPIC)
        }
        for server in published - self._feeds.keys():
            self._feeds[server] = MachineFeed(server, self._model)
        for server in self._feeds.keys() - published:
            self._feeds.pop(server).close()
        for feed in self._feeds.values():
            feed.check()
        if self._reporting_root and not _is_connected(self._reports):
            self._model.note_lost_reports(self._reporting_root)
            self._reporting_root = ""
        if self._has_viewer and not _is_connected(self._viewer):
            self._has_viewer = False
            self._model.note_viewer("")

    def _search_controllers(self, topics: set[str]) -> None:
        for topic in topics - self._controllers.keys():
            self._controllers[topic] = rospy.Subscriber(
                topic, JointTrajectoryControllerState, self._note_controller, queue_size=1
            )
        for topic in self._controllers.keys() - topics:
            self._controllers.pop(topic).unregister()

    def _note_joints(self, message: JointState) -> None:
        values = {
            Quantity.POSITION: message.position,
            Quantity.VELOCITY: message.velocity,
            Quantity.EFFORT: message.effort,
        }
        self._model.note_joints(message.name, values)

    def _note_controller(self, message: JointTrajectoryControllerState) -> None:
        self._model.note_joints(message.joint_names, {Quantity.ERROR: message.error.positions})

    def _note_viewer(self, message: String) -> None:
        self._has_viewer = True
        self._model.note_viewer(message.data)

    def _note_report(self, message: Any) -> None:
        try:
            report = read_report(message.data)
        except ReportError as error:
            rospy.logwarn_throttle_identical(10.0, str(error))
            return
        self._reporting_root = report.root
        self._model.note_report(report)

    def _note_log(self, message: Log) -> None:
        if message.level in LEVELS:
            self._model.note_log(LEVELS[message.level], message.name, message.msg)


def _read_userdata(local_data: str) -> dict[str, str]:
    """Returns a text of each userdata value of a container; empty if the values cannot be read safely."""
    try:
        return {key: value_text(value) for key, value in decode(local_data).items()}
    except UserdataError:
        return {}


def _is_connected(subscriber: rospy.Subscriber) -> bool:
    """Returns whether a publisher is connected; rospy also counts the connections to publishers that were killed."""
    return any(link.socket is not None for link in subscriber.impl.connections)
