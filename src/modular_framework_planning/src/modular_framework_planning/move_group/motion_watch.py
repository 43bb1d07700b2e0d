# SPDX-License-Identifier: BSD-3-Clause
"""Executes a motion, stops it when the scene or another motion gets in its way, and records what was measured."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import rospy
from moveit_msgs.msg import RobotTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.execution_messages import check_trajectory
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.planning_scene.planning_scene import PlanningScene, SceneChange
from modular_framework_planning.trajectory_execution.path_watch import PathCollision, PathWatch

PERIOD_S = 0.05  # between two checks of the scene
SLACKS_S = (-0.1, 0.0, 0.1)  # by how much a motion under way may be late or early before one beside it is begun
JOIN_TIMEOUT_S = 5.0


class _StopRequest(threading.Event):
    """Set by the watch of a motion, or with the event by which the client gives it up."""

    def __init__(self, cancelled: threading.Event) -> None:
        super().__init__()
        self._cancelled = cancelled

    def is_set(self) -> bool:
        """Returns whether the motion is to stop."""
        return super().is_set() or self._cancelled.is_set()


class WatchedMotion:
    """One execution of one motion; `executed` holds what was measured, also after a failure.

    It is not begun, and is stopped, where the rest of it would hit another part of the robot: joints that another
    motion moves are taken to be where that motion will bring them, all others where they are.
    """

    def __init__(
        self,
        context: MoveGroupContext,
        trajectory: Any,
        planned_in: PlanningScene,
        change: SceneChange | None,
    ) -> None:
        """Takes a motion.

        Args:
            context: of the node.
            trajectory: moveit_msgs/RobotTrajectory as planned.
            planned_in: snapshot of the monitored scene from just before the motion was planned.
            change: what the plan changed in that scene for itself alone; None: nothing is known of the plan, so a
                change of the world does not stop the motion.

        Raises:
            PlanningError: a point of the trajectory is malformed.
        """
        self._context, self._trajectory, self._change = context, trajectory, change
        motion = trajectory.joint_trajectory
        check_trajectory(motion)
        columns = [number for number, name in enumerate(motion.joint_names) if name in context.model.index]
        self._joints = [motion.joint_names[number] for number in columns]
        self._watch: PathWatch | None = None
        self._rows = np.empty((0, len(columns)))
        if motion.points and columns:
            rows = np.array([point.positions for point in motion.points], dtype=float)[:, columns]
            times = [point.time_from_start.to_sec() for point in motion.points]
            times = np.array(times) / context.execution.settings.execution_velocity_scaling
            seen, was_planned = self._as_planned(planned_in), change is not None
            self._rows = rows
            self._watch = PathWatch(self._joints, times, rows, seen, context.new_checker, was_planned)
        self._seen_version = planned_in.geometry_version
        self._watching = threading.Lock()
        self._ended = threading.Event()
        self._blocked = ""
        self._hit: PathCollision | None = None
        frequency = context.settings.plan_execution.record_trajectory_state_frequency
        self._period_s = 1.0 / frequency if frequency > 0.0 else math.inf
        self._begun = rospy.Time.now()
        self.executed = RobotTrajectory()
        self.executed.joint_trajectory.joint_names = self._joints
        self.executed.joint_trajectory.header.frame_id = motion.header.frame_id

    def execute(self, cancelled: threading.Event) -> None:
        """Executes and returns when the robot is there.

        Raises:
            PlanningError: MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE where the scene or another part of the robot
                got in the way, PREEMPTED where it was cancelled, else what the execution says.
        """
        if self._watch is None:
            self._context.execution.execute(self._trajectory, cancelled)
            return
        self._check()
        self._raise_if_blocked()
        self._begun = rospy.Time.now()
        self._record()
        stop = _StopRequest(cancelled)
        watcher = threading.Thread(target=self._monitor, args=(stop,), daemon=True)
        watcher.start()
        try:
            self._context.execution.execute(self._trajectory, stop, self._watch, self._admit)
        except PlanningError as error:
            if error.code == ErrorCode.PREEMPTED and not cancelled.is_set():
                self._raise_if_blocked()
            raise
        finally:
            self._ended.set()
            watcher.join(JOIN_TIMEOUT_S)
            self._record()

    def _as_planned(self, scene: PlanningScene) -> PlanningScene:
        """Returns a scene with what the plan changed in it for itself alone, such as collisions it allowed."""
        return scene if self._change is None else self._change(scene)

    def _raise_if_blocked(self) -> None:
        if self._blocked:
            raise PlanningError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                f"{self._blocked}{f': {self._hit.describe()}' if self._hit else ''}; plan again, or ask for replan",
            )

    def _admit(self, others: Sequence[PathWatch]) -> None:
        """Refuses to begin beside other motions that this one would hit; raises PlanningError."""
        if not others or self._watch is None:
            return
        with self._watching:
            hit = self._watch.robot_collision(self._as_planned(self._context.monitor.snapshot()), others, SLACKS_S)
        if hit is not None:
            raise PlanningError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                f"the motion would hit what another motion is moving: {hit.describe()}; wait for the end of "
                "that one, and plan again",
            )

    def _monitor(self, stop: threading.Event) -> None:
        with self._context.markers.shown_motion(self._context.monitor.snapshot(), self._joints, self._rows):
            self._watch_until_end(stop)

    def _watch_until_end(self, stop: threading.Event) -> None:
        pause_s, due_s = min(PERIOD_S, self._period_s), time.monotonic() + self._period_s
        while not self._ended.is_set():
            if time.monotonic() >= due_s:
                due_s = time.monotonic() + self._period_s
                self._record()
            try:
                self._check()
            except Exception as error:  # noqa: BLE001 - a motion nobody can watch any more must stop
                self._blocked = f"watching it failed with {type(error).__name__}: {error}"
            if self._blocked:
                stop.set()
            self._ended.wait(pause_s)

    def _check(self) -> None:
        """Checks what is left of the motion when the geometry of the scene changed, or other joints moved."""
        scene, watch = self._context.monitor.snapshot(), self._watch
        assert watch is not None
        with self._watching:
            watch.advance(scene.positions)
            if self._change is not None and scene.geometry_version != self._seen_version:
                self._seen_version = scene.geometry_version
                self._hit = watch.scene_collision(self._as_planned(scene))
                if self._hit is not None:
                    self._blocked = "the scene changed and the rest of the motion is blocked"
            if self._hit is None and watch.other_joints_moved(scene.positions):
                others = self._context.execution.others(watch)
                self._hit = watch.robot_collision(self._as_planned(scene), others)
                if self._hit is not None:
                    self._blocked = "another part of the robot moved and the rest of the motion would hit it"

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
