# SPDX-License-Identifier: BSD-3-Clause
"""Executes a planned motion, stops it when a change of the scene blocks it, and records the measured trajectory."""

from __future__ import annotations

import math
import threading
import time
from typing import Any

import numpy as np
import rospy
from moveit_msgs.msg import RobotTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.planning_scene.planning_scene import PlanningScene, SceneChange
from modular_framework_planning.trajectory_execution.path_watch import PathWatch

PERIOD_S = 0.05  # between two checks of the scene
JOIN_TIMEOUT_S = 5.0


class WatchedMotion:
    """One execution of one motion; `executed` holds what was measured, also after a failure."""

    def __init__(
        self,
        context: MoveGroupContext,
        trajectory: Any,
        planned_in: PlanningScene,
        change: SceneChange,
    ) -> None:
        """Takes a motion.

        Args:
            context: of the node.
            trajectory: moveit_msgs/RobotTrajectory as planned.
            planned_in: snapshot of the monitored scene from just before the motion was planned.
            change: what the plan changed in that scene for itself alone.
        """
        self._context, self._trajectory, self._change = context, trajectory, change
        motion = trajectory.joint_trajectory
        self._joints = list(motion.joint_names)
        self._watch: PathWatch | None = None
        if motion.points:
            rows = np.array([point.positions for point in motion.points], dtype=float)
            self._watch = PathWatch(self._joints, rows, change(planned_in), context.new_checker)
            self._seen_version = planned_in.geometry_version
        self._stop, self._ended = threading.Event(), threading.Event()
        self._blocked = ""
        frequency = context.settings.plan_execution.record_trajectory_state_frequency
        self._period_s = 1.0 / frequency if frequency > 0.0 else math.inf
        self._begun = rospy.Time.now()
        self.executed = RobotTrajectory()
        self.executed.joint_trajectory.joint_names = self._joints
        self.executed.joint_trajectory.header.frame_id = motion.header.frame_id

    def execute(self, cancelled: threading.Event) -> None:
        """Executes and returns when the robot is there.

        Raises:
            PlanningError: MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE where the scene got in the way, PREEMPTED
                where it was cancelled, else what the execution says.
        """
        if self._watch is None:
            if self._trajectory.multi_dof_joint_trajectory.points:
                self._context.execution.execute(self._trajectory, self._stop)
            return
        self._check_scene()
        self._raise_if_blocked()
        self._begun = rospy.Time.now()
        self._record()
        watcher = threading.Thread(target=self._monitor, args=(cancelled,), daemon=True)
        watcher.start()
        try:
            self._context.execution.execute(self._trajectory, self._stop)
        except PlanningError as error:
            if error.code == ErrorCode.PREEMPTED and not cancelled.is_set():
                self._raise_if_blocked()
            raise
        finally:
            self._ended.set()
            watcher.join(JOIN_TIMEOUT_S)
            self._record()

    def _raise_if_blocked(self) -> None:
        if self._blocked:
            raise PlanningError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                "the scene changed and the "
                f"rest of the motion is blocked: {self._blocked}; plan again, or ask for replan",
            )

    def _monitor(self, cancelled: threading.Event) -> None:
        pause_s, due_s = min(PERIOD_S, self._period_s), time.monotonic() + self._period_s
        while not self._ended.is_set():
            if cancelled.is_set():
                self._stop.set()
            if time.monotonic() >= due_s:
                due_s = time.monotonic() + self._period_s
                self._record()
            try:
                self._check_scene()
            except Exception as error:  # noqa: BLE001 - a motion nobody can watch any more must stop
                self._blocked = f"watching it failed with {type(error).__name__}: {error}"
            if self._blocked:
                self._stop.set()
            cancelled.wait(pause_s) if not cancelled.is_set() else self._ended.wait(pause_s)

    def _check_scene(self) -> None:
        """Checks what is left of the motion when the geometry of the scene changed."""
        scene = self._context.monitor.snapshot()
        self._watch.advance(scene.positions)
        if scene.geometry_version != self._seen_version:
            self._seen_version = scene.geometry_version
            self._blocked = self._watch.blocked_by(self._change(scene))

    def _record(self) -> None:
        """Notes the measured positions, once for each instant, unless nothing is to be recorded."""
        if math.isinf(self._period_s):
            return
        stamp = rospy.Time.now() - self._begun
        points = self.executed.joint_trajectory.points
        if points and stamp <= points[-1].time_from_start:
            return
        model, positions = self._context.model, self._context.monitor.positions()
        points.append(
            JointTrajectoryPoint(
                positions=[float(positions[model.index[name]]) for name in self._joints], time_from_start=stamp
            )
        )
