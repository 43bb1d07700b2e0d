# SPDX-License-Identifier: BSD-3-Clause
"""The control loop of a robot that is not simulated: hardware, controller manager and time in one node."""
from __future__ import annotations

import threading
import time
import traceback

import rospy

from modular_framework_control.combined_robot_hw import robot_hw_of_type
from modular_framework_control.node_handle import ParameterError, read_number
from modular_framework_control.plugins import PluginError
from modular_framework_control.ros_controller_manager import RosControllerManager
from modular_framework_control.ros_hardware_ready import HardwareNotReadyError, HardwareReadiness, ready_topics_of
from modular_framework_control.ros_node_handle import RosNodeHandle

COMBINED_TYPE = "modular_framework_control/CombinedRobotHW"
MOCK_TYPE = "modular_framework_control/MockRobotHW"
OVERRUN_WARNING_PERIOD_S = 10.0


class RobotHwNode:
    """Node `robot_hw`.

    Parameters: `/robot_hardware`: a list of hardware, each with its parameters in the namespace of that name, which is
    combined to one robot; without it, `~type` (MockRobotHW of this package) is one hardware, with private parameters.
    `~rate` [1/s] 125. `topic_to_wait_for`, private and of each listed hardware: topic (std_msgs/Bool, latched) that
    says True once controllers can be loaded, none when empty. `~ready_timeout` [s] 60: how long hardware that announces
    itself may take for that.

    Subscribes the topics of hardware that announces itself; publishes those of hardware that does not. The services of
    `RosControllerManager` are there once all hardware is ready; hardware is read and written from the beginning.
    """

    def __init__(self) -> None:
        self._nh = RosNodeHandle("~")
        self._period_s = 1.0 / read_number(self._nh, "rate", 125.0, 1.0)
        self._ready_timeout_s = read_number(self._nh, "ready_timeout", 60.0)
        listed = RosNodeHandle("/").has_param("robot_hardware") and not self._nh.has_param("type")
        self._hw_nh = RosNodeHandle("/") if listed else self._nh
        type_name = COMBINED_TYPE if listed else self._nh.get_param("type", MOCK_TYPE)
        try:
            self._robot_hw = robot_hw_of_type(type_name)
        except PluginError as error:
            raise ParameterError(f"parameter {self._nh.namespace}/type: unknown hardware type {type_name!r}: "
                                 f"{error}") from error
        self._manager: RosControllerManager | None = None
        self._connected = threading.Event()
        self._failure = ""
        self._overruns = 0

    def connect(self) -> None:
        """Initialise the hardware.

        Raises:
            ParameterError: the hardware refused its parameters.
        """
        if not self._robot_hw.init(RosNodeHandle("/"), self._hw_nh):
            raise ParameterError(f"{self._nh.namespace}: hardware {type(self._robot_hw).__name__} did not initialise; "
                                 "its own message above says why")
        self._readiness = HardwareReadiness(ready_topics_of(self._robot_hw, self._hw_nh))
        self._readiness.connect()
        self._manager = RosControllerManager(self._robot_hw)

    def run(self) -> bool:
        """Run the control loop until the node is shut down; then stop all controllers.

        Returns:
            Whether it ended because it was told to; otherwise the log says why.
        """
        if self._manager is None:
            raise RuntimeError("connect() comes before run()")
        starter = threading.Thread(target=self._get_ready, args=(self._manager,), name="get_ready", daemon=True)
        starter.start()
        try:
            self._loop(self._manager)
        except rospy.ROSInterruptException:
            rospy.loginfo("control loop ends: the node is shut down")
        finally:
            starter.join(timeout=2.0)
            self._readiness.close()
            self._manager.close()
        return not self._failure

    def _loop(self, manager: RosControllerManager) -> None:
        last_s = rospy.get_time()
        rate = rospy.Rate(1.0 / self._period_s, reset=True)
        while not rospy.is_shutdown() and not self._failure:
            begun_s = time.perf_counter()
            time_s = rospy.get_time()
            period_s = max(0.0, time_s - last_s)
            last_s = time_s
            self._robot_hw.read(time_s, period_s)
            if self._connected.is_set():
                manager.update(time_s, period_s)
            self._robot_hw.write(time_s, period_s)
            self._count_overrun(time.perf_counter() - begun_s)
            rate.sleep()

    def _count_overrun(self, work_s: float) -> None:
        if work_s > self._period_s:
            self._overruns += 1
            rospy.logwarn_throttle(OVERRUN_WARNING_PERIOD_S, f"control loop: a cycle took {work_s * 1e3:.1f} ms, its "
                                   f"period is {self._period_s * 1e3:.1f} ms; overruns so far: {self._overruns}")

    def _get_ready(self, manager: RosControllerManager) -> None:
        """Wait for the hardware and open the services, beside the loop, which the hardware may need to get ready."""
        try:
            self._readiness.wait(self._ready_timeout_s)
            if rospy.is_shutdown():
                return
            manager.connect()
            self._connected.set()
            self._readiness.announce()
        except Exception as error:  # on this thread nobody else would see it, and the node would run without services
            if not rospy.is_shutdown():
                self._failure = str(error) or type(error).__name__
                rospy.logfatal("%s", error if isinstance(error, HardwareNotReadyError) else traceback.format_exc())


def main() -> int:
    """Run the node; returns its exit code."""
    rospy.init_node("robot_hw")
    try:
        node = RobotHwNode()
        node.connect()
    except ParameterError as error:
        rospy.logfatal("%s", error)
        return 1
    return 0 if node.run() else 1
