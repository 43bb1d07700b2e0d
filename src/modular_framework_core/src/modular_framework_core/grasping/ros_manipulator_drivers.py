# SPDX-License-Identifier: BSD-3-Clause
"""Drivers that move the manipulator for the grasp server, through the action of a ROS controller."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    GripperCommandAction,
    GripperCommandGoal,
)
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_core.commander.robot_groups import Group
from modular_framework_core.commander.ros_joint_monitor import JointMonitor
from modular_framework_core.grasping.grasp_server import GraspCommandError, Outcome, refuse_no_effort
from modular_framework_planning.trajectory_processing.rest_to_rest import shortest_cubic_s
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_ros.calls import wait_for_action, wait_for_result

STALL_ERROR_CODES = (
    FollowJointTrajectoryResult.PATH_TOLERANCE_VIOLATED,
    FollowJointTrajectoryResult.GOAL_TOLERANCE_VIOLATED,
)
"""Result codes of a trajectory with blocked joints; other result codes are not stalls."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Motion of the fingers.

    Attributes:
        targets: Target positions by joint name [rad or m].
        efforts: Effort limits by joint name [Nm or N]; for other joints, the controller chooses the effort.
        timeout_s: Timeout of the motion [s, wall time].
        stop_requested: Function polled during the motion; True stops the fingers.
    """

    targets: dict[str, float]
    efforts: dict[str, float]
    timeout_s: float
    stop_requested: Callable[[], bool]


class ManipulatorDriver(Protocol):
    """Driver of one type of controller."""

    def move(self, motion: Motion, monitor: JointMonitor) -> Outcome:
        """Moves the fingers and waits for the end of the motion."""


class GripperDriver:
    """Driver of a controller with one joint and the action control_msgs/GripperCommand.

    Args:
        action: Name of the action.
    """

    def __init__(self, action: str) -> None:
        self._action = action
        self._client = SteadyActionClient(action, GripperCommandAction)

    def move(self, motion: Motion, monitor: JointMonitor) -> Outcome:
        """Moves the joint; a stall is an outcome, not an error.

        Raises:
            CallError: The action server is missing.
            GraspCommandError: The motion has more than one joint, the effort limit is 0, or the controller neither
                reached the target nor stalled.
        """
        if len(motion.targets) != 1:
            raise GraspCommandError(
                f"controller action '{self._action}' moves a single joint; the posture has {sorted(motion.targets)}"
            )
        ((name, position),) = motion.targets.items()
        if name in motion.efforts:
            refuse_no_effort(name, motion.efforts[name])
        wait_for_action(self._client, self._action, 10.0)
        goal = GripperCommandGoal()
        goal.command.position, goal.command.max_effort = position, motion.efforts.get(name, 0.0)
        self._client.send_goal(goal)
        status = wait_for_result(self._client, motion.timeout_s, motion.stop_requested)
        result = self._client.get_result()
        _refuse_unfinished(status, self._action, motion)
        if result is None or not (result.stalled or result.reached_goal):
            raise GraspCommandError(
                f"controller action '{self._action}' gave up: "
                f"{self._client.get_goal_status_text() or 'no reason given'}"
            )
        rests = monitor.wait_for_rest(motion.targets, motion.stop_requested)
        positions = monitor.positions(motion.targets) if rests else {name: result.position}
        return Outcome(positions, bool(result.stalled), f"the controller stopped at {result.position:.4f}")


class TrajectoryDriver:
    """Driver of a controller with the action control_msgs/FollowJointTrajectory.

    A motion starts and ends at rest, and controllers interpolate it by a cubic polynomial. A motion that would exceed
    the limits of a joint lasts longer than `duration_s`.

    Args:
        action: Name of the action.
        group: Planning group of the fingers, with the limits of their velocities and accelerations.
        duration_s: Shortest duration of a motion [s].
    """

    def __init__(self, action: str, group: Group, duration_s: float) -> None:
        self._action, self._group, self._duration_s = action, group, duration_s
        self._client = SteadyActionClient(action, FollowJointTrajectoryAction)

    def move(self, motion: Motion, monitor: JointMonitor) -> Outcome:
        """Moves the joints; fingers at rest outside the controller's tolerances are stalled.

        Raises:
            CallError: The action server is missing.
            GraspCommandError: The controller rejected the goal, aborted it for another reason, or exceeded the timeout.
        """
        wait_for_action(self._client, self._action, 10.0)
        goal = FollowJointTrajectoryGoal()
        goal.trajectory.joint_names = list(motion.targets)
        goal.trajectory.points = [
            JointTrajectoryPoint(
                positions=list(motion.targets.values()),
                velocities=[0.0] * len(motion.targets),
                time_from_start=rospy.Duration.from_sec(self._time_s(motion, monitor)),
            )
        ]
        self._client.send_goal(goal)
        status = wait_for_result(self._client, motion.timeout_s, motion.stop_requested)
        result = self._client.get_result()
        _refuse_unfinished(status, self._action, motion)
        stalled = status == GoalStatus.ABORTED and result is not None and result.error_code in STALL_ERROR_CODES
        text = (result.error_string if result else "") or self._client.get_goal_status_text()
        if status != GoalStatus.SUCCEEDED and not stalled:
            did = "rejected the posture" if status == GoalStatus.REJECTED else "gave up"
            raise GraspCommandError(f"controller action '{self._action}' {did}: {text or 'no reason given'}")
        rests = monitor.wait_for_rest(motion.targets, motion.stop_requested)
        return Outcome(monitor.positions(motion.targets), stalled and rests, text)

    def _time_s(self, motion: Motion, monitor: JointMonitor) -> float:
        """Returns the duration of a motion from the current positions [s]."""
        starts, joints = monitor.positions(motion.targets), [self._group.joint(name) for name in motion.targets]
        distances = [abs(target - starts.get(name, target)) for name, target in motion.targets.items()]
        limits = [joint.velocity for joint in joints], [joint.acceleration for joint in joints]
        return max(self._duration_s, shortest_cubic_s(distances, *limits))


def make_driver(
    controllers: list[dict[str, Any]], joints: Mapping[str, float], group: Group, duration_s: float
) -> ManipulatorDriver:
    """Returns a driver of the controller that has all joints of a posture.

    Args:
        controllers: Entries of ``controller_list``: name, action_ns, type, joints.
        joints: Joints to move.
        group: Planning group of the fingers.
        duration_s: Shortest duration of a motion of a trajectory controller [s].

    Raises:
        GraspCommandError: No controller has all joints, or the controller type is unknown.
    """
    entry = controller_with(controllers, joints)
    if entry is None:
        known = {str(entry.get("name")): list(entry.get("joints", [])) for entry in controllers}
        raise GraspCommandError(f"no controller has all joints {sorted(joints)}; controller_list has {known}")
    match entry.get("type"):
        case "GripperCommand":
            return GripperDriver(action_of(entry))
        case "FollowJointTrajectory":
            return TrajectoryDriver(action_of(entry), group, duration_s)
        case other:
            raise GraspCommandError(
                f"controller '{entry.get('name')}' has the type '{other}'; allowed: "
                "GripperCommand, FollowJointTrajectory"
            )


def controller_with(controllers: Iterable[Mapping[str, Any]], joints: Iterable[str]) -> Mapping[str, Any] | None:
    """Returns the first controller that has all joints; None if there is none.

    Args:
        controllers: Entries of ``controller_list``: name, action_ns, type, joints.
        joints: Joints to move.
    """
    wanted = set(joints)
    return next((entry for entry in controllers if wanted <= set(entry.get("joints", ()))), None)


def action_of(entry: Mapping[str, Any]) -> str:
    """Returns the action name of an entry of ``controller_list``."""
    return "/".join(filter(None, (str(entry.get("name", "")), str(entry.get("action_ns", "")))))


class Manipulator(Protocol):
    """Moves the fingers and reads their positions."""

    def connect(self) -> None:
        """Subscribes to the joint positions."""

    def move(self, motion: Motion) -> Outcome:
        """Moves the fingers and waits for the end of the motion.

        Raises:
            GraspCommandError: The motion failed or was stopped; the message gives the reason.
            CallError: Another node did not respond.
        """

    def joint_state(self, names: Mapping[str, float]) -> JointState:
        """Returns a message with the current positions of the joints."""


class ControlledManipulator:
    """Manipulator with a ROS controller.

    Args:
        controllers: Entries of ``controller_list``: name, action_ns, type, joints.
        group: Planning group of the fingers.
        duration_s: Shortest duration of a motion of a trajectory controller [s].
    """

    def __init__(self, controllers: list[dict[str, Any]], group: Group, duration_s: float) -> None:
        self._controllers, self._group, self._duration_s = controllers, group, duration_s
        self._monitor = JointMonitor(queue_size=1)  # rest is detected after the end of the goal
        self._drivers: dict[tuple[str, ...], ManipulatorDriver] = {}

    def connect(self) -> None:
        """Subscribes to the joint states."""
        self._monitor.connect()

    def move(self, motion: Motion) -> Outcome:
        """Moves the joints through the controller that has all of them."""
        key = tuple(sorted(motion.targets))
        if key not in self._drivers:
            self._drivers[key] = make_driver(self._controllers, motion.targets, self._group, self._duration_s)
        return self._drivers[key].move(motion, self._monitor)

    def joint_state(self, names: Mapping[str, float]) -> JointState:
        """Returns a message with the latest positions of the joints."""
        return self._monitor.message(names)


def _refuse_unfinished(status: int, action: str, motion: Motion) -> None:
    if motion.stop_requested():
        raise GraspCommandError("stopped on request")
    if status == GoalStatus.LOST:
        raise GraspCommandError(f"controller action '{action}' did not end within {motion.timeout_s:.1f} s")
