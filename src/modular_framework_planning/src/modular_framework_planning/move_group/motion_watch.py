# SPDX-License-Identifier: BSD-3-Clause
"""Monitored execution of a motion: stops when the path becomes blocked, and records the measured positions."""

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

PERIOD_S = 0.05  # period of the scene checks
TIME_SHIFTS_S = (-0.1, 0.0, 0.1)  # delays of a running motion that are checked before another motion starts
JOIN_TIMEOUT_S = 5.0


class _StopRequest(threading.Event):
    """An event that is set by the watch of a motion, or by the client's cancellation."""

    def __init__(self, cancelled: threading.Event) -> None:
        super().__init__()
        self._cancelled = cancelled

    def is_set(self) -> bool:
        """Returns whether the motion must stop."""
        return super().is_set() or self._cancelled.is_set()


class WatchedMotion:
    """Executes one motion and records the measured trajectory in `executed`, also after a failure.

    The motion is refused or stopped if its remaining path would hit another part of the robot. Joints that another
    motion moves are assumed to follow that motion; all other joints are assumed to stay.
    """

    def __init__(
        self,
        context: MoveGroupContext,
        trajectory: Any,
        planned_in: PlanningScene,
        change: SceneChange | None,
    ) -> None:
        """Prepares a motion.

        Args:
            context: Shared parts of the node.
            trajectory: moveit_msgs/RobotTrajectory.
            planned_in: Snapshot of the monitored scene just before planning.
            change: Scene change that applied to this plan only; None if the plan is unknown, in which case changes of
                the world do not stop the motion.

        Raises:
            PlanningError: A point of the trajectory is malformed.
        """
        self._context, self._trajectory, self._change = context, trajectory, change
        motion = trajectory.joint_trajectory
        check_trajectory(motion)
        columns = [column for column, name in enumerate(motion.joint_names) if name in context.model.index]
        self._joints = [motion.joint_names[column] for column in columns]
        self._watch: PathWatch | None = None
        self._rows = np.empty((0, len(columns)))
        if motion.points and columns:
            rows = np.array([point.positions for point in motion.points], dtype=float)[:, columns]
            times = [point.time_from_start.to_sec() for point in motion.points]
            times = np.array(times) / context.execution.settings.execution_velocity_scaling
            scene, was_planned = self._as_planned(planned_in), change is not None
            self._rows = rows
            self._watch = PathWatch(
                self._joints, times, rows, scene, new_checker=context.new_checker, was_planned=was_planned
            )
        self._seen_version = planned_in.geometry_version
        self._watching = threading.Lock()
        self._done = threading.Event()
        self._blocked = ""
        self._hit: PathCollision | None = None
        frequency = context.settings.plan_execution.record_trajectory_state_frequency
        self._period_s = 1.0 / frequency if frequency > 0.0 else math.inf
        self._start = rospy.Time.now()
        self.executed = RobotTrajectory()
        self.executed.joint_trajectory.joint_names = self._joints
        self.executed.joint_trajectory.header.frame_id = motion.header.frame_id

    def execute(self, cancelled: threading.Event) -> None:
        """Executes the motion to its end.

        Raises:
            PlanningError: MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE if the path became blocked, PREEMPTED if the
                client cancelled the motion, else the error of the execution.
        """
        if self._watch is None:
            self._context.execution.execute(self._trajectory, cancelled)
            return
        self._check_scene(self._context.monitor.snapshot())
        self._raise_if_blocked()
        self._start = rospy.Time.now()
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
            self._done.set()
            watcher.join(JOIN_TIMEOUT_S)
            self._record()

    def _as_planned(self, scene: PlanningScene) -> PlanningScene:
        """Returns the scene with the changes that applied to this plan only, such as allowed collisions."""
        return scene if self._change is None else self._change(scene)

    def _raise_if_blocked(self) -> None:
        if self._blocked:
            raise PlanningError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                f"{self._blocked}{f': {self._hit.describe()}' if self._hit else ''}; plan again, or set replan",
            )

    def _admit(self, others: Sequence[PathWatch]) -> None:
        """Checks that the motion hits neither the paths of running motions nor joints that moved; raises PlanningError.

        No other check of other joints precedes the start, so a refused start always names the running motion.
        """
        assert self._watch is not None
        scene = self._context.monitor.snapshot()
        if not others:
            self._check_other_joints(scene)
            self._raise_if_blocked()
            return
        with self._watching:
            hit = self._watch.robot_collision(self._as_planned(scene), others, TIME_SHIFTS_S)
        if hit is not None:
            raise PlanningError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                f"the motion would collide with a running motion: {hit.describe()}; wait until the running motion "
                "ends, and plan again",
            )

    def _monitor(self, stop: threading.Event) -> None:
        with self._context.markers.shown_motion(self._context.monitor.snapshot(), self._joints, self._rows):
            self._watch_until_end(stop)

    def _watch_until_end(self, stop: threading.Event) -> None:
        pause_s, due_s = min(PERIOD_S, self._period_s), time.monotonic() + self._period_s
        while not self._done.is_set():
            if time.monotonic() >= due_s:
                due_s = time.monotonic() + self._period_s
                self._record()
            try:
                self._check()
            except Exception as error:  # noqa: BLE001 - an unmonitored motion must stop
                self._blocked = f"monitoring the motion failed with {type(error).__name__}: {error}"
            if self._blocked:
                stop.set()
            self._done.wait(pause_s)

    def _check(self) -> None:
        scene = self._context.monitor.snapshot()
        self._check_scene(scene)
        self._check_other_joints(scene)

    def _check_scene(self, scene: PlanningScene) -> None:
        """Checks the remaining path if the geometry of the scene changed."""
        watch = self._watch
        assert watch is not None
        with self._watching:
            watch.advance(scene.positions)
            if self._change is not None and scene.geometry_version != self._seen_version:
                self._seen_version = scene.geometry_version
                self._hit = watch.scene_collision(self._as_planned(scene))
                if self._hit is not None:
                    self._blocked = "the scene changed and blocks the remaining motion"

    def _check_other_joints(self, scene: PlanningScene) -> None:
        """Checks the remaining path if joints outside the motion moved."""
        watch = self._watch
        assert watch is not None
        with self._watching:
            if self._hit is None and watch.other_joints_moved(scene.positions):
                others = self._context.execution.other_paths(watch)
                self._hit = watch.robot_collision(self._as_planned(scene), others)
                if self._hit is not None:
                    self._blocked = "another part of the robot moved and blocks the remaining motion"

    def _record(self) -> None:
        """Records the measured positions, at most once per time stamp."""
        if math.isinf(self._period_s):
            return
        stamp = rospy.Time.now() - self._start
        points = self.executed.joint_trajectory.points
        if points and stamp <= points[-1].time_from_start:
            return
        model, positions = self._context.model, self._context.monitor.positions()
        points.append(
            JointTrajectoryPoint(
                positions=[float(positions[model.index[name]]) for name in self._joints], time_from_start=stamp
            )
        )
