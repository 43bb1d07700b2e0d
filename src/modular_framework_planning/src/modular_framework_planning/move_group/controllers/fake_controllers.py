# SPDX-License-Identifier: BSD-3-Clause
"""Fake controllers, which publish the joint positions of a trajectory without hardware or simulation."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rospy
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.execution_messages import MotionPart
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.controllers.action_controllers import RunningMotion
from modular_framework_planning.move_group.monitors.scene_monitor import SceneMonitor
from modular_framework_planning.move_group.node_parameters import parameter
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_execution.controllers import ControllerSpec
from modular_framework_ros.calls import wait_until
from modular_framework_ros.publishing import publish

SEEN_TIMEOUT_S = 5.0
SEEN_TOLERANCE = 1.0e-3  # [rad or m]


def initial_positions(model: RobotModel, entries: Any) -> tuple[dict[str, float], list[str]]:
    """Reads the parameter `initial`, a list of named poses of groups.

    Returns:
        Positions by joint name [rad or m], and a message for each invalid entry.
    """
    positions: dict[str, float] = {}
    faults: list[str] = []
    for index, entry in enumerate(entries if isinstance(entries, list) else []):
        group = str(entry.get("group", "")) if isinstance(entry, Mapping) else ""
        pose = str(entry.get("pose", "")) if isinstance(entry, Mapping) else ""
        poses = model.semantics.group_states.get(group, {})
        if pose in poses:
            base = model.base.variables if model.base else ()  # as in MoveIt, joint_states has no base joints
            values = {joint: value for joint, value in poses[pose].items() if joint in model.index}
            positions |= {joint: value for joint, value in values.items() if joint not in base}
        else:
            faults.append(
                f"initial[{index}]: group '{group}' has no pose '{pose}' in the SRDF; known poses: "
                f"{', '.join(poses) or 'none'}"
            )
    return positions, faults


class FakeControllers:
    """Publishes ~fake_controller_joint_states (sensor_msgs/JointState, latched).

    Another node (joint_state_publisher with a source_list) republishes these positions on joint_states. A motion is
    done when joint_states shows its last positions.

    Parameters: ~controller_list (name, joints, type, rate), ~initial (group, pose),
    ~fake_interpolating_controller_rate (10 Hz).
    """

    may_switch = False

    def __init__(self, specs: tuple[ControllerSpec, ...], monitor: SceneMonitor) -> None:
        self._specs = specs
        self._monitor = monitor
        self._rate = parameter("~fake_interpolating_controller_rate")
        self._publisher: Any = None

    def connect(self) -> None:
        """Publishes the initial positions and waits until joint_states shows them."""
        self._publisher = rospy.Publisher(names.FAKE_JOINT_STATES_TOPIC, JointState, queue_size=100, latch=True)
        positions, faults = initial_positions(self._monitor.model, parameter("~initial"))
        for fault in faults:
            rospy.logerr("%s", fault)
        if positions:
            message = JointState(name=list(positions), position=list(positions.values()))
            message.header.stamp = rospy.Time.now()
            self._publisher.publish(message)
            if not wait_until(lambda: not joints_off_goal(self._monitor, positions), SEEN_TIMEOUT_S):
                rospy.logwarn("%s", _not_seen("the initial positions", joints_off_goal(self._monitor, positions)))

    def describe(self) -> str:
        """Returns the number of controllers as text."""
        return f"{len(self._specs)} fake controllers"

    def controllers(self) -> tuple[ControllerSpec, ...]:
        """Returns the listed controllers."""
        return self._specs

    def prepare(self, parts: Sequence[MotionPart]) -> None:
        """Does nothing, because fake controllers are always ready."""

    def begin(self, part: MotionPart) -> RunningMotion:
        """Starts publishing the positions of a motion."""
        return FakeMotion(part, self._publisher, self._monitor, part.controller.rate or self._rate)


class FakeMotion:
    """A thread that publishes the positions of one trajectory."""

    def __init__(self, part: MotionPart, publisher: Any, monitor: SceneMonitor, rate: float) -> None:
        self._part = part
        self._publisher = publisher
        self._monitor = monitor
        self._period_s = 1.0 / rate
        self._stopped = threading.Event()
        self._published_s = 0.0
        behaviours = {"last point": self._jump, "via points": self._visit, "interpolate": self._interpolate}
        self._thread = threading.Thread(target=behaviours[part.controller.kind], daemon=True)
        self._thread.start()

    def _publish(self, positions: Sequence[float]) -> None:
        message = JointState(name=self._part.trajectory.joint_names, position=list(positions))
        message.header.stamp = rospy.Time.now()
        publish(self._publisher, message)

    def _end(self) -> None:
        self._publish(self._part.trajectory.points[-1].positions)
        self._published_s = time.monotonic()

    def _jump(self) -> None:
        self._end()

    def _visit(self) -> None:
        start = rospy.Time.now()
        for point in self._part.trajectory.points:
            while (rospy.Time.now() - start) < point.time_from_start:
                remaining_s = (point.time_from_start - (rospy.Time.now() - start)).to_sec()
                if self._stopped.wait(min(max(remaining_s, 0.0), self._period_s)):
                    return
            self._publish(point.positions)
        self._end()

    def _interpolate(self) -> None:
        start = rospy.Time.now()
        while (elapsed := (rospy.Time.now() - start).to_sec()) < self._part.duration_s:
            self._publish(positions_at(self._part.trajectory, elapsed))
            if self._stopped.wait(self._period_s):
                return
        self._end()

    def is_done(self) -> bool:
        """Returns whether joint_states shows the last positions of the motion."""
        if self._stopped.is_set():
            raise PlanningError(ErrorCode.PREEMPTED, f"fake controller '{self._part.controller.name}' was stopped")
        if not self._published_s:
            return False
        goal = dict(zip(self._part.trajectory.joint_names, self._part.trajectory.points[-1].positions, strict=True))
        missing = joints_off_goal(self._monitor, goal)
        if missing and time.monotonic() - self._published_s > SEEN_TIMEOUT_S:
            name = self._part.controller.name
            raise PlanningError(
                ErrorCode.CONTROL_FAILED, _not_seen(f"the positions of fake controller '{name}'", missing)
            )
        return not missing

    def has_begun(self) -> bool:
        """Returns True, because a fake controller starts at once."""
        return True

    def cancel(self) -> None:
        """Stops at the current positions."""
        self._stopped.set()
        self._thread.join(1.0)


def joints_off_goal(monitor: SceneMonitor, goal: Mapping[str, float]) -> list[str]:
    """Returns the names of joints that joint_states does not show at their goal positions [rad or m]."""
    current, index = monitor.positions(), monitor.model.index
    return [
        name for name, value in goal.items() if name in index and abs(current[index[name]] - value) > SEEN_TOLERANCE
    ]


def _not_seen(source: str, joints: Sequence[str]) -> str:
    return (
        f"{rospy.resolve_name(names.JOINT_STATES_TOPIC)} does not show {source} for {', '.join(joints)} after "
        f"{SEEN_TIMEOUT_S:.0f} s; run joint_state_publisher with "
        f"{rospy.resolve_name(names.FAKE_JOINT_STATES_TOPIC)} in its source_list"
    )


def positions_at(motion: JointTrajectory, elapsed_s: float) -> list[float]:
    """Returns the linearly interpolated positions at a time after the start [s]."""
    times = [point.time_from_start.to_sec() for point in motion.points]
    columns = np.array([point.positions for point in motion.points]).T
    return [float(np.interp(elapsed_s, times, column)) for column in columns]
