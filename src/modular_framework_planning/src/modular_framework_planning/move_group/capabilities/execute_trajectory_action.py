# SPDX-License-Identifier: BSD-3-Clause
"""Action execute_trajectory: sends a planned motion to the controllers."""

from __future__ import annotations

from threading import Event
from typing import Any

from moveit_msgs.msg import ExecuteTrajectoryAction, ExecuteTrajectoryResult

from modular_framework_planning.errors import ErrorCode
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.capabilities.capability import ActionCapability, PublishState
from modular_framework_planning.move_group.motion_watch import WatchedMotion


class ExecuteTrajectory(ActionCapability):
    """Offers execute_trajectory (moveit_msgs/ExecuteTrajectory); a new motion cancels motions of the same joints.

    As in MoveIt, changes of the world do not stop a motion; the robot's other joints stop the motion if they block it.
    """

    name, kind = names.EXECUTE_ACTION, ExecuteTrajectoryAction

    def _resources(self, goal: Any) -> frozenset[str] | None:
        return frozenset(goal.trajectory.joint_trajectory.joint_names) or None

    def _perform(self, goal: Any, cancelled: Event, publish_state: PublishState) -> tuple[ExecuteTrajectoryResult, str]:
        result = ExecuteTrajectoryResult()
        publish_state("MONITOR")
        joints = list(goal.trajectory.joint_trajectory.joint_names)
        try:
            WatchedMotion(self._context, goal.trajectory, self._context.monitor.snapshot(), None).execute(cancelled)
        except Exception as error:  # noqa: BLE001 - the client must get a code; the reporter logs the error
            result.error_code.val = self._context.reporter.failure("execute", error, joints=joints)
            return result, str(error)
        result.error_code.val = ErrorCode.SUCCESS
        self._context.reporter.report("execute", ErrorCode.SUCCESS, "", joints=joints)
        publish_state("IDLE")
        return result, "motion executed"
