# SPDX-License-Identifier: BSD-3-Clause
"""A robot with controllers on ROS whose control loop is driven in steps of simulated time by the test itself.

Time passes only in `step` and `trace`. While the test waits for ROS, the loop goes on at the time it has: what a client
sends then is taken up exactly at that time, however long its message took.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import actionlib
import rospy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal, JointTrajectoryControllerState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_control.hardware_interface.combined_robot_hw import CombinedRobotHW
from modular_framework_control.hardware_interface.handles import SpeedScalingHandle
from modular_framework_control.hardware_interface.interfaces import ControllerInfo, SpeedScalingInterface
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.hardware_interface.robot_hw import SwitchState
from modular_framework_control.ros.ros_controller_manager import RosControllerManager
from modular_framework_ros.node_handle import NodeHandle
from modular_framework_ros.ros_node_handle import RosNodeHandle

PERIOD_S = 0.01
WAIT_S = 30.0


class HinderedRobotHW(MockRobotHW):
    """Fake hardware that can be blocked, slowed down, stopped by a fault, and slow to get ready for controllers.

    Attributes:
        blocked: positions of the joints that cannot move, by name.
        reason: the fault; "" for none.
        scaling: its speed slider.
        switching: how far it is with getting ready for its controllers.
        switches: how many switches of its controllers have begun.
    """

    def __init__(self) -> None:
        super().__init__()
        self.blocked: dict[str, float] = {}
        self.reason = ""
        self.switching = SwitchState.DONE
        self.switches = 0

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        joints = robot_hw_nh.get_param("joints")
        scalings = SpeedScalingInterface()
        self.scaling = scalings.register_handle(SpeedScalingHandle(f"speed_of_{joints[0]}", joints))
        self.register_interface(scalings)
        return super().init(root_nh, robot_hw_nh)

    def fault(self) -> str:
        return self.reason

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        super().do_switch(start, stop)
        self.switches += 1

    def switch_result(self, controller: ControllerInfo | None = None) -> SwitchState:
        return self.switching

    def read(self, time_s: float, period_s: float) -> None:
        super().read(time_s, period_s)
        for joint in self._handles:
            if joint.name in self.blocked:
                joint.state.position, joint.state.velocity = self.blocked[joint.name], 0.0


class SteppedRobot:
    """The parameters on the parameter server, the hardware and its controllers, all running.

    Args:
        parameters: `robot_hardware` and what belongs to it (as type each its own name), and the controllers by name.
        controllers: the ones to start.
    """

    def __init__(self, parameters: Mapping[str, Any], controllers: list[str]) -> None:
        self._parameters = [f"/{key}" for key in parameters]
        for key, value in parameters.items():
            rospy.set_param(f"/{key}", value)
        parts = {name: HinderedRobotHW() for name in parameters["robot_hardware"]}
        self.hardware: Mapping[str, HinderedRobotHW] = parts
        self._robot_hw = CombinedRobotHW(parts.__getitem__)
        assert self._robot_hw.init(RosNodeHandle("/"), RosNodeHandle("/"))
        self.time_s = 1000.0
        self._manager = RosControllerManager(self._robot_hw)
        self._manager.connect()
        for name in controllers:
            self._manager.manager.load_controller(name)
        self.wait_for(lambda: self._manager.manager.switch_controller(controllers, []))

    def close(self) -> None:
        self._manager.close()
        self._robot_hw.close()
        for name in self._parameters:
            rospy.delete_param(name)

    def _cycle(self, period_s: float) -> None:
        self._robot_hw.read(self.time_s, period_s)
        self._manager.update(self.time_s, period_s)
        self._robot_hw.write(self.time_s, period_s)

    def step(self, cycles: int = 1) -> None:
        """Let some cycles pass."""
        for _ in range(cycles):
            self.time_s = round(self.time_s + PERIOD_S, 9)
            self._cycle(PERIOD_S)

    def stand(self) -> None:
        """Let a cycle pass while time stands still."""
        self._cycle(0.0)

    def run(self, duration_s: float) -> None:
        """Let some time [s] pass."""
        self.step(round(duration_s / PERIOD_S))

    def flush(self) -> None:
        """Waits until everything that the controllers have queued is published."""
        self._manager.flush(WAIT_S)

    def count_submissions(self, name: str) -> list[float]:
        """A list that grows with everything handed to a controller from now on: when, in simulated time."""
        controller: Any = self._manager.manager.get_controller_by_name(name)
        submit, times_s = controller.submit, []

        def counted(*arguments: Any) -> None:
            try:
                submit(*arguments)
            finally:
                times_s.append(self.time_s)

        controller.submit = counted
        return times_s

    def wait_for(self, action: Callable[[], Any]) -> Any:
        """Do something that waits for ROS or for the loop, while time stands still; answers what it returned."""
        answers: list[Any] = []
        failures: list[BaseException] = []

        def act() -> None:
            try:
                answers.append(action())
            except BaseException as failure:
                failures.append(failure)

        thread = threading.Thread(target=act, daemon=True)
        thread.start()
        end = time.monotonic() + WAIT_S
        while thread.is_alive():
            assert time.monotonic() < end, "nothing happened in time"
            self._cycle(0.0)
            thread.join(0.002)
        if failures:
            raise failures[0]
        return answers[0]

    def wait_until(self, condition: Callable[[], Any]) -> None:
        """Wait, while time stands still, until something is true."""
        end = time.monotonic() + WAIT_S
        while not condition():
            assert time.monotonic() < end, "it did not become true in time"
            self._cycle(0.0)
            time.sleep(0.001)


def trajectory_of(names: list[str], *points: Any, stamp_s: float = 0.0) -> JointTrajectory:
    """A trajectory message.

    Points are (time, positions[, velocities[, accelerations]]), or (time, positions, None) for one that comes to rest
    there.
    """
    message = JointTrajectory(joint_names=names)
    message.header.stamp = rospy.Time.from_sec(stamp_s)
    for time_s, positions, *more in points:
        rows = [[0.0] * len(positions)] * 2 if more == [None] else more
        message.points.append(
            JointTrajectoryPoint(positions, *rows, *[[]] * (2 - len(rows)), [], rospy.Duration.from_sec(time_s))
        )
    return message


class Arm:
    """What a client of one trajectory controller does, and everything it hears."""

    def __init__(self, robot: SteppedRobot, name: str, joints: list[str]) -> None:
        self.robot = robot
        self.name = name
        self.joints = joints
        self.states: list[JointTrajectoryControllerState] = []
        self._subscriber = rospy.Subscriber(f"{name}/state", JointTrajectoryControllerState, self.states.append)
        self._command = rospy.Publisher(f"{name}/command", JointTrajectory, queue_size=5)
        self._taken = robot.count_submissions(name)
        self.action = actionlib.ActionClient(f"{name}/follow_joint_trajectory", FollowJointTrajectoryAction)
        assert robot.wait_for(lambda: self.action.wait_for_server(rospy.Duration(WAIT_S)))
        robot.wait_until(lambda: self._command.get_num_connections() and self._subscriber.get_num_connections())

    def trajectory(self, *points: Any, stamp_s: float = 0.0, names: list[str] | None = None) -> JointTrajectory:
        """A trajectory message for the joints of this controller, or for others."""
        return trajectory_of(self.joints if names is None else names, *points, stamp_s=stamp_s)

    def send(self, *points: Any, **more: Any) -> Any:
        """Send a goal that comes to rest at each point, and wait until it runs or is refused; answers its handle."""
        return self.send_goal(self.goal(*((*point, None) if len(point) == 2 else point for point in points), **more))

    def goal(
        self, *points: Any, stamp_s: float = 0.0, names: list[str] | None = None, **more: Any
    ) -> FollowJointTrajectoryGoal:
        """A goal message."""
        return FollowJointTrajectoryGoal(trajectory=self.trajectory(*points, stamp_s=stamp_s, names=names), **more)

    def send_goal(self, goal: FollowJointTrajectoryGoal, feedback: Callable[..., None] | None = None) -> Any:
        """Send a goal as it is."""
        handle = self.action.send_goal(goal, feedback_cb=feedback)
        self.robot.wait_until(
            lambda: (
                handle.get_comm_state() not in (actionlib.CommState.WAITING_FOR_GOAL_ACK, actionlib.CommState.PENDING)
            )
        )
        return handle

    def result(self, handle: Any) -> tuple[str, int, str]:
        """State, code and text of a goal that has ended."""
        self.robot.wait_until(lambda: handle.get_comm_state() == actionlib.CommState.DONE)
        result = handle.get_result()
        return (actionlib.TerminalState.to_string(handle.get_terminal_state()), result.error_code, result.error_string)

    def is_running(self, handle: Any) -> bool:
        return bool(handle.get_comm_state() == actionlib.CommState.ACTIVE)

    def command(self, message: JointTrajectory) -> None:
        """Publish on the topic `command`, and wait until the controller has taken or refused it."""
        before = len(self._taken)
        self._command.publish(message)
        self.robot.wait_until(lambda: len(self._taken) > before)
        self.robot.stand()

    def trace(self, duration_s: float) -> list[JointTrajectoryControllerState]:
        """Let time pass and answer the state of every cycle; the controller must publish that often."""
        begun_s = self.robot.time_s
        self.robot.flush()
        for _ in range(round(duration_s / PERIOD_S)):
            self.robot.step()
            self._robot_heard()
        return [state for state in self.states if state.header.stamp.to_sec() > begun_s + 1e-6]

    def state(self) -> JointTrajectoryControllerState:
        """The state after one more cycle."""
        return self.trace(PERIOD_S)[-1]

    def _robot_heard(self) -> None:
        end = time.monotonic() + WAIT_S
        while not self.states or self.states[-1].header.stamp.to_sec() < self.robot.time_s - 1e-6:
            assert time.monotonic() < end, "no state was published"
            time.sleep(0.0005)
