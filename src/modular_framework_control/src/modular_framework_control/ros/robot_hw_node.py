# SPDX-License-Identifier: BSD-3-Clause
"""Runs the control loop of a real robot: hardware, controller manager and timing in one node."""

from __future__ import annotations

import signal
import threading
import time
import traceback
from collections.abc import Callable

import rospy

from modular_framework_control.hardware_interface.combined_robot_hw import robot_hw_of_type
from modular_framework_control.hardware_interface.interfaces import EffortJointInterface, VelocityJointInterface
from modular_framework_control.hardware_interface.plugins import PluginError
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.realtime.cycle_pacer import CyclePacer, LoopStatistics
from modular_framework_control.realtime.loop_time import LoopTime
from modular_framework_control.realtime.scheduling import (
    hold_interpreter,
    keep_processors_awake,
    leave_real_time,
    prepare_interpreter,
    run_in_real_time,
)
from modular_framework_control.ros.hardware_ready import HardwareNotReadyError, HardwareReadiness, ready_topics_of
from modular_framework_control.ros.large_messages import receive_in_pieces
from modular_framework_control.ros.loop_report import LoopReport
from modular_framework_control.ros.ros_controller_manager import RosControllerManager
from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.parameter_declarations import parameters_below
from modular_framework_ros.ros_node_handle import RosNodeHandle
from modular_framework_ros.shutdown import hold_shutdown

COMBINED_TYPE = "modular_framework_control/CombinedRobotHW"
CLOCK_TOLERANCE_S = 1e-6
REST_VELOCITY = 0.01
"""Maximum measured velocity of a joint at rest [rad/s or m/s]; measurements are never exactly 0."""
MAX_DELAY_S = 0.05
"""Delay of a cycle, at least two periods, beyond which motions pause for the delay [s]."""
MIN_WRITE_TIME_S = 0.2
"""Minimum time of writing before hardware with a small measured velocity counts as at rest [s]."""
MAX_END_TIME_S = 2.0
"""Maximum time to wait for rest at the end of the loop [s]."""


class RobotHwNode:
    """Node `robot_hw` in the namespace of the robot, which contains its controllers, services and parameters.

    Parameters: see `parameters/robot_hw.yaml` and the declaration named after the class of the hardware. The parameters
    of the hardware are private, or in the namespace of each name in `robot_hardware`.

    Subscribes to the ready topics of hardware that announces itself, and publishes the ready topics of the other
    hardware. The services of `RosControllerManager` appear once all hardware is ready; the hardware is read and written
    from the start. The topic and the service of `LoopReport` exist as long as the loop runs.

    Args:
        ended: Event that ends the loop: controllers stop, goals end, and the hardware is closed while the node can
            still publish.
        loop_time: Time of the loop, unless ROS time is simulated; stamps follow the system clock.
    """

    def __init__(self, ended: threading.Event, loop_time: LoopTime | None = None) -> None:
        self._ended = ended
        self._loop_time = loop_time if loop_time is not None else LoopTime()
        self._nh = RosNodeHandle("~")
        self._root_nh = RosNodeHandle(rospy.get_namespace())
        parameters = parameters_below("modular_framework_control", "robot_hw", self._nh, self._root_nh)
        rate_hz, self._real_time, self._ready_timeout_s, type_name = parameters.values(
            "~rate", "~real_time", "~ready_timeout", "~type"
        )
        self._period_s = 1.0 / rate_hz
        self._loop_time.max_step_s = max(MAX_DELAY_S, 2.0 * self._period_s)
        is_combined = self._root_nh.has_param("robot_hardware") and not self._nh.has_param("type")
        self._hw_nh = self._root_nh if is_combined else self._nh
        type_name = COMBINED_TYPE if is_combined else type_name
        try:
            self._robot_hw = robot_hw_of_type(type_name)
        except PluginError as error:
            raise ParameterError(
                f"parameter {self._nh.namespace}/type: unknown hardware type {type_name!r}: {error}"
            ) from error
        self._manager: RosControllerManager | None = None
        self._connected = threading.Event()
        self._failure = ""
        self._statistics = LoopStatistics(self._period_s)
        self._report = LoopReport(self._statistics, self._period_s, self._robot_hw, self._health)
        self._last_s = 0.0

    def connect(self) -> None:
        """Initialises the hardware.

        Raises:
            ParameterError: If the hardware did not initialise.
        """
        self._warn_of_global_description()
        self._report.connect()
        if not self._robot_hw.init(self._root_nh, self._hw_nh):
            raise ParameterError(
                f"{self._nh.namespace}: hardware {type(self._robot_hw).__name__} did not initialise; "
                "see its message above"
            )
        self._readiness = HardwareReadiness(ready_topics_of(self._robot_hw, self._hw_nh), self._robot_hw)
        self._readiness.connect()
        self._manager = RosControllerManager(self._robot_hw, rospy.get_namespace(), loop_time=self._loop_time)

    def _warn_of_global_description(self) -> None:
        if (
            rospy.get_namespace() != "/"
            and not self._root_nh.has_param("robot_description")
            and RosNodeHandle("/").has_param("robot_description")
        ):
            rospy.logwarn(
                "/robot_description is ignored, as this robot's parameter is %s/robot_description; "
                "without that parameter, no joint limits are read from a URDF",
                self._root_nh.namespace,
            )

    def _health(self) -> tuple[str, str]:
        """Returns the fault and the warning of the hardware."""
        if self._manager is None:
            return "the hardware is being initialised", ""
        return self._manager.manager.fault, self._robot_hw.warning()

    def close(self) -> None:
        """Closes the hardware and ends real-time scheduling; may be called twice."""
        self._robot_hw.close()
        leave_real_time()
        self._report.close()

    def run(self) -> bool:
        """Runs the control loop until `ended` is set, then stops all controllers and brings the robot to rest.

        Returns:
            Whether the loop ended without a failure; a failure is logged.
        """
        if self._manager is None:
            raise RuntimeError("run() was called before connect()")
        starting_thread = threading.Thread(
            target=self._await_hardware, args=(self._manager,), name="get_ready", daemon=True
        )
        starting_thread.start()
        self._prepare()
        try:
            self._loop(self._manager)
        except Exception as error:  # hardware of users may raise any exception
            self._failure = f"hardware {type(self._robot_hw).__name__} raised {type(error).__name__}: {error}"
            rospy.logfatal("control loop ends: %s\n%s", self._failure, traceback.format_exc())
        finally:
            self._end(self._manager, starting_thread)
        return not self._failure

    def _prepare(self) -> None:
        """Requests real-time scheduling and awake processors from the operating system."""
        prepare_interpreter()
        if not self._real_time:
            return
        refused = run_in_real_time() + keep_processors_awake()
        if refused:
            rospy.logwarn("control loop without: %s", "; ".join(refused))

    def _loop(self, manager: RosControllerManager) -> None:
        if not self._must_continue():
            return
        if rospy.rostime.is_wallclock():
            self._last_s = self._loop_time.now()
            pacer = CyclePacer(self._period_s)

            def cycle(late_s: float, missed: int) -> bool:
                with hold_interpreter():
                    return self._cycle(manager, self._loop_time.now(), late_s, missed, pacer.woken_late_s)

            pacer.run(cycle)
            return
        self._last_s = rospy.get_time()
        while self._cycle(manager, rospy.get_time(), 0.0, 0):  # the delay is unknown
            self._wait_for_simulated_clock()

    def _cycle(
        self, manager: RosControllerManager, time_s: float, late_s: float, missed: int, woken_late_s: float = 0.0
    ) -> bool:
        """Reads the hardware, updates the controllers and writes; returns whether the loop continues."""
        begun_s = time.perf_counter()
        period_s = max(0.0, time_s - self._last_s)
        self._last_s = time_s
        self._robot_hw.read(time_s, period_s)
        if self._connected.is_set():
            manager.update(time_s, period_s)
        else:
            self._robot_hw.seed_commands()
            manager.manager.watch_hardware()
        self._robot_hw.write(time_s, period_s)
        self._statistics.add(late_s, missed, time.perf_counter() - begun_s, woken_late_s)
        return self._must_continue()

    def _must_continue(self) -> bool:
        return not (self._ended.is_set() or self._failure or rospy.is_shutdown())

    def _wait_for_simulated_clock(self) -> None:
        """Waits until the simulated clock has advanced by one period or has jumped back."""
        begun_s = rospy.get_time()
        tick = rospy.rostime.get_rostime_cond()
        while 0.0 <= rospy.get_time() - begun_s < self._period_s - CLOCK_TOLERANCE_S:
            if not self._must_continue():
                break
            with tick:
                tick.wait(0.1)

    def _end(self, manager: RosControllerManager, starting_thread: threading.Thread) -> None:
        """Stops the controllers, brings the robot to rest, and closes all connections.

        The robot comes first, because closing needs the network, which may be slow or fail.
        """
        self._ended.set()
        manager.manager.stop_all()
        _runs_without_error("bringing the robot to rest", self._bring_to_rest)
        starting_thread.join(timeout=2.0)
        _runs_without_error("closing the topics of ready hardware", self._readiness.close)
        _runs_without_error("closing the controllers", manager.close)
        _runs_without_error("closing the report of the loop", self._report.close)

    def _bring_to_rest(self) -> None:
        """Writes the final commands of the controllers (velocities and efforts of 0) until no joint moves.

        The hardware and its limits brake cycle by cycle. The waits use real time, because a simulated clock may be
        paused.
        """
        begun_s = due_s = time.monotonic()
        self._robot_hw.seed_commands()
        all_commands_known = all(handle.command == handle.command for _, handle in self._robot_hw.command_handles)
        succeeded = all_commands_known and self._final_step_succeeds("write")
        while succeeded and time.monotonic() - begun_s < MAX_END_TIME_S:
            if not is_moving(self._robot_hw, 0.0 if time.monotonic() - begun_s < MIN_WRITE_TIME_S else REST_VELOCITY):
                break
            due_s += self._period_s
            time.sleep(max(0.0, due_s - time.monotonic()))
            self._last_s += self._period_s
            succeeded = self._final_step_succeeds("read") and self._final_step_succeeds("write")

    def _final_step_succeeds(self, step: str) -> bool:
        """Reads or writes the hardware one period after the last cycle; returns whether the call succeeded."""
        return _runs_without_error(
            f"last {step} of hardware {type(self._robot_hw).__name__}",
            lambda: getattr(self._robot_hw, step)(self._last_s + self._period_s, self._period_s),
        )

    def _await_hardware(self, manager: RosControllerManager) -> None:
        """Opens the services once the hardware is ready, on a separate thread: hardware may need the loop to start."""
        try:
            self._readiness.wait(self._ready_timeout_s, self._ended, lambda: manager.manager.fault)
            if rospy.is_shutdown() or self._ended.is_set():
                return
            manager.connect()
            self._connected.set()
            self._readiness.announce()
        except Exception as error:  # otherwise the node would run without services and without an error message
            if not rospy.is_shutdown():
                self._failure = str(error) or type(error).__name__
                rospy.logfatal("%s", error if isinstance(error, HardwareNotReadyError) else traceback.format_exc())


def is_moving(robot_hw: RobotHW, max_rest_velocity: float) -> bool:
    """Returns whether a joint exceeds a velocity [rad/s or m/s] or has a nonzero velocity or effort command."""
    return any(
        abs(handle.velocity) > max_rest_velocity
        or (isinstance(interface, (VelocityJointInterface, EffortJointInterface)) and handle.command != 0.0)
        for interface, handle in robot_hw.command_handles
    )


def _runs_without_error(description: str, action: Callable[[], None]) -> bool:
    try:
        action()
    except Exception as error:  # after any error, the next steps must still run
        rospy.logerr("%s raised %s: %s", description, type(error).__name__, error)
        return False
    return True


def main() -> int:
    """Runs the node; returns its exit code."""
    ended, running = threading.Event(), threading.Event()

    def on_signal(number: int, frame: object) -> None:
        del frame
        if not running.is_set():  # hardware that connects slowly must not delay the shutdown
            raise SystemExit(128 + number)
        ended.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    receive_in_pieces()
    rospy.init_node("robot_hw", disable_signals=True)
    finished = hold_shutdown(ended)
    node: RobotHwNode | None = None
    try:
        node = RobotHwNode(ended)
        node.connect()
        running.set()
        return 0 if node.run() else 1
    except ParameterError as error:
        rospy.logfatal("%s", error)
        return 1
    finally:
        if node is not None:
            node.close()
        finished.set()
        rospy.signal_shutdown("the control loop has ended")
