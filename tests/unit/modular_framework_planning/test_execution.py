# SPDX-License-Identifier: BSD-3-Clause
"""Execution of motions, as far as it needs no controller."""
from __future__ import annotations

import threading
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from moveit_msgs.msg import RobotTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.ros_execution import TrajectoryExecution
from modular_framework_planning.ros_parameters import ControllerSpec, ExecutionSettings

ARM = ControllerSpec("arm", "follow", "FollowJointTrajectory", ("elbow",))
GRIPPER = ControllerSpec("gripper", "gripper_cmd", "GripperCommand", ("finger",))


class StandingRobot:
    """What execution asks of the scene monitor: both joints stand at 0.3."""

    model = SimpleNamespace(index={"elbow": 0, "finger": 1})

    def wait_for_state(self) -> None:
        return

    def wait_for_next_state(self, _: float) -> bool:
        return True

    def positions(self) -> Any:
        return np.array([0.3, 0.3])


class RecordedMotion(TrajectoryExecution):
    """Notes what would have been sent to controllers."""

    def __init__(self) -> None:
        super().__init__((ARM, GRIPPER), ExecutionSettings(), StandingRobot())  # type: ignore[arg-type]
        self.sent: list[str] = []

    def _require_servers(self, parts: Any) -> None:
        return

    def _run(self, parts: Any, duration_s: float, cancelled: threading.Event) -> None:
        self.sent += [part.controller.name for part in parts]

    def _settle(self, joint_names: Any) -> None:
        return


def one_point(joint: str, position: float) -> RobotTrajectory:
    motion = RobotTrajectory()
    motion.joint_trajectory.joint_names = [joint] if joint else []
    motion.joint_trajectory.points = [JointTrajectoryPoint(positions=[position] if joint else [])]
    return motion


def test_a_motion_to_where_the_arm_is_succeeds_without_bothering_its_controller() -> None:
    execution = RecordedMotion()
    execution.execute(one_point("elbow", 0.301), threading.Event())
    assert execution.sent == []
    with pytest.raises(PlanningError, match="'elbow' is 0.5000 from"):
        execution.execute(one_point("elbow", 0.8), threading.Event())


def test_a_gripper_gets_its_goal_even_where_it_is_because_it_is_to_squeeze() -> None:
    execution = RecordedMotion()
    execution.execute(one_point("finger", 0.3), threading.Event())
    assert execution.sent == ["gripper"]


def test_a_motion_that_names_no_joint_is_refused() -> None:
    with pytest.raises(PlanningError, match="no joint_names"):
        RecordedMotion().execute(one_point("", 0.0), threading.Event())


class EndlessMotion(TrajectoryExecution):
    """Its controller never ends; the motion does when it is stopped."""

    begun = threading.Event()

    def _require_servers(self, parts: Any) -> None:
        return

    def _run(self, parts: Any, duration_s: float, cancelled: threading.Event) -> None:
        self.begun.set()
        assert self._stop.wait(5.0)
        time.sleep(0.05)
        raise PlanningError(ErrorCode.PREEMPTED, "the motion was stopped on request")


def test_closing_stops_the_motion_and_waits_until_it_has_ended() -> None:
    execution = EndlessMotion((ARM,), ExecutionSettings(allowed_start_tolerance=0.0), None)  # type: ignore[arg-type]
    motion = one_point("elbow", 0.0)
    ended = []

    def execute() -> None:
        with pytest.raises(PlanningError, match="stopped on request"):
            execution.execute(motion, threading.Event())
        ended.append(True)

    thread = threading.Thread(target=execute)
    thread.start()
    assert execution.begun.wait(5.0)
    execution.close()
    thread.join(5.0)
    assert ended
    execution.close()  # a second time does nothing
