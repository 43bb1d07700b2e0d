# SPDX-License-Identifier: BSD-3-Clause
"""Waits for a vendor's driver, passes its joint states on, and ends with the cause when the driver is lost."""

from __future__ import annotations

import time

import rosgraph
import rospy
from actionlib_msgs.msg import GoalID, GoalStatusArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger, TriggerResponse

from modular_framework_core.launching.vendor_driver import (
    DriverAction,
    DriverHealth,
    controller_list_faults,
    driver_actions,
)
from modular_framework_ros.calls import is_advertised
from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.start_up import start_timeout, wait_for_start

WATCH_PERIOD_S = 0.1
CANCEL_TIME_S = 0.3
"""Time for the cancel messages to be sent before the node exits [s]."""
JOINT_STATES = "/joint_states"


class DriverLostError(Exception):
    """The driver did not become ready, or is lost; the message names what is missing."""


class VendorDriver:
    """Node `vendor_driver`.

    Parameters: see `parameters/vendor_driver.yaml`.
    Subscribers: `<action>/status` of each action (actionlib_msgs/GoalStatusArray), `~joint_states`
    (sensor_msgs/JointState), `~program_running` (std_msgs/Bool), and each of `~topics` (any type).
    Publishers: `/joint_states`, with the messages of other topics; `<action>/cancel` after a loss.
    Services: `~ready` (std_srvs/Trigger), which exists once the driver is ready.

    Raises:
        ParameterError: A parameter is invalid.
    """

    def __init__(self) -> None:
        read = DeclaredParameters("modular_framework_core", "vendor_driver").values
        controllers, topics, program, self._services, self._topics, silence_s, ready_s = read(
            "/move_group/controller_list", "~joint_states", "~program_running", "~services", "~topics",
            "~silence_timeout", "~ready_timeout",
        )  # fmt: skip
        if faults := controller_list_faults(controllers, ()):
            raise ParameterError("; ".join(f"parameter '/move_group/controller_list' {fault}" for fault in faults))
        self._ready_timeout_s = ready_s or start_timeout()
        self._actions = driver_actions(controllers)
        self._joint_states = tuple(rospy.resolve_name(topic) for topic in topics)
        self._program = rospy.resolve_name(program) if program else ""
        signals = [*(f"service {name}" for name in self._services), *(f"topic {name}" for name in self._topics)]
        self._health = DriverHealth(self._actions, self._joint_states, signals, self._program, silence_s)

    def connect(self) -> None:
        """Subscribes to the driver.

        Raises:
            DriverLostError: The driver did not become ready in time, or an action has a different type.
        """
        relay = rospy.Publisher(JOINT_STATES, JointState, queue_size=10)
        for topic in self._joint_states:
            rospy.Subscriber(topic, JointState, self._on_joint_states, (topic, relay), queue_size=10)
        for action in self._actions:
            rospy.Subscriber(f"{action.name}/status", GoalStatusArray, self._on_status, action.name, queue_size=1)
        if self._program:
            rospy.Subscriber(self._program, Bool, lambda message: self._health.on_program(message.data), queue_size=1)
        for topic in self._topics:
            rospy.Subscriber(topic, rospy.AnyMsg, self._on_topic, f"topic {topic}", queue_size=1)
        self._cancel = [rospy.Publisher(f"{action.name}/cancel", GoalID, queue_size=1) for action in self._actions]
        if not wait_for_start(self._is_ready, self._missing, self._ready_timeout_s):
            raise DriverLostError(
                f"the vendor's driver is not ready after {self._ready_timeout_s:g} s: {self._missing()}; "
                "start the driver, or correct the names in the file of the argument vendor_driver_file"
            )
        self._check_types()
        rospy.Service("~ready", Trigger, lambda request: TriggerResponse(True, "the vendor's driver is ready"))
        rospy.loginfo("the vendor's driver is ready: %s", ", ".join(action.name for action in self._actions))

    def watch(self) -> None:
        """Returns at the shutdown of ROS.

        Raises:
            DriverLostError: The driver is lost; all goals of its actions have been cancelled.
        """
        while not rospy.is_shutdown():
            missing = self._missing()
            if missing:
                for publisher in self._cancel:
                    publisher.publish(GoalID())
                time.sleep(CANCEL_TIME_S)  # in which the other parts of a dead driver are missing too
                raise DriverLostError(f"the vendor's driver is lost: {self._missing() or missing}")
            time.sleep(WATCH_PERIOD_S)

    def _missing(self) -> str:
        return "; ".join(self._health.missing(time.monotonic()))

    def _is_ready(self) -> bool:
        for name in self._services:
            if is_advertised(rospy.resolve_name(name)):
                self._health.on_signal(f"service {name}")
        return not self._missing()

    def _check_types(self) -> None:
        """Checks that move_group can send goals to the actions."""
        types = dict(rosgraph.Master(rospy.get_name()).getTopicTypes())
        wrong = [fault for action in self._actions if (fault := _type_fault(action, types.get(f"{action.name}/goal")))]
        if wrong:
            raise DriverLostError("; ".join(wrong))

    def _on_joint_states(self, message: JointState, topic_and_relay: tuple[str, rospy.Publisher]) -> None:
        topic, relay = topic_and_relay
        if message._connection_header["callerid"] == rospy.get_name():
            return
        if topic != JOINT_STATES:
            relay.publish(message)
        self._health.on_joint_states(topic, message.name, time.monotonic())

    def _on_status(self, message: GoalStatusArray, action: str) -> None:
        del message
        self._health.on_status(action, time.monotonic())

    def _on_topic(self, message: rospy.AnyMsg, signal: str) -> None:
        del message
        self._health.on_signal(signal)


def _type_fault(action: DriverAction, goal_type: str | None) -> str:
    if goal_type in (None, "*", action.goal_type):
        return ""
    return f"action {action.name} has goals of type {goal_type}; controller_list says {action.type}; correct the type"


def main() -> int:
    """Runs the node and returns the exit code: 0 after a shutdown, 1 if the driver is not ready or lost."""
    rospy.init_node("vendor_driver", disable_rostime=True)
    try:
        driver = VendorDriver()
        driver.connect()
        driver.watch()
    except DriverLostError as error:
        if rospy.is_shutdown():
            return 0
        rospy.logfatal("%s", error)
        return 1
    return 0
