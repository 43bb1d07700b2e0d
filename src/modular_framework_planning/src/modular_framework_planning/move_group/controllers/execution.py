# SPDX-License-Identifier: BSD-3-Clause
"""Executes trajectories: chooses controllers, checks the start state, monitors the duration, reacts to stop events."""

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
    POLL_S,
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
from modular_framework_ros.calls import wait_until

SETTLE_TIMEOUT_S = 1.0
SETTLED_RAD = 1.0e-4
SETTLE_STATES = round(SETTLE_TIMEOUT_S / STATE_PERIOD_S)
"""Most states that are waited for where time is held."""
STOP_TIMEOUT_S = 1.0
BEGIN_TIMEOUT_S = 5.0
START_STATE_TIMEOUT_S = 0.5
STALL_S = 0.25
"""Pause between two polls of a motion after which this process is taken to have stood still [s]."""
AFTER_STALL_S = 0.5
"""Time in which the ends of motions that came during a stall are received [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """A motion under way.

    Attributes:
        joints: All joints of its controllers.
        path: Where it goes; None where nobody watches it.
        stop: Set to stop it.
        admitted: Set when it may begin.
    """

    joints: frozenset[str]
    path: PathWatch | None
    stop: threading.Event = field(default_factory=threading.Event)
    admitted: threading.Event = field(default_factory=threading.Event)


Admission = Callable[[Sequence[PathWatch]], None]


def _always(_: Sequence[PathWatch]) -> None:
    """Lets a motion begin whatever moves."""


class _Stalls:
    """Notices pauses of this process, which then knows of the ends of motions later than they were sent."""

    def __init__(self) -> None:
        self._polled_s = self._over_s = time.monotonic()

    def are_over(self) -> bool:
        """Returns whether nothing that arrived during a stall is still to be received; to be called at each poll."""
        now_s = time.monotonic()
        if now_s - self._polled_s > STALL_S:
            self._over_s = now_s + AFTER_STALL_S
        self._polled_s = now_s
        return now_s >= self._over_s


class TrajectoryExecution:
    """Executes motions; several at the same time where their controllers share no joints.

    Subscribes: trajectory_execution_event (std_msgs/String "stop").

    Args:
        manager: the controllers; None where this node is only to plan.
    """

    def __init__(self, manager: ControllerManager | None, settings: ExecutionSettings, monitor: SceneMonitor) -> None:
        self.manager = manager
        self.settings = settings
        self._monitor = monitor
        self._motions: list[_Motion] = []
        self._ended = threading.Condition()

    def connect(self) -> None:
        """Subscribes to stop events and starts to connect to the controllers."""
        rospy.Subscriber(names.EXECUTION_EVENT_TOPIC, String, self._on_event, queue_size=5)
        if self.manager is not None:
            self.manager.connect()

    def close(self) -> None:
        """Stops all motions and waits until they have stopped; to be called while topics are still open."""
        self._stop_all()
        with self._ended:
            self._ended.wait_for(lambda: not self._motions, timeout=STOP_TIMEOUT_S)

    def _stop_all(self) -> None:
        with self._ended:
            for motion in self._motions:
                motion.stop.set()

    def _on_event(self, message: String) -> None:
        if message.data == "stop":
            rospy.loginfo("trajectory_execution_event: stopping what moves")
            self._stop_all()
        else:
            rospy.logwarn(
                "%s: event '%s' is not known; known: stop",
                rospy.resolve_name(names.EXECUTION_EVENT_TOPIC),
                message.data,
            )

    def describe(self) -> str:
        """Describes the controllers that execute motions."""
        return "no execution of motions" if self.manager is None else self.manager.describe()

    def others(self, path: PathWatch) -> list[PathWatch]:
        """Returns the paths of the motions under way other than this one."""
        with self._ended:
            known = [motion.path for motion in self._motions if motion.admitted.is_set()]
        return [other for other in known if other is not None and other is not path]

    def execute(
        self,
        trajectory: Any,
        cancelled: threading.Event,
        path: PathWatch | None = None,
        admit: Admission = _always,
    ) -> None:
        """Executes a RobotTrajectory and returns when the robot is there.

        Args:
            trajectory: the message.
            cancelled: set to stop it.
            path: where it goes, for motions beside it.
            admit: called with the paths of the motions that came before it; raises PlanningError to refuse it.

        Raises:
            PlanningError: what went wrong, with the controller's own message where it sent one.
        """
        if self.manager is None:
            raise PlanningError(
                ErrorCode.CONTROL_FAILED,
                f"{rospy.resolve_name('~allow_trajectory_execution')} is false: this move_group plans only",
            )
        if trajectory.multi_dof_joint_trajectory.points:
            raise PlanningError(
                ErrorCode.INVALID_MOTION_PLAN,
                f"multi_dof_joint_trajectory of {', '.join(trajectory.multi_dof_joint_trajectory.joint_names)}: no "
                "controller of move_group moves a planar or floating joint; hand it to that of the base, and plan for "
                "a group without the joint to move the rest here",
            )
        check_trajectory(trajectory.joint_trajectory)
        if not trajectory.joint_trajectory.points:
            return
        motion = at_speed(trajectory.joint_trajectory, self.settings.execution_velocity_scaling)
        parts = self._parts(motion, self.manager)
        joints = frozenset(joint for part in parts for joint in part.controller.joints)
        with self._entered(_Motion(joints, path), admit) as stop:
            self._check_start(motion)
            if self._is_there_already(motion, parts):
                return
            self.manager.prepare(parts)
            try:
                self._run(parts, self.manager, _delay_s(motion), cancelled, stop)
            finally:  # a motion that was stopped, too: the goal that takes its place begins where the robot stays
                if self.settings.wait_for_trajectory_completion and not rospy.is_shutdown():
                    self._settle(motion.joint_names)

    @contextmanager
    def _entered(self, entered: _Motion, admit: Admission) -> Iterator[threading.Event]:
        """Enters a motion; yields the event that stops it.

        Raises:
            PlanningError: another motion moves one of its joints, or it was not admitted beside the others.
        """
        with self._ended:
            busy = sorted({joint for motion in self._motions for joint in motion.joints & entered.joints})
            if busy:
                raise PlanningError(
                    ErrorCode.CONTROL_FAILED,
                    f"another motion of {', '.join(busy)} is under way; wait for its end or stop it",
                )
            others = [motion.path for motion in self._motions if motion.path is not None]
            self._motions.append(entered)
        try:
            admit(others)
            entered.admitted.set()
            yield entered.stop
        finally:
            with self._ended:
                self._motions.remove(entered)
                self._ended.notify_all()

    def _parts(self, motion: JointTrajectory, manager: ControllerManager) -> list[MotionPart]:
        followers = self._monitor.model.follower_joints
        joints = [joint for joint in motion.joint_names if joint not in followers]
        return split(
            motion, choose_controllers(joints or motion.joint_names, manager.controllers(), manager.may_switch)
        )

    def _check_start(self, motion: JointTrajectory) -> None:
        if not any(self.settings.start_tolerance(joint) > 0.0 for joint in motion.joint_names):
            return
        self._monitor.wait_for_state()
        away = self._far_joint(motion)
        if away and self._monitor.wait_for_next_state(START_STATE_TIMEOUT_S):
            away = self._far_joint(motion)
        if away:
            raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, away)

    def _far_joint(self, motion: JointTrajectory) -> str:
        """Says which joint is furthest beyond its tolerance from the first point; empty where none is."""
        model, now = self._monitor.model, self._monitor.positions()
        worst, sentence = 0.0, ""
        for joint, wanted in zip(motion.joint_names, motion.points[0].positions, strict=True):
            tolerance, number = self.settings.start_tolerance(joint), model.index.get(joint)
            if number is None or tolerance <= 0.0:
                continue
            gap = now[number] - wanted
            gap = abs(math.remainder(gap, math.tau) if model.is_continuous(number) else gap)
            if gap > max(worst, tolerance):
                worst = gap
                sentence = (
                    f"joint '{joint}' is {gap:.4f} from the trajectory's first point (allowed_start_tolerance "
                    f"{tolerance}); plan again from the current state"
                )
        return sentence

    def _is_there_already(self, motion: JointTrajectory, parts: list[MotionPart]) -> bool:
        """Whether a motion ends where it starts and was seen to start where the robot is.

        Controllers refuse such a motion: its only point is due at once. Grippers do not: their goal is also a force.
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
        begun = rospy.Time.now()
        running: list[tuple[MotionPart, RunningMotion]] = []
        try:
            # with held time all parts begin at the same time; one part needs no hold
            with self._monitor.time.held("begin of a motion", during_motions=True) if len(parts) > 1 else nullcontext():
                for part in parts:
                    running.append((part, manager.begin(part)))
                if len(parts) > 1 and self._monitor.time.enabled:
                    wait_until(lambda: all(motion.has_begun() for _, motion in running), BEGIN_TIMEOUT_S)
            stalls = _Stalls()
            while running:
                if cancelled.is_set() or stop.is_set() or rospy.is_shutdown():
                    raise PlanningError(ErrorCode.PREEMPTED, "the motion was stopped on request")
                running = [item for item in running if not item[1].is_done()]
                if stalls.are_over():
                    self._check_time([part for part, _ in running], (rospy.Time.now() - begun).to_sec() - delay_s)
                cancelled.wait(POLL_S)
        finally:
            for _, motion in running:
                motion.cancel()

    def _check_time(self, parts: list[MotionPart], elapsed_s: float) -> None:
        for part in parts if self.settings.execution_duration_monitoring else ():
            if part.controller.kind in FAKE_KINDS:
                continue  # they end by themselves, and joint_states shows that as late as the machine is busy
            scaling, margin_s = part.controller.duration_scaling, part.controller.duration_margin
            allowed_s = part.duration_s * (
                self.settings.allowed_execution_duration_scaling if scaling is None else scaling
            )
            allowed_s += self.settings.allowed_goal_duration_margin if margin_s is None else margin_s
            if elapsed_s > allowed_s:
                raise PlanningError(
                    ErrorCode.TIMED_OUT,
                    f"the motion should take {part.duration_s:.2f} s and was not "
                    f"done after {elapsed_s:.2f} s (allowed {allowed_s:.2f} s); waiting for "
                    f"{', '.join(late.controller.name for late in parts)}",
                )

    def _settle(self, joint_names: list[str]) -> None:
        """Waits until the joints stand still, so that the next plan starts from where the robot stays."""
        monitor, index = self._monitor, self._monitor.model.index
        numbers = [index[name] for name in joint_names if name in index]
        monitor.catch_up()  # where time is held, the same states are compared whenever messages arrive
        end, states = rospy.Time.now() + rospy.Duration(SETTLE_TIMEOUT_S), 0
        before = monitor.positions()[numbers]
        while states < SETTLE_STATES if monitor.time.enabled else rospy.Time.now() < end:
            if not monitor.wait_for_next_state(SETTLE_TIMEOUT_S):
                return
            states += 1
            now = monitor.positions()[numbers]
            if np.abs(now - before).max() < SETTLED_RAD:
                return
            before = now


def _delay_s(motion: JointTrajectory) -> float:
    """Returns how long a motion that is to begin at a given time still has to wait [s]."""
    stamp = motion.header.stamp
    return 0.0 if stamp.is_zero() else max((stamp - rospy.Time.now()).to_sec(), 0.0)


def load_execution(monitor: SceneMonitor) -> TrajectoryExecution:
    """Builds the executor from ~trajectory_execution, ~allow_trajectory_execution and ~moveit_controller_manager.

    Raises:
        ModelError: a controller manager of that name does not exist.
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
            only = parameter("~ros_control_namespace") if known == ROS_CONTROL_MANAGER else None
            may_switch = parameter("~moveit_manage_controllers")
            return RosControlControllers(listed_controllers(), only, may_switch, timeout_s)
    raise ModelError(
        f"parameter {rospy.resolve_name('~moveit_controller_manager')}: '{name}' is not known; known: "
        f"{', '.join(CONTROLLER_MANAGERS)}"
    )
