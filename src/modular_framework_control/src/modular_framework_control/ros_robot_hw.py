# SPDX-License-Identifier: BSD-3-Clause
"""The control loop of a robot that is not simulated: hardware, controller manager and time in one node."""
from __future__ import annotations

import threading

import rospy
from std_msgs.msg import Bool

from modular_framework_control.mock_robot_hw import MockRobotHW
from modular_framework_control.node_handle import ParameterError, read_number
from modular_framework_control.robot_hw import RobotHW
from modular_framework_control.ros_controller_manager import RosControllerManager
from modular_framework_control.ros_node_handle import RosNodeHandle

HARDWARE_TYPES: dict[str, type[RobotHW]] = {"modular_framework_control/MockRobotHW": MockRobotHW}


class RobotHwNode:
    """Node `robot_hw`.

    Parameters: `~type` ("modular_framework_control/MockRobotHW"); `~rate` [1/s] 125; `~topic_to_wait_for`: topic
    (std_msgs/Bool, latched) that says True once controllers can be loaded, none when empty; the parameters of the
    hardware, also private.
    """

    def __init__(self) -> None:
        self._nh = RosNodeHandle("~")
        self._period_s = 1.0 / read_number(self._nh, "rate", 125.0, 1.0)
        type_name = self._nh.get_param("type", "modular_framework_control/MockRobotHW")
        if type_name not in HARDWARE_TYPES:
            raise ParameterError(f"parameter {self._nh.namespace}/type: unknown hardware type {type_name!r}; known: "
                                 f"{', '.join(sorted(HARDWARE_TYPES))}")
        self._robot_hw = HARDWARE_TYPES[type_name]()
        self._manager: RosControllerManager | None = None

    def connect(self) -> None:
        """Initialise the hardware and advertise the services.

        Raises:
            ParameterError: the hardware refused its parameters.
        """
        if not self._robot_hw.init(RosNodeHandle("/"), self._nh):
            raise ParameterError(f"{self._nh.namespace}: hardware {type(self._robot_hw).__name__} did not initialise; "
                                 "its own message above says why")
        self._manager = RosControllerManager(self._robot_hw)
        self._manager.connect()

    def run(self) -> None:
        """Run the control loop until the node is shut down; then stop all controllers."""
        if self._manager is None:
            raise RuntimeError("connect() comes before run()")
        ready = _Ready(self._nh.get_param("topic_to_wait_for", ""))
        last_s = rospy.get_time()
        rate = rospy.Rate(1.0 / self._period_s, reset=True)
        try:
            while not rospy.is_shutdown():
                time_s = rospy.get_time()
                period_s = max(0.0, time_s - last_s)
                last_s = time_s
                self._robot_hw.read(time_s, period_s)
                self._manager.update(time_s, period_s)
                self._robot_hw.write(time_s, period_s)
                ready.say_once()
                rate.sleep()
        except rospy.ROSInterruptException:
            rospy.loginfo("control loop ends: the node is shut down")
        finally:
            self._manager.close()


class _Ready:
    """Says once, on a latched topic, that controllers can be loaded."""

    def __init__(self, topic: str) -> None:
        self._publisher = rospy.Publisher(topic, Bool, queue_size=1, latch=True) if topic else None
        self._said = threading.Event()

    def say_once(self) -> None:
        """Publish True if that has not been done."""
        if self._publisher is not None and not self._said.is_set():
            self._said.set()
            self._publisher.publish(True)


def main() -> int:
    """Run the node; returns its exit code."""
    rospy.init_node("robot_hw")
    try:
        node = RobotHwNode()
        node.connect()
    except ParameterError as error:
        rospy.logfatal("%s", error)
        return 1
    node.run()
    return 0
