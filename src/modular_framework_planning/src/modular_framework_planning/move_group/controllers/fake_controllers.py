# SPDX-License-Identifier: BSD-3-Clause
"""Fake controllers, for a robot without hardware or simulation: they publish the joint positions of a trajectory."""

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
    """Reads the parameter `initial`: named poses of groups.

    Returns:
        Positions by joint, and one sentence for every entry that cannot be used.
    """
    positions: dict[str, float] = {}
    faults: list[str] = []
    for number, entry in enumerate(entries if isinstance(entries, list) else []):
        group = str(entry.get("group", "")) if isinstance(entry, Mapping) else ""
        pose = str(entry.get("pose", "")) if isinstance(entry, Mapping) else ""
        poses = model.semantics.group_states.get(group, {})
        if pose in poses:
            base = model.base.variables if model.base else ()  # as in MoveIt, not of joint_states
            moved = {joint: value for joint, value in poses[pose].items() if joint in model.index}
            positions |= {joint: value for joint, value in moved.items() if joint not in base}
        else:
            faults.append(
                f"initial[{number}]: group '{group}' has no pose '{pose}' in the SRDF; it has "
                f"{', '.join(poses) or 'none'}"
            )
    return positions, faults


class FakeControllers:
    """Publishes ~fake_controller_joint_states (sensor_msgs/JointState, latched).

    Another node (joint_state_publisher with a source_list) makes joint_states of it. A motion counts as done when the
    positions have come back.

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
        """Publishes the initial positions and waits until they have come back: until then the robot seems elsewhere."""
        self._publisher = rospy.Publisher(names.FAKE_JOINT_STATES_TOPIC, JointState, queue_size=100, latch=True)
        positions, faults = initial_positions(self._monitor.model, parameter("~initial"))
        for fault in faults:
            rospy.logerr("%s", fault)
        if positions:
            message = JointState(name=list(positions), position=list(positions.values()))
            message.header.stamp = rospy.Time.now()
            self._publisher.publish(message)
            if not wait_until(lambda: not elsewhere(self._monitor, positions), SEEN_TIMEOUT_S):
                rospy.logwarn("%s", _not_seen("the initial positions put", elsewhere(self._monitor, positions)))

    def describe(self) -> str:
        """Says how many there are."""
        return f"{len(self._specs)} fake controllers"

    def controllers(self) -> tuple[ControllerSpec, ...]:
        """Returns those listed."""
        return self._specs

    def prepare(self, parts: Sequence[MotionPart]) -> None:
        """Fake controllers are always ready."""

    def begin(self, part: MotionPart) -> RunningMotion:
        """Starts to publish."""
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
        play = {"last point": self._jump, "via points": self._visit, "interpolate": self._interpolate}
        self._thread = threading.Thread(target=play[part.controller.kind], daemon=True)
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
        begun = rospy.Time.now()
        for point in self._part.trajectory.points:
            while (rospy.Time.now() - begun) < point.time_from_start:
                left_s = (point.time_from_start - (rospy.Time.now() - begun)).to_sec()
                if self._stopped.wait(min(max(left_s, 0.0), self._period_s)):
                    return
            self._publish(point.positions)
        self._end()

    def _interpolate(self) -> None:
        begun = rospy.Time.now()
        while (elapsed := (rospy.Time.now() - begun).to_sec()) < self._part.duration_s:
            self._publish(positions_at(self._part.trajectory, elapsed))
            if self._stopped.wait(self._period_s):
                return
        self._end()

    def is_done(self) -> bool:
        """Whether the last positions have been published and have come back on joint_states."""
        if self._stopped.is_set():
            raise PlanningError(ErrorCode.PREEMPTED, f"fake controller '{self._part.controller.name}' was stopped")
        if not self._published_s:
            return False
        wanted = dict(zip(self._part.trajectory.joint_names, self._part.trajectory.points[-1].positions, strict=True))
        away = elsewhere(self._monitor, wanted)
        if away and time.monotonic() - self._published_s > SEEN_TIMEOUT_S:
            name = self._part.controller.name
            raise PlanningError(ErrorCode.CONTROL_FAILED, _not_seen(f"fake controller '{name}' put", away))
        return not away

    def has_begun(self) -> bool:
        """A fake controller begins at once."""
        return True

    def cancel(self) -> None:
        """Stops at the present positions."""
        self._stopped.set()
        self._thread.join(1.0)


def elsewhere(monitor: SceneMonitor, wanted: Mapping[str, float]) -> list[str]:
    """Returns the joints that joint_states does not show at their wanted positions [rad or m]."""
    now, index = monitor.positions(), monitor.model.index
    return [name for name, value in wanted.items() if name in index and abs(now[index[name]] - value) > SEEN_TOLERANCE]


def _not_seen(who_put: str, joints: Sequence[str]) -> str:
    return (
        f"{rospy.resolve_name(names.JOINT_STATES_TOPIC)} does not show where {who_put} {', '.join(joints)} "
        f"{SEEN_TIMEOUT_S:.0f} s ago; let joint_state_publisher run with "
        f"{rospy.resolve_name(names.FAKE_JOINT_STATES_TOPIC)} in its source_list"
    )


def positions_at(motion: JointTrajectory, elapsed_s: float) -> list[float]:
    """Returns the positions at a time, on straight lines between the points."""
    times = [point.time_from_start.to_sec() for point in motion.points]
    columns = np.array([point.positions for point in motion.points]).T
    return [float(np.interp(elapsed_s, times, column)) for column in columns]
