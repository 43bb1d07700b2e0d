# SPDX-License-Identifier: BSD-3-Clause
"""Sends trajectories to the controllers of their joints and watches them: start, duration, cancel, their answer."""
from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import Any

import actionlib
import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryGoal,
    GripperCommandAction,
    GripperCommandGoal,
)
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_control.ros_action_client import SteadyActionClient
from modular_framework_planning import capability_names as names
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.ros_parameters import ControllerSpec, ExecutionSettings
from modular_framework_planning.ros_scene_monitor import SceneMonitor

POLL_S = 0.01
SETTLE_TIMEOUT_S = 1.0
SETTLED_RAD = 1.0e-4
STOP_TIMEOUT_S = 1.0
START_STATE_TIMEOUT_S = 0.5
ACTION_TYPES = {"FollowJointTrajectory": FollowJointTrajectoryAction, "GripperCommand": GripperCommandAction}


@dataclass(frozen=True, slots=True)
class _Part:
    """The share of one controller in a motion."""

    controller: ControllerSpec
    trajectory: JointTrajectory


class TrajectoryExecution:
    """Executes one motion at a time.

    Subscribes: trajectory_execution_event (std_msgs/String "stop").
    Action clients: <controller>/<action_ns> of every entry of ~controller_list.
    """

    def __init__(self, controllers: tuple[ControllerSpec, ...], settings: ExecutionSettings,
                 monitor: SceneMonitor) -> None:
        self.controllers = controllers
        self.settings = settings
        self._monitor = monitor
        self._clients: dict[str, Any] = {}
        self._stop = threading.Event()
        self._busy = threading.Lock()

    def connect(self) -> None:
        """Starts to listen for stop events and to look for the controllers."""
        rospy.Subscriber(names.EXECUTION_EVENT_TOPIC, String, self._on_event, queue_size=5)
        for spec in self.controllers:
            self._clients[spec.name] = SteadyActionClient(spec.action, ACTION_TYPES[spec.kind])

    def close(self) -> None:
        """Stops a motion under way and waits for that; to be called while topics are still open."""
        self._stop.set()
        if self._busy.acquire(timeout=STOP_TIMEOUT_S):
            self._busy.release()

    def _on_event(self, message: String) -> None:
        if message.data == "stop":
            rospy.loginfo("trajectory_execution_event: stopping the motion")
            self._stop.set()

    def execute(self, trajectory: Any, cancelled: threading.Event) -> None:
        """Executes a RobotTrajectory and returns when the robot is there.

        Raises:
            PlanningError: what went wrong, in the controller's words where it spoke.
        """
        motion = trajectory.joint_trajectory
        if trajectory.multi_dof_joint_trajectory.points:
            raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, "multi_dof_joint_trajectory is not supported")
        _check_message(motion)
        if not motion.points:
            return
        if not self._busy.acquire(blocking=False):
            raise PlanningError(ErrorCode.CONTROL_FAILED, "another motion is under way; wait for its end or stop it")
        try:
            self._stop.clear()
            parts = self._split(motion)
            self._check_start(motion)
            if self._is_there_already(motion, parts):
                return
            self._require_servers(parts)
            self._run(parts, motion.points[-1].time_from_start.to_sec(), cancelled)
            self._settle(motion.joint_names)
        finally:
            self._busy.release()

    def _split(self, motion: JointTrajectory) -> list[_Part]:
        owners = {joint: spec for spec in self.controllers for joint in spec.joints}
        orphans = [joint for joint in motion.joint_names if joint not in owners]
        if orphans:
            listed = ", ".join(f"{spec.name} ({' '.join(spec.joints)})" for spec in self.controllers)
            raise PlanningError(ErrorCode.CONTROL_FAILED, f"no controller in {rospy.resolve_name('~controller_list')} "
                                f"moves {', '.join(orphans)}; listed: {listed or 'none'}")
        parts = []
        for spec in self.controllers:
            columns = [i for i, joint in enumerate(motion.joint_names) if owners[joint] is spec]
            if columns:
                parts.append(_Part(spec, _columns(motion, columns)))
        return parts

    def _check_start(self, motion: JointTrajectory) -> None:
        tolerance = self.settings.allowed_start_tolerance
        if tolerance <= 0.0:
            return
        self._monitor.wait_for_state()
        index = self._monitor.model.index
        numbers = [index[name] for name in motion.joint_names if name in index]
        wanted = np.array([p for name, p in zip(motion.joint_names, motion.points[0].positions, strict=True)
                           if name in index])
        gap = self._monitor.positions()[numbers] - wanted
        if np.abs(gap).max() > tolerance and self._monitor.wait_for_next_state(START_STATE_TIMEOUT_S):
            gap = self._monitor.positions()[numbers] - wanted
        worst = int(np.abs(gap).argmax())
        if abs(gap[worst]) > tolerance:
            raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, f"joint '{motion.joint_names[worst]}' is "
                                f"{abs(gap[worst]):.4f} from the trajectory's first point (allowed_start_tolerance "
                                f"{tolerance}); plan again from the current state")

    def _is_there_already(self, motion: JointTrajectory, parts: list[_Part]) -> bool:
        """Whether a motion ends where it starts and was seen to start where the robot is.

        Controllers refuse such a motion: its only point is due at once. Grippers do not: their goal is also a force.
        """
        return (self.settings.allowed_start_tolerance > 0.0 and motion.points[-1].time_from_start.to_sec() <= 0.0
                and all(part.controller.kind == "FollowJointTrajectory" for part in parts))

    def _require_servers(self, parts: list[_Part]) -> None:
        timeout_s = self.settings.controller_connection_timeout
        for part in parts:
            # real time: while a simulation is paused, simulated time never runs out
            deadline = time.monotonic() + timeout_s
            while not _is_connected(self._clients[part.controller.name].action_client):
                if time.monotonic() > deadline or rospy.is_shutdown():
                    raise PlanningError(ErrorCode.CONTROL_FAILED, "action "
                                        f"{rospy.resolve_name(part.controller.action)} of controller "
                                        f"'{part.controller.name}' did not answer within {timeout_s:.1f} s; is the "
                                        "controller running?")
                rospy.rostime.wallsleep(POLL_S)

    def _run(self, parts: list[_Part], duration_s: float, cancelled: threading.Event) -> None:
        begun = rospy.Time.now()
        allowed = duration_s * self.settings.allowed_execution_duration_scaling + (
            self.settings.allowed_goal_duration_margin)
        open_parts = list(parts)
        for part in parts:
            self._clients[part.controller.name].send_goal(_goal(part))
        try:
            while open_parts:
                if cancelled.is_set() or self._stop.is_set() or rospy.is_shutdown():
                    raise PlanningError(ErrorCode.PREEMPTED, "the motion was stopped on request")
                elapsed = (rospy.Time.now() - begun).to_sec()
                if self.settings.execution_duration_monitoring and elapsed > allowed:
                    raise PlanningError(ErrorCode.TIMED_OUT, f"the motion should take {duration_s:.2f} s and was not "
                                        f"done after {elapsed:.2f} s (allowed {allowed:.2f} s); waiting for "
                                        f"{', '.join(part.controller.name for part in open_parts)}")
                open_parts = [part for part in open_parts if not self._is_done(part)]
                cancelled.wait(POLL_S)
        except PlanningError:
            for part in open_parts:
                self._clients[part.controller.name].cancel_goal()
            raise

    def _is_done(self, part: _Part) -> bool:
        client = self._clients[part.controller.name]
        # the status of the goal is final some time before its result is here; DONE means that both are
        if client.simple_state != actionlib.SimpleGoalState.DONE:
            return False
        state = client.get_state()
        result = client.get_result()
        if state == GoalStatus.SUCCEEDED and getattr(result, "error_code", 0) == 0:
            return True
        if state == GoalStatus.SUCCEEDED and part.controller.kind == "GripperCommand":
            return True
        code = getattr(result, "error_code", None)
        text = getattr(result, "error_string", "") or client.get_goal_status_text()
        raise PlanningError(ErrorCode.PREEMPTED if state == GoalStatus.PREEMPTED else ErrorCode.CONTROL_FAILED,
                            f"controller '{part.controller.name}' ended with {GoalStatus.to_string(state)}"
                            f"{'' if code is None else f', error_code {code}'}: {text or 'no text'}")

    def _settle(self, joint_names: list[str]) -> None:
        """Waits until the joints stand still, so that the next plan starts from where the robot stays."""
        index = self._monitor.model.index
        numbers = [index[name] for name in joint_names if name in index]
        end = rospy.Time.now() + rospy.Duration(SETTLE_TIMEOUT_S)
        before = self._monitor.positions()[numbers]
        while rospy.Time.now() < end and self._monitor.wait_for_next_state(SETTLE_TIMEOUT_S):
            now = self._monitor.positions()[numbers]
            if np.abs(now - before).max() < SETTLED_RAD:
                return
            before = now


def _is_connected(client: actionlib.ActionClient) -> bool:
    """Whether an action server listens to all that a client says, and the client to all that it says."""
    ends = (client.pub_goal, client.pub_cancel, client.result_sub, client.feedback_sub, client.status_sub)
    return all(end.get_num_connections() > 0 for end in ends)


def _check_message(motion: JointTrajectory) -> None:
    """Refuses trajectories no controller could follow; raises PlanningError."""
    count = len(motion.joint_names)
    if motion.points and not count:
        raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, f"trajectory: {len(motion.points)} points but no "
                            "joint_names; name the joint of each position")
    before = -1.0
    for number, point in enumerate(motion.points):
        stamp = point.time_from_start.to_sec()
        if len(point.positions) != count or not np.isfinite(point.positions).all():
            raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, f"trajectory point {number}: {len(point.positions)} "
                                f"positions for {count} joints, all must be finite")
        if stamp <= before:
            raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, f"trajectory point {number} at {stamp} s does not come "
                                f"after the one before at {before} s; times must strictly increase")
        before = stamp


def _columns(motion: JointTrajectory, columns: list[int]) -> JointTrajectory:
    part = JointTrajectory(joint_names=[motion.joint_names[i] for i in columns])
    part.header.frame_id = motion.header.frame_id
    for point in motion.points:
        part.points.append(JointTrajectoryPoint(
            *([values[i] for i in columns] if values else [] for values in
              (point.positions, point.velocities, point.accelerations, point.effort)),
            point.time_from_start))
    return part


def _goal(part: _Part) -> Any:
    if part.controller.kind == "GripperCommand":
        goal = GripperCommandGoal()
        goal.command.position = part.trajectory.points[-1].positions[0]
        goal.command.max_effort = part.controller.max_effort
        return goal
    return FollowJointTrajectoryGoal(trajectory=part.trajectory)
