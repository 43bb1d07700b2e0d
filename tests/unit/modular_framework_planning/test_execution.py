# SPDX-License-Identifier: BSD-3-Clause
"""Execution of motions, as far as it needs no controller."""
from __future__ import annotations

import threading
import time
from typing import Any

import pytest
from moveit_msgs.msg import RobotTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.ros_execution import TrajectoryExecution
from modular_framework_planning.ros_parameters import ControllerSpec, ExecutionSettings


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
    arm = ControllerSpec("arm", "follow", "FollowJointTrajectory", ("elbow",))
    execution = EndlessMotion((arm,), ExecutionSettings(allowed_start_tolerance=0.0), None)  # type: ignore[arg-type]
    motion = RobotTrajectory()
    motion.joint_trajectory.joint_names = ["elbow"]
    motion.joint_trajectory.points = [JointTrajectoryPoint(positions=[0.0])]
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
