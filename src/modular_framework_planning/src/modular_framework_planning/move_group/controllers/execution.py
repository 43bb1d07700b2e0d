# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory execution: controller selection, start state check, duration monitoring and stop events."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import rospy
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from modular_framework_planning.errors import ErrorCode, ModelError, PlanningError
from modular_framework_planning.messages.execution_messages import MotionPart, at_speed, check_trajectory, split
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.controllers.action_controllers import (
    ActionControllers,
    ControllerManager,
    RunningMotion,
    listed_controllers,
)
from modular_framework_planning.move_group.controllers.fake_controllers import FakeControllers
from modular_framework_planning.move_group.controllers.ros_control import RosControlControllers
from modular_framework_planning.move_group.monitors.scene_monitor import STATE_PERIOD_S, SceneMonitor
from modular_framework_planning.move_group.node_parameters import parameter, settings_below
from modular_framework_planning.move_group.plugin_names import (
    ALL_ROS_CONTROL_MANAGERS,
    CONTROLLER_MANAGERS,
    FAKE_MANAGER,
    ROS_CONTROL_MANAGER,
    SIMPLE_MANAGER,
)
from modular_framework_planning.trajectory_execution.controllers import FAKE_KINDS, GRIPPER, choose_controllers
from modular_framework_planning.trajectory_execution.execution_settings import ExecutionSettings
from modular_framework_planning.trajectory_execution.path_watch import PathWatch
from modular_framework_ros.allowed_names import nearest
from modular_framework_ros.calls import POLL_PERIOD_S, wait_until

SETTLE_TIMEOUT_S = 1.0
SETTLED_RAD = 1.0e-4
SETTLE_STATES = round(SETTLE_TIMEOUT_S / STATE_PERIOD_S)
"""Maximum number of states to wait for if simulated time is held."""
STOP_TIMEOUT_S = 1.0
BEGIN_TIMEOUT_S = 5.0
START_STATE_TIMEOUT_S = 0.5
STALL_S = 0.25
"""Time between two polls of a motion from which this process counts as stalled [s]."""
AFTER_STALL_S = 0.5
"""Time after a stall to receive delayed results of motions [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """A running motion.

    Attributes:
        joints: All joints of the motion's controllers.
        path: Path of the motion; None if the motion is not monitored.
        stop: Event that stops the motion.
        admitted: Event that is set when the motion may start.
    """

    joints: frozenset[str]
    path: PathWatch | None
    stop: threading.Event = field(default_factory=threading.Event)
    admitted: threading.Event = field(default_factory=threading.Event)


Admission = Callable[[Sequence[PathWatch]], None]


def _admit_always(_: Sequence[PathWatch]) -> None:
    """Admits every motion."""


class _StallDetector:
    """Detects stalls of this process, after which results of motions arrive late."""

    def __init__(self) -> None:
        self._last_poll_s = self._recovered_s = time.monotonic()

    def are_over(self) -> bool:
        """Returns whether all results delayed by a stall should have arrived; must be called at each poll."""
        now_s = time.monotonic()
        if now_s - self._last_poll_s > STALL_S:
            self._recovered_s = now_s + AFTER_STALL_S
        self._last_poll_s = now_s
        return now_s >= self._recovered_s


class TrajectoryExecution:
    """Executes motions, simultaneously if their controllers share no joints.

    Subscribes: trajectory_execution_event (std_msgs/String "stop").

    Args:
        manager: Controllers; None if this node only plans.
        settings: Execution settings; may be replaced at runtime.
        monitor: Scene monitor, for the current joint positions.
    """

    def __init__(self, manager: ControllerManager | None, settings: ExecutionSettings, monitor: SceneMonitor) -> None:
        self.manager = manager
        self.settings = settings
        self._monitor = monitor
        self._motions: list[_Motion] = []
        self._ended = threading.Condition()

    def connect(self) -> None:
        """Subscribes to stop events and starts connecting to the controllers."""
        rospy.Subscriber(names.EXECUTION_EVENT_TOPIC, String, self._on_event, queue_size=5)
        if self.manager is not None:
            self.manager.connect()

    def close(self) -> None:
        """Stops all motions and waits until they have stopped; must be called while topics are open."""
        self._stop_all()
        with self._ended:
            self._ended.wait_for(lambda: not self._motions, timeout=STOP_TIMEOUT_S)

    def _stop_all(self) -> None:
        with self._ended:
            for motion in self._motions:
                motion.stop.set()

    def _on_event(self, message: String) -> None:
        if message.data == "stop":
            rospy.loginfo("trajectory_execution_event: stopping all motions")
            self._stop_all()
        else:
            rospy.logwarn(
                "%s: unknown event '%s'; known: stop",
                rospy.resolve_name(names.EXECUTION_EVENT_TOPIC),
                message.data,
            )

    def describe(self) -> str:
        """Returns a description of the controllers for the log."""
        return "no execution of motions" if self.manager is None else self.manager.describe()

    def other_paths(self, path: PathWatch) -> list[PathWatch]:
        """Returns the paths of all other running motions."""
        with self._ended:
            paths = [motion.path for motion in self._motions if motion.admitted.is_set()]
        return [other for other in paths if other is not None and other is not path]

    def execute(
        self,
        trajectory: Any,
        cancelled: threading.Event,
        path: PathWatch | None = None,
        admit: Admission = _admit_always,
    ) -> None:
        """Executes a trajectory to its end.

        Args:
            trajectory: moveit_msgs/RobotTrajectory.
            cancelled: Event that stops the motion.
            path: Path of the motion, for checks of simultaneous motions.
            admit: Function called with the paths of earlier motions; raises PlanningError to refuse the motion.

        Raises:
            PlanningError: Execution failed; the reason includes the controller's message, if any.
        """
        if self.manager is None:
            raise PlanningError(
                ErrorCode.CONTROL_FAILED,
                f"{rospy.resolve_name('~allow_trajectory_execution')} is false: this move_group only plans",
            )
        if trajectory.multi_dof_joint_trajectory.points:
            raise PlanningError(
                ErrorCode.INVALID_MOTION_PLAN,
                f"multi_dof_joint_trajectory of {', '.join(trajectory.multi_dof_joint_trajectory.joint_names)}: no "
                "controller of move_group moves a planar or floating joint; send the trajectory to the controller of "
                "the base, and plan the other joints in a group without this joint",
            )
        check_trajectory(trajectory.joint_trajectory)
        if not trajectory.joint_trajectory.points:
            return
        motion = at_speed(trajectory.joint_trajectory, self.settings.execution_velocity_scaling)
        parts = self._motion_parts(motion, self.manager)
        joints = frozenset(joint for part in parts for joint in part.controller.joints)
        with self._registered_motion(_Motion(joints, path), admit) as stop:
            self._check_start(motion)
            if self._is_there_already(motion, parts):
                return
            self.manager.prepare(parts)
            try:
                self._run(parts, self.manager, _delay_s(motion), cancelled, stop)
            finally:  # stops too, because the next goal starts at the robot's rest position
                if self.settings.wait_for_trajectory_completion and not rospy.is_shutdown():
                    self._settle(motion.joint_names)

    @contextmanager
    def _registered_motion(self, new_motion: _Motion, admit: Admission) -> Iterator[threading.Event]:
        """Registers a motion and yields the event that stops the motion.

        Raises:
            PlanningError: Another motion moves one of the joints, or the motion was refused.
        """
        with self._ended:
            busy = sorted({joint for motion in self._motions for joint in motion.joints & new_motion.joints})
            if busy:
                raise PlanningError(
                    ErrorCode.CONTROL_FAILED,
                    f"another motion of {', '.join(busy)} is running; wait for its end or stop it",
                )
            others = [motion.path for motion in self._motions if motion.path is not None]
            self._motions.append(new_motion)
        try:
            admit(others)
            new_motion.admitted.set()
            yield new_motion.stop
        finally:
            with self._ended:
                self._motions.remove(new_motion)
                self._ended.notify_all()

    def _motion_parts(self, motion: JointTrajectory, manager: ControllerManager) -> list[MotionPart]:
        followers = self._monitor.model.follower_joints
        joints = [joint for joint in motion.joint_names if joint not in followers]
        return split(
            motion, choose_controllers(joints or motion.joint_names, manager.controllers(), manager.may_switch)
        )

    def _check_start(self, motion: JointTrajectory) -> None:
        if not any(self.settings.start_tolerance(joint) > 0.0 for joint in motion.joint_names):
            return
        self._monitor.wait_for_state()
        deviation = self._start_deviation(motion)
        if deviation and self._monitor.wait_for_next_state(START_STATE_TIMEOUT_S):
            deviation = self._start_deviation(motion)
        if deviation:
            raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, deviation)

    def _start_deviation(self, motion: JointTrajectory) -> str:
        """Returns a message on the joint with the largest deviation above tolerance from the first point, or ""."""
        model, current = self._monitor.model, self._monitor.positions()
        max_deviation, message = 0.0, ""
        for joint, position in zip(motion.joint_names, motion.points[0].positions, strict=True):
            tolerance, index = self.settings.start_tolerance(joint), model.index.get(joint)
            if index is None or tolerance <= 0.0:
                continue
            deviation = current[index] - position
            deviation = abs(math.remainder(deviation, math.tau) if model.is_continuous(index) else deviation)
            if deviation > max(max_deviation, tolerance):
                max_deviation = deviation
                message = (
                    f"joint '{joint}' is {deviation:.4f} from the trajectory's first point (allowed_start_tolerance "
                    f"{tolerance}); plan again from the current state"
                )
        return message

    def _is_there_already(self, motion: JointTrajectory, parts: list[MotionPart]) -> bool:
        """Returns whether the motion has zero duration and the robot is at its only point.

        Trajectory controllers would refuse this motion. Grippers must execute it, because their goal is also a force.
        """
        return (
            motion.points[-1].time_from_start.to_sec() <= 0.0
            and all(self.settings.start_tolerance(joint) > 0.0 for joint in motion.joint_names)
            and all(part.controller.kind != GRIPPER for part in parts)
        )

    def _run(
        self,
        parts: list[MotionPart],
        manager: ControllerManager,
        delay_s: float,
        cancelled: threading.Event,
        stop: threading.Event,
    ) -> None:
        """Sends all parts and waits for their ends."""
        start = rospy.Time.now()
        running: list[tuple[MotionPart, RunningMotion]] = []
        try:
            # holding simulated time makes all parts start at the same time
            with self._monitor.time.held("begin of a motion", during_motions=True) if len(parts) > 1 else nullcontext():
                for part in parts:
                    running.append((part, manager.begin(part)))
                if len(parts) > 1 and self._monitor.time.enabled:
                    wait_until(lambda: all(motion.has_begun() for _, motion in running), BEGIN_TIMEOUT_S)
            stalls = _StallDetector()
            while running:
                if cancelled.is_set() or stop.is_set() or rospy.is_shutdown():
                    raise PlanningError(ErrorCode.PREEMPTED, "the motion was stopped on request")
                running = [item for item in running if not item[1].is_done()]
                if stalls.are_over():
                    self._check_time([part for part, _ in running], (rospy.Time.now() - start).to_sec() - delay_s)
                cancelled.wait(POLL_PERIOD_S)
        finally:
            for _, motion in running:
                motion.cancel()

    def _check_time(self, parts: list[MotionPart], elapsed_s: float) -> None:
        for part in parts if self.settings.execution_duration_monitoring else ():
            if part.controller.kind in FAKE_KINDS:
                continue  # fake motions always end, but joint_states shows the end late on a busy machine
            scaling, margin_s = part.controller.duration_scaling, part.controller.duration_margin
            allowed_s = part.duration_s * (
                self.settings.allowed_execution_duration_scaling if scaling is None else scaling
            )
            allowed_s += self.settings.allowed_goal_duration_margin if margin_s is None else margin_s
            if elapsed_s > allowed_s:
                raise PlanningError(
                    ErrorCode.TIMED_OUT,
                    f"the motion should take {part.duration_s:.2f} s and was not "
                    f"done after {elapsed_s:.2f} s (allowed {allowed_s:.2f} s); unfinished controllers: "
                    f"{', '.join(late.controller.name for late in parts)}",
                )

    def _settle(self, joint_names: list[str]) -> None:
        """Waits until the joints are at rest, so that the next plan starts at the robot's rest position."""
        monitor, index = self._monitor, self._monitor.model.index
        indices = [index[name] for name in joint_names if name in index]
        monitor.catch_up()  # makes the compared states independent of message delays if simulated time is held
        end, states = rospy.Time.now() + rospy.Duration(SETTLE_TIMEOUT_S), 0
        before = monitor.positions()[indices]
        while states < SETTLE_STATES if monitor.time.enabled else rospy.Time.now() < end:
            if not monitor.wait_for_next_state(SETTLE_TIMEOUT_S):
                return
            states += 1
            now = monitor.positions()[indices]
            if np.abs(now - before).max() < SETTLED_RAD:
                return
            before = now


def _delay_s(motion: JointTrajectory) -> float:
    """Returns the delay until the start time in the motion's header [s]."""
    stamp = motion.header.stamp
    return 0.0 if stamp.is_zero() else max((stamp - rospy.Time.now()).to_sec(), 0.0)


def load_execution(monitor: SceneMonitor) -> TrajectoryExecution:
    """Builds the executor from ~trajectory_execution, ~allow_trajectory_execution and ~moveit_controller_manager.

    Raises:
        ModelError: The controller manager is unknown.
    """
    settings = settings_below("trajectory_execution", ExecutionSettings)
    allowed = parameter("~allow_trajectory_execution")
    manager = _load_manager(settings.controller_connection_timeout, monitor) if allowed else None
    return TrajectoryExecution(manager, settings, monitor)


def _load_manager(timeout_s: float, monitor: SceneMonitor) -> ControllerManager:
    name = parameter("~moveit_controller_manager") or SIMPLE_MANAGER
    match name.replace("::", "/"):
        case known if known == SIMPLE_MANAGER:
            return ActionControllers(listed_controllers(), timeout_s)
        case known if known == FAKE_MANAGER:
            return FakeControllers(listed_controllers(FAKE_KINDS, FAKE_KINDS[0]), monitor)
        case known if known in (ROS_CONTROL_MANAGER, ALL_ROS_CONTROL_MANAGERS):
            namespace = parameter("~ros_control_namespace") if known == ROS_CONTROL_MANAGER else None
            may_switch = parameter("~moveit_manage_controllers")
            return RosControlControllers(listed_controllers(), namespace, may_switch, timeout_s)
    raise ModelError(
        f"parameter {rospy.resolve_name('~moveit_controller_manager')}: unknown '{name}'; known: "
        f"{', '.join(CONTROLLER_MANAGERS)}{nearest(name, CONTROLLER_MANAGERS)}"
    )
