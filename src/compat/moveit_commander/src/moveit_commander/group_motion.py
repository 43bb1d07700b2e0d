# SPDX-License-Identifier: BSD-3-Clause
"""Planning and execution of a group: plan, go, execute, Cartesian paths, stop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rospy
from geometry_msgs.msg import Pose, PoseStamped
from moveit_msgs.msg import (
    Constraints,
    ExecuteTrajectoryAction,
    ExecuteTrajectoryGoal,
    MoveGroupAction,
    MoveGroupGoal,
    MoveItErrorCodes,
    PlanningOptions,
    RobotTrajectory,
)
from moveit_msgs.srv import GetCartesianPath, GetCartesianPathRequest
from rosgraph.names import ns_join
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from moveit_commander import conversions
from moveit_commander.exception import MoveItCommanderException
from moveit_commander.group_connection import EXECUTE_ACTION, MOVE_ACTION, code_text
from moveit_commander.group_pose_targets import GroupPoseTargets
from moveit_commander.servers import ACTION_TIMEOUT_S, is_heard

ANSWER_MARGIN_S = 30.0  # added to the planning time, for queueing, smoothing and collision checks
MOTION_TIMEOUT_S = 600.0


class GroupMotion(GroupPoseTargets):
    """Planning and execution methods of a group.

    Publishes: trajectory_execution_event (std_msgs/String).
    """

    def __init__(self, name: str, robot_description: str, ns: str, wait_for_servers: float) -> None:
        super().__init__(name, robot_description, ns, wait_for_servers)
        self._events = rospy.Publisher(ns_join(ns, "trajectory_execution_event"), String, queue_size=1)
        self._events.impl.set_queue_size(None)  # synchronous, because a script may end right after stop()

    def plan(self, joints: Any = None) -> tuple[bool, RobotTrajectory, float, MoveItErrorCodes]:
        """Plans to the target.

        Args:
            joints: Target to set first: the name of remembered joint values, a Pose, or an argument of
                set_joint_value_target; None keeps the current target.

        Returns:
            Success, trajectory, planning time [s] and error code.
        """
        self._set_target(joints)
        goal = self._goal(plan_only=True)
        result = self._servers.action(MOVE_ACTION, MoveGroupAction).run(goal, self._planning_limit_s())
        worked = self._check_result(result.error_code, "plan")
        return worked, result.planned_trajectory, result.planning_time, result.error_code

    def go(self, joints: Any = None, wait: bool = True) -> bool:
        """Plans to the target and executes the motion.

        Args:
            joints: Target as for plan; a bool stands for `wait`.
            wait: Whether to wait for the end of the motion.

        Returns:
            Whether the group reached the target; with wait=False, whether the goal was sent.
        """
        if isinstance(joints, bool):
            wait, joints = joints, None
        self._set_target(joints)
        caller, goal = self._servers.action(MOVE_ACTION, MoveGroupAction), self._goal(plan_only=False)
        if not wait:
            caller.send(goal)
            return True
        result = caller.run(goal, self._planning_limit_s() + MOTION_TIMEOUT_S)
        return self._check_result(result.error_code, "go")

    def execute(self, trajectory: RobotTrajectory | JointTrajectory, wait: bool = True) -> bool:
        """Executes a planned trajectory; returns the result as go does."""
        if isinstance(trajectory, JointTrajectory):
            trajectory = RobotTrajectory(joint_trajectory=trajectory)
        if not isinstance(trajectory, RobotTrajectory):
            raise MoveItCommanderException(
                f"execute: got {type(trajectory)}, a RobotTrajectory is needed; plan() "
                "returns a tuple whose second item is a RobotTrajectory"
            )
        caller = self._servers.action(EXECUTE_ACTION, ExecuteTrajectoryAction)
        if not wait:
            caller.send(ExecuteTrajectoryGoal(trajectory))
            return True
        points = trajectory.joint_trajectory.points
        duration_s = points[-1].time_from_start.to_sec() if points else 0.0
        result = caller.run(ExecuteTrajectoryGoal(trajectory), max(MOTION_TIMEOUT_S, 10.0 * duration_s))
        return self._check_result(result.error_code, "execute")

    def stop(self) -> None:
        """Stops the current motion, also immediately after the construction of this commander."""
        if is_heard(self._events):
            self._events.publish(String("stop"))

    def compute_cartesian_path(
        self, waypoints: Sequence[Any], eef_step: float, *options: Any, **named_options: Any
    ) -> tuple[RobotTrajectory, float]:
        """Computes a path of straight lines for the end effector link.

        Args:
            waypoints: Poses in the pose reference frame: Pose, or lists of 6 or 7 numbers [m, rad].
            eef_step: Maximum step along the lines [m].
            *options: Positional [jump_threshold,] [avoid_collisions=True,] [path_constraints=None]; the jump threshold
                (a number) exists only in older versions.
            **named_options: The same options by name.

        Returns:
            The path and the computed fraction of the lines in [0, 1], or -1 after an error of move_group.

        Raises:
            ServerError: The service compute_cartesian_path is not available.
        """
        jump_threshold, avoid_collisions, constraints = cartesian_options(options, named_options)
        request = GetCartesianPathRequest(
            start_state=self._start_state,
            group_name=self._group.name,
            max_step=eef_step,
            link_name=self._link("", "compute a path for"),
            jump_threshold=jump_threshold,
            avoid_collisions=avoid_collisions,
            path_constraints=constraints,
            max_cartesian_speed=self._speed_limit,
            cartesian_speed_limited_link=self._limited_link(),
        )
        request.waypoints = [pose if isinstance(pose, Pose) else conversions.list_to_pose(pose) for pose in waypoints]
        request.header.frame_id = self.get_pose_reference_frame()
        request.header.stamp = rospy.Time.now()
        response = self._servers.call("compute_cartesian_path", GetCartesianPath, request)
        if response.error_code.val != MoveItErrorCodes.SUCCESS:
            self._check_result(response.error_code, "compute_cartesian_path")
            return RobotTrajectory(), -1.0
        return response.solution, response.fraction

    def _set_target(self, target: Any) -> None:
        """Sets the target in an argument of plan or go; None keeps the current target."""
        if isinstance(target, str):
            self.set_joint_value_target(self._named_values(target))
        elif isinstance(target, Pose | PoseStamped):
            self.set_pose_target(target)
        elif target is not None:
            self.set_joint_value_target(target)

    def _named_values(self, name: str) -> dict[str, float]:
        """Returns the joint values of a remembered or named target."""
        return self.get_named_target_values(name)

    def _goal(self, plan_only: bool) -> MoveGroupGoal:
        return MoveGroupGoal(request=self.construct_motion_plan_request(), planning_options=self._options(plan_only))

    def _options(self, plan_only: bool) -> PlanningOptions:
        options = PlanningOptions(plan_only=plan_only, replan_delay=2.0, replan_attempts=1)
        options.look_around = self._looking and not plan_only
        options.replan = self._replanning and not plan_only
        options.planning_scene_diff.is_diff = True
        options.planning_scene_diff.robot_state.is_diff = True
        return options

    def _planning_limit_s(self) -> float:
        return self._planning_time_s * max(1, self._attempts) + ANSWER_MARGIN_S + ACTION_TIMEOUT_S

    def _check_result(self, code: MoveItErrorCodes, action: str) -> bool:
        if code.val == MoveItErrorCodes.SUCCESS:
            return True
        rospy.logwarn(
            "%s of group '%s' failed: %s; the log of move_group gives the reason",
            action,
            self._group.name,
            code_text(code),
        )
        return False


def cartesian_options(options: Sequence[Any], named: dict[str, Any]) -> tuple[float, bool, Constraints]:
    """Returns the options of both public signatures, with and without a leading jump threshold."""
    names = ["avoid_collisions", "path_constraints"]
    if options and isinstance(options[0], int | float) and not isinstance(options[0], bool):
        names.insert(0, "jump_threshold")
    unknown = set(named) - {"jump_threshold", "avoid_collisions", "path_constraints"}
    if len(options) > len(names) or unknown or set(names[: len(options)]) & set(named):
        raise TypeError(
            f"compute_cartesian_path: options {options} and {named}; allowed: jump_threshold (a number), "
            "avoid_collisions (a bool), path_constraints (moveit_msgs/Constraints), each once"
        )
    chosen = {**dict(zip(names, options, strict=False)), **named}
    constraints = chosen.get("path_constraints") or Constraints()
    if not isinstance(constraints, Constraints):
        raise MoveItCommanderException(
            "Unable to set path constraints, unknown constraint type "
            f"{type(constraints)}; moveit_msgs/Constraints is needed"
        )
    return float(chosen.get("jump_threshold", 0.0)), bool(chosen.get("avoid_collisions", True)), constraints
