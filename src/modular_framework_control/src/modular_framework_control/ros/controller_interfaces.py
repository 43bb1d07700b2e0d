# SPDX-License-Identifier: BSD-3-Clause
"""Opens the topics, actions and services of each controller under the names used by ros_controllers."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import rospy
from control_msgs.msg import (
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    GripperCommandAction,
    GripperCommandGoal,
    JointControllerState,
    JointTrajectoryControllerState,
)
from control_msgs.srv import QueryTrajectoryState, QueryTrajectoryStateRequest, QueryTrajectoryStateResponse
from sensor_msgs.msg import JointState

from modular_framework_control.controller_interface.controller import Controller, ControllerError
from modular_framework_control.controllers.gripper_action_controller import (
    GripperActionController,
    GripperGoalError,
    GripperGoalHandle,
    GripperState,
)
from modular_framework_control.controllers.joint_command_controllers import JointCommandController
from modular_framework_control.controllers.joint_state_controller import JointStateController
from modular_framework_control.controllers.joint_trajectory_controller import JointTrajectoryController
from modular_framework_control.controllers.sensor_controllers import SensorController
from modular_framework_control.mobile_base.diff_drive_controller import DiffDriveController
from modular_framework_control.mobile_base.four_wheel_steering_controller import FourWheelSteeringController
from modular_framework_control.mobile_base.mobile_base_controller import MobileBaseController
from modular_framework_control.realtime.goal_handle import RealtimeGoalHandle
from modular_framework_control.realtime.loop_time import LoopTime
from modular_framework_control.ros import conversions
from modular_framework_control.ros.controller_action_server import (
    ControllerActionServer,
    GoalCallbacks,
    GoalRefusedError,
)
from modular_framework_control.ros.controller_connection import ControllerConnection
from modular_framework_control.ros.joint_command_interface import JointCommandRosInterface, joint_control_to_msg
from modular_framework_control.ros.mobile_base_interfaces import (
    DiffDriveRosInterface,
    FourWheelSteeringRosInterface,
    MobileBaseRosInterface,
)
from modular_framework_control.ros.outbox import Outbox
from modular_framework_control.ros.sensor_interfaces import SensorRosInterface
from modular_framework_control.ros.trajectory_messages import (
    CompactFollowJointTrajectoryAction,
    CompactJointTrajectory,
)
from modular_framework_control.trajectory.trajectory_goal import (
    GoalRejectedError,
    TrajectoryErrorCode,
    TrajectoryGoal,
    TrajectoryGoalHandle,
    TrajectorySnapshot,
)
from modular_framework_ros.node_handle import join_names
from modular_framework_ros.reconfiguration import Adjustable, Reconfiguration

PID_GAINS = (
    Adjustable("p", -1e5, 1e5, "command per error"),
    Adjustable("i", -1e5, 1e5, "command per integral of the error"),
    Adjustable("d", -1e3, 1e3, "command per derivative of the error"),
    Adjustable("i_clamp_min", -1e5, 0.0, "minimum integral term of the command"),
    Adjustable("i_clamp_max", 0.0, 1e5, "maximum integral term of the command"),
    Adjustable("antiwindup", False, True, "clamp the integrated error itself"),
)


class JointStateRosInterface:
    """Publishes `joint_states` (sensor_msgs/JointState) in the namespace of the robot."""

    def __init__(self, controller: JointStateController, connection: ControllerConnection) -> None:
        publish = connection.advertise(join_names(connection.namespace, "joint_states"), JointState)
        controller.on_state = lambda snapshot: publish(
            lambda: conversions.joint_state_to_msg(snapshot, connection.ahead_s)
        )


class JointTrajectoryRosInterface:
    """Connects a trajectory controller to ROS.

    Publishes `<name>/state`; subscribes to `<name>/command`; serves the action `<name>/follow_joint_trajectory` and
    the service `<name>/query_state`.
    """

    def __init__(self, controller: JointTrajectoryController, connection: ControllerConnection) -> None:
        self._controller, self._connection = controller, connection
        publish = connection.advertise("state", JointTrajectoryControllerState)
        self._action = ControllerActionServer(
            connection.topic("follow_joint_trajectory"),
            CompactFollowJointTrajectoryAction,
            GoalCallbacks(submit=self._submit, cancel=controller.cancel, make_result=_trajectory_result),
            connection.outbox,
        )
        connection.opened.callback(self._action.close)
        query = rospy.Service(connection.topic("query_state"), QueryTrajectoryState, self._on_query)
        connection.opened.callback(query.shutdown, "controller unloaded")
        connection.subscribe("command", CompactJointTrajectory, self._on_command)
        controller.on_state = lambda snapshot: publish(
            lambda: conversions.fill_snapshot(
                JointTrajectoryControllerState(), snapshot, controller.joint_names, connection.ahead_s
            )
        )
        controller.on_feedback = lambda goal_handle, snapshot: connection.outbox.put_droppable(
            self._feedback, goal_handle, snapshot
        )

    def _submit(self, message: FollowJointTrajectoryGoal, goal_handle: TrajectoryGoalHandle) -> None:
        try:
            self._controller.submit(conversions.goal_from_msg(message, self._connection.ahead_s), goal_handle)
        except GoalRejectedError as error:
            result = conversions.trajectory_result_to_msg(error.code, str(error))
            raise GoalRefusedError(result, str(error)) from error

    def _on_command(self, message: CompactJointTrajectory) -> None:
        try:
            self._controller.submit(TrajectoryGoal(conversions.trajectory_from_msg(message, self._connection.ahead_s)))
        except GoalRejectedError as error:
            rospy.logwarn("%s/command ignored: %s", self._connection.name, error)

    def _on_query(self, request: QueryTrajectoryStateRequest) -> QueryTrajectoryStateResponse:
        try:
            state = self._controller.desired_at(request.time.to_sec() - self._connection.ahead_s)
        except ControllerError as error:
            raise rospy.ServiceException(f"{self._connection.name}/query_state: {error}") from error
        return QueryTrajectoryStateResponse(self._controller.joint_names, *(row.tolist() for row in state))

    def _feedback(self, goal_handle: TrajectoryGoalHandle, snapshot: TrajectorySnapshot) -> None:
        message = conversions.fill_snapshot(
            FollowJointTrajectoryFeedback(), snapshot, self._controller.joint_names, self._connection.ahead_s
        )
        self._action.publish_feedback(goal_handle, message)


def _trajectory_result(goal_handle: RealtimeGoalHandle[TrajectoryErrorCode]) -> Any:
    code = TrajectoryErrorCode.INVALID_GOAL if goal_handle.result is None else goal_handle.result
    return conversions.trajectory_result_to_msg(code, goal_handle.text)


class GripperRosInterface:
    """Connects a gripper controller to ROS.

    Serves `<name>/gripper_cmd` (control_msgs/GripperCommand action); publishes `<name>/state`
    (control_msgs/JointControllerState).
    """

    def __init__(self, controller: GripperActionController, connection: ControllerConnection) -> None:
        self._controller = controller
        publish = connection.advertise("state", JointControllerState)
        self._action = ControllerActionServer(
            connection.topic("gripper_cmd"),
            GripperCommandAction,
            GoalCallbacks(
                submit=self._submit, cancel=controller.cancel, make_result=_gripper_result, is_fault=_is_gripper_fault
            ),
            connection.outbox,
        )
        connection.opened.callback(self._action.close)
        controller.on_state = lambda snapshot: publish(lambda: joint_control_to_msg(snapshot, connection.ahead_s))
        controller.on_feedback = lambda goal_handle, state: connection.outbox.put_droppable(
            self._feedback, goal_handle, state
        )

    def _submit(self, message: GripperCommandGoal, goal_handle: GripperGoalHandle) -> None:
        try:
            self._controller.submit(message.command.position, message.command.max_effort, goal_handle)
        except GripperGoalError as error:
            raise GoalRefusedError(None, str(error)) from error

    def _feedback(self, goal_handle: GripperGoalHandle, state: GripperState) -> None:
        self._action.publish_feedback(goal_handle, conversions.gripper_feedback_to_msg(state))


def _is_gripper_fault(goal_handle: RealtimeGoalHandle[GripperState]) -> bool:
    """Returns whether the goal failed; stalled fingers may hold an object, so only the client can judge them."""
    return goal_handle.result is None or not goal_handle.result.stalled


def _gripper_result(goal_handle: RealtimeGoalHandle[GripperState]) -> Any:
    return None if goal_handle.result is None else conversions.gripper_result_to_msg(goal_handle.result)


_ROS_INTERFACES: tuple[tuple[type[Controller], Any], ...] = (
    (JointStateController, JointStateRosInterface),
    (JointTrajectoryController, JointTrajectoryRosInterface),
    (GripperActionController, GripperRosInterface),
    (JointCommandController, JointCommandRosInterface),
    (SensorController, SensorRosInterface),
    (DiffDriveController, DiffDriveRosInterface),
    (FourWheelSteeringController, FourWheelSteeringRosInterface),
    (MobileBaseController, MobileBaseRosInterface),
)


def attach_ros(
    controller: Controller, namespace: str, name: str, outbox: Outbox, loop_time: LoopTime
) -> Callable[[], None]:
    """Opens the topics, actions and services of a controller, and dynamic_reconfigure servers for its gains.

    Args:
        controller: Initialised controller; for a class from another package, only the gains are served.
        namespace: Absolute namespace of the robot.
        name: Name of the controller.
        outbox: Thread that publishes for the control loop.
        loop_time: Offset between the stamps of messages and the time of the control loop.

    Returns:
        Callback that closes all topics, actions, services and servers.
    """
    with contextlib.ExitStack() as opened:  # closes what is open if a later connection fails
        connection = ControllerConnection(
            namespace=namespace, name=join_names(namespace, name), outbox=outbox, loop_time=loop_time, opened=opened
        )
        for controller_class, ros_interface in _ROS_INTERFACES:
            if isinstance(controller, controller_class):
                ros_interface(controller, connection)
                break
        for pid_name, pid in controller.pids.items():
            gains = Reconfiguration(connection.topic(pid_name), PID_GAINS, pid, "gains")
            opened.callback(gains.close)
            gains.connect()
        return opened.pop_all().close
