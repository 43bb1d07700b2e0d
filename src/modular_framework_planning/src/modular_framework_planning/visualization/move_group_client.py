# SPDX-License-Identifier: BSD-3-Clause
"""Client of a move_group node for user interfaces; uses only public endpoints, so that any move_group works."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped
from moveit_msgs.msg import (
    Constraints,
    ExecuteTrajectoryAction,
    ExecuteTrajectoryGoal,
    JointConstraint,
    MoveGroupAction,
    MoveGroupGoal,
    MoveItErrorCodes,
    PlanningSceneComponents,
    PositionIKRequest,
    RobotState,
)
from moveit_msgs.srv import GetPlanningScene, GetPositionIK, GetStateValidity, QueryPlannerInterfaces
from std_msgs.msg import String

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.move_group import capability_names as names
from modular_framework_ros.action_client import SteadyActionClient, is_connected
from modular_framework_ros.calls import CallError, wait_for_service, wait_until

GOAL_TOLERANCE = 1.0e-4  # [rad or m]
EXECUTION_MARGIN_S = 60.0


@dataclass(frozen=True, slots=True)
class MotionOptions:
    """Options of motion requests; for 0 and empty, move_group's defaults apply."""

    allowed_time_s: float = 5.0
    velocity_scaling: float = 0.0
    acceleration_scaling: float = 0.0
    pipeline_id: str = ""
    planner_id: str = ""


def planners_of_group(planner_ids: Sequence[str], group: str) -> list[str]:
    """Returns a pipeline's planners for a group, as MoveIt's panel in RViz does.

    The planners are taken from the entries `group[planner]` or, if the group has none, from the entries for all groups.
    """
    group_planners = [
        name[len(group) + 1 : -1] for name in planner_ids if name.startswith(f"{group}[") and name.endswith("]")
    ]
    return group_planners or [name for name in planner_ids if not name.endswith("]")]


class MoveGroupClient:
    """Client for the requests of the interactive goal.

    Services: get_planning_scene, compute_ik, check_state_validity, query_planner_interface.
    Actions: move_group, execute_trajectory.
    Publishes: trajectory_execution_event.
    """

    def __init__(self) -> None:
        self._scene = rospy.ServiceProxy(names.GET_SCENE_SERVICE, GetPlanningScene)
        self._ik = rospy.ServiceProxy(names.IK_SERVICE, GetPositionIK)
        self._validity = rospy.ServiceProxy(names.STATE_VALIDITY_SERVICE, GetStateValidity)
        self._planners = rospy.ServiceProxy(names.QUERY_PLANNERS_SERVICE, QueryPlannerInterfaces)
        self._events = rospy.Publisher(names.EXECUTION_EVENT_TOPIC, String, queue_size=1)
        self._move = SteadyActionClient(names.MOVE_ACTION, MoveGroupAction)
        self._execute = SteadyActionClient(names.EXECUTE_ACTION, ExecuteTrajectoryAction)

    def connect(self, timeout_s: float) -> None:
        """Waits for move_group; raises PlanningError naming a missing endpoint."""
        for service in (self._scene, self._ik, self._validity, self._planners):
            try:
                wait_for_service(service, timeout_s)
            except CallError as error:
                raise PlanningError(ErrorCode.COMMUNICATION_FAILURE, str(error)) from error
        for name, client in ((names.MOVE_ACTION, self._move), (names.EXECUTE_ACTION, self._execute)):
            if not wait_until(partial(is_connected, client), timeout_s):
                raise PlanningError(
                    ErrorCode.COMMUNICATION_FAILURE,
                    f"action {rospy.resolve_name(name)} was not "
                    f"offered within {timeout_s:.0f} s; is move_group running?",
                )

    def state(self) -> RobotState:
        """Returns the current state."""
        parts = PlanningSceneComponents(
            PlanningSceneComponents.ROBOT_STATE | PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS
        )
        return self._scene(parts).scene.robot_state

    def planners(self, group: str) -> list[tuple[str, str]]:
        """Returns pairs of pipeline_id and planner_id for a group."""
        return [
            (item.pipeline_id, planner)
            for item in self._planners().planner_interfaces
            for planner in planners_of_group(item.planner_ids, group)
        ]

    def solve_ik(
        self, group: str, link: str, target: PoseStamped, seed: RobotState, avoid_collisions: bool
    ) -> RobotState | None:
        """Returns the state nearest to the seed with a link at a pose, or None.

        Args:
            group: Planning group.
            link: Link to place.
            target: Target pose of the link.
            seed: Seed state.
            avoid_collisions: Whether the state must be collision-free.
        """
        response = self._ik(
            PositionIKRequest(
                group_name=group,
                ik_link_name=link,
                pose_stamped=target,
                robot_state=seed,
                avoid_collisions=avoid_collisions,
            )
        )
        if response.error_code.val != MoveItErrorCodes.SUCCESS:
            return None
        return response.solution

    def problem_of(self, group: str, state: RobotState) -> str:
        """Returns the reason why a state is invalid; empty for a valid state."""
        response = self._validity(state, group, Constraints())
        if response.valid:
            return ""
        touching = [f"{item.contact_body_1} touches {item.contact_body_2}" for item in response.contacts[:3]]
        return "; ".join(touching) or "out of bounds or not valid"

    def plan(self, group: str, start: RobotState, goal: Mapping[str, float], options: MotionOptions) -> Any:
        """Plans a motion and returns the trajectory; raises PlanningError with move_group's reason.

        Args:
            group: Planning group.
            start: Start state.
            goal: Goal positions by joint name [rad or m].
            options: Options of the request.
        """
        message = MoveGroupGoal()
        message.planning_options.plan_only = True
        message.planning_options.planning_scene_diff.is_diff = True
        message.planning_options.planning_scene_diff.robot_state.is_diff = True
        request = message.request
        request.group_name, request.start_state = group, start
        request.pipeline_id, request.planner_id = options.pipeline_id, options.planner_id
        request.num_planning_attempts, request.allowed_planning_time = 1, options.allowed_time_s
        request.max_velocity_scaling_factor = options.velocity_scaling
        request.max_acceleration_scaling_factor = options.acceleration_scaling
        request.goal_constraints = [
            Constraints(
                name="goal",
                joint_constraints=[
                    JointConstraint(name, value, GOAL_TOLERANCE, GOAL_TOLERANCE, 1.0) for name, value in goal.items()
                ],
            )
        ]
        result = self._run_goal(self._move, message, options.allowed_time_s + EXECUTION_MARGIN_S)
        return result.planned_trajectory

    def execute(self, trajectory: Any) -> None:
        """Executes a trajectory; raises PlanningError with move_group's reason."""
        points = trajectory.joint_trajectory.points
        duration_s = points[-1].time_from_start.to_sec() if points else 0.0
        self._run_goal(
            self._execute, ExecuteTrajectoryGoal(trajectory=trajectory), 2.0 * duration_s + EXECUTION_MARGIN_S
        )

    def stop(self) -> None:
        """Stops planning and execution."""
        self._events.publish(String("stop"))
        for client in (self._move, self._execute):
            if client.gh is not None:
                client.cancel_goal()

    @staticmethod
    def _run_goal(client: actionlib.SimpleActionClient, goal: Any, timeout_s: float) -> Any:
        client.send_goal(goal)
        if not client.wait_for_result(rospy.Duration(timeout_s)):
            client.cancel_goal()
            raise PlanningError(
                ErrorCode.TIMED_OUT,
                f"{client.action_client.ns}: no result within {timeout_s:.0f} s; the goal is cancelled",
            )
        result = client.get_result()
        code = result.error_code.val if result else int(ErrorCode.FAILURE)
        if code != ErrorCode.SUCCESS:
            known = ErrorCode(code) if code in set(ErrorCode) else ErrorCode.FAILURE
            raise PlanningError(known, client.get_goal_status_text() or f"ended with error code {code}")
        return result
