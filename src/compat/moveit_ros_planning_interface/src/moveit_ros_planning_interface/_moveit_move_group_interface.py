# SPDX-License-Identifier: BSD-3-Clause
"""Interface of a planning group with serialized messages, as in MoveIt's Python binding.

Methods with the same signature as in the commander are forwarded (`SAME`). The other methods differ only in form:
messages are serialized, poses are lists, and an invalid target returns False and logs the reason.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from geometry_msgs.msg import Pose, PoseStamped
from moveit_commander.conversions import list_to_pose, pose_to_list
from moveit_commander.move_group import MoveGroupCommander
from moveit_msgs.msg import (
    Constraints,
    Grasp,
    PlaceLocation,
    RobotState,
    RobotTrajectory,
    TrajectoryConstraints,
)
from sensor_msgs.msg import JointState

from moveit_ros_planning_interface.serialized import accepted, read, write

SAME = frozenset(
    (
        "allow_looking",
        "allow_replanning",
        "attach_object",
        "clear_max_cartesian_link_speed",
        "clear_path_constraints",
        "clear_pose_target",
        "clear_pose_targets",
        "clear_trajectory_constraints",
        "detach_object",
        "forget_joint_values",
        "get_active_joints",
        "get_current_joint_values",
        "get_current_rpy",
        "get_end_effector_link",
        "get_goal_joint_tolerance",
        "get_goal_orientation_tolerance",
        "get_goal_position_tolerance",
        "get_jacobian_matrix",
        "get_joint_value_target",
        "get_joints",
        "get_known_constraints",
        "get_name",
        "get_named_target_values",
        "get_named_targets",
        "get_planner_id",
        "get_planning_frame",
        "get_planning_pipeline_id",
        "get_planning_time",
        "get_pose_reference_frame",
        "get_random_joint_values",
        "get_remembered_joint_values",
        "get_variable_count",
        "limit_max_cartesian_link_speed",
        "remember_joint_values",
        "set_constraints_database",
        "set_goal_joint_tolerance",
        "set_goal_orientation_tolerance",
        "set_goal_position_tolerance",
        "set_goal_tolerance",
        "set_max_acceleration_scaling_factor",
        "set_max_velocity_scaling_factor",
        "set_num_planning_attempts",
        "set_planner_id",
        "set_planning_pipeline_id",
        "set_planning_time",
        "set_pose_reference_frame",
        "set_random_target",
        "set_start_state_to_current_state",
        "set_support_surface_name",
        "stop",
    )
)


class MoveGroupInterface:
    """Plans and executes motions of a planning group."""

    def __init__(self, group_name: str, robot_description: str, ns: str = "", wait_for_servers: float = 5.0) -> None:
        """Connects to move_group; raises RuntimeError if the group is unknown or move_group does not respond.

        Args:
            group_name: Name of the planning group.
            robot_description: Parameter with the URDF; prefix of the parameters with SRDF and limits.
            ns: Namespace of move_group's services and of joint_states.
            wait_for_servers: Timeout for the connection to move_group [s]; 0 for no timeout.
        """
        self._commander = MoveGroupCommander(group_name, robot_description, ns, wait_for_servers)

    def __getattr__(self, name: str) -> Any:
        """Returns a forwarded method of the commander."""
        if name in SAME:
            return getattr(self._commander, name)
        raise AttributeError(f"MoveGroupInterface has no attribute '{name}'")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *SAME]

    # ---------------------------------------------------------------- the group and its state
    def get_variables(self) -> list[str]:
        """Returns the names of the group's variables, mimic joints included."""
        return self._commander._group_names()

    def get_interface_description(self) -> bytes:
        """Returns moveit_msgs/PlannerInterfaceDescription."""
        return write(self._commander.get_interface_description())

    def set_end_effector_link(self, link_name: str) -> bool:
        """Sets the link to which pose targets apply."""
        return accepted(self._commander.set_end_effector_link, link_name)

    def start_state_monitor(self, wait: float = 1.0) -> bool:
        """Returns whether the states of all joints are received within `wait` [s]."""
        return accepted(self._commander._state.positions, (), wait)

    def get_current_state(self) -> bytes:
        """Returns moveit_msgs/RobotState."""
        return write(self._commander.get_current_state())

    def get_current_state_bounded(self) -> dict[str, float]:
        """Returns the current joint positions by name, clamped to the bounds [rad or m]."""
        state = self._commander.get_current_state_bounded().joint_state
        return dict(zip(state.name, state.position, strict=True))

    def enforce_bounds(self, state: bytes) -> bytes:
        """Returns a moveit_msgs/RobotState with joint positions clamped to the bounds."""
        return write(self._commander.enforce_bounds(read(RobotState, state)))

    def get_current_pose(self, end_effector_link: str = "") -> list[float]:
        """Returns [x, y, z, qx, qy, qz, qw] of a link in the planning frame [m]."""
        return pose_to_list(self._commander.get_current_pose(end_effector_link).pose)

    def get_random_pose(self, end_effector_link: str = "") -> list[float]:
        """Returns [x, y, z, qx, qy, qz, qw] of a link at random joint values [m]."""
        return pose_to_list(self._commander.get_random_pose(end_effector_link).pose)

    # ---------------------------------------------------------------- targets
    def set_joint_value_target(
        self, target: Iterable[float] | Mapping[str, float] | str, value: float | Sequence[float] | None = None
    ) -> bool:
        """Sets a joint target: values of all variables, values by name, or a joint's name and its value."""
        return accepted(self._commander.set_joint_value_target, target, value)

    def set_joint_value_target_from_pose(self, pose: bytes, link: str, approximate: bool) -> bool:
        """Sets a joint target from a pose by inverse kinematics.

        Args:
            pose: geometry_msgs/Pose in the pose reference frame.
            link: Link for the pose; empty for the end effector link.
            approximate: Whether the nearest reachable pose is accepted.
        """
        return accepted(self._commander.set_joint_value_target, read(Pose, pose), link, approximate)

    def set_joint_value_target_from_pose_stamped(self, pose: bytes, link: str, approximate: bool) -> bool:
        """Sets a joint target from a stamped pose by inverse kinematics.

        Args:
            pose: geometry_msgs/PoseStamped.
            link: Link for the pose; empty for the end effector link.
            approximate: Whether the nearest reachable pose is accepted.
        """
        return accepted(self._commander.set_joint_value_target, read(PoseStamped, pose), link, approximate)

    def set_joint_value_target_from_joint_state_message(self, state: bytes) -> bool:
        """Sets a joint target from a sensor_msgs/JointState."""
        return accepted(self._commander.set_joint_value_target, read(JointState, state))

    def set_named_target(self, name: str) -> bool:
        """Sets a named joint target."""
        return accepted(self._commander.set_named_target, name)

    def set_pose_target(self, pose: Sequence[float], end_effector_link: str = "") -> bool:
        """Sets a pose target: x, y, z and roll, pitch, yaw or a quaternion xyzw [m, rad]."""
        return accepted(self._commander.set_pose_target, pose, end_effector_link)

    def set_pose_targets(self, poses: Sequence[Sequence[float]], end_effector_link: str = "") -> bool:
        """Sets alternative pose targets."""
        return accepted(self._commander.set_pose_targets, poses, end_effector_link)

    def set_position_target(self, x: float, y: float, z: float, end_effector_link: str = "") -> bool:
        """Sets the position target.

        Args:
            x: Coordinate in the pose reference frame [m].
            y: Coordinate in the pose reference frame [m].
            z: Coordinate in the pose reference frame [m].
            end_effector_link: Link; empty for the end effector link.
        """
        return accepted(self._commander.set_position_target, [x, y, z], end_effector_link)

    def set_rpy_target(self, roll: float, pitch: float, yaw: float, end_effector_link: str = "") -> bool:
        """Sets the orientation target.

        Args:
            roll: Angle about x [rad].
            pitch: Angle about y [rad].
            yaw: Angle about z [rad].
            end_effector_link: Link; empty for the end effector link.
        """
        return accepted(self._commander.set_rpy_target, [roll, pitch, yaw], end_effector_link)

    def set_orientation_target(self, x: float, y: float, z: float, w: float, end_effector_link: str = "") -> bool:
        """Sets the orientation target.

        Args:
            x: Component of the quaternion.
            y: Component of the quaternion.
            z: Component of the quaternion.
            w: Component of the quaternion.
            end_effector_link: Link; empty for the end effector link.
        """
        return accepted(self._commander.set_orientation_target, [x, y, z, w], end_effector_link)

    # ---------------------------------------------------------------- settings
    def set_start_state(self, state: bytes) -> None:
        """Sets the start state of plans to a moveit_msgs/RobotState."""
        self._commander.set_start_state(read(RobotState, state))

    def set_workspace(self, *corners: float) -> None:
        """Sets the bounds of the workspace: min x, y, z, max x, y, z [m]."""
        self._commander.set_workspace(corners)

    def set_path_constraints(self, name: str) -> bool:
        """Sets path constraints by name, from the database."""
        return accepted(self._commander.set_path_constraints, name)

    def set_path_constraints_from_msg(self, constraints: bytes) -> None:
        """Sets path constraints from a moveit_msgs/Constraints."""
        self._commander.set_path_constraints(read(Constraints, constraints))

    def get_path_constraints(self) -> bytes:
        """Returns moveit_msgs/Constraints."""
        return write(self._commander.get_path_constraints())

    def set_trajectory_constraints_from_msg(self, constraints: bytes) -> None:
        """Sets trajectory constraints from a moveit_msgs/TrajectoryConstraints."""
        self._commander.set_trajectory_constraints(read(TrajectoryConstraints, constraints))

    def get_trajectory_constraints(self) -> bytes:
        """Returns moveit_msgs/TrajectoryConstraints."""
        return write(self._commander.get_trajectory_constraints())

    # ---------------------------------------------------------------- plans and motions
    def construct_motion_plan_request(self) -> bytes:
        """Returns moveit_msgs/MotionPlanRequest."""
        return write(self._commander.construct_motion_plan_request())

    def plan(self) -> tuple[bytes, bytes, float]:
        """Returns moveit_msgs/MoveItErrorCodes, moveit_msgs/RobotTrajectory and the planning time [s]."""
        _, trajectory, planning_time_s, code = self._commander.plan()
        return write(code), write(trajectory), planning_time_s

    def move(self) -> bool:
        """Plans and executes; returns whether the group has reached the target."""
        return self._commander.go(wait=True)

    def async_move(self) -> bool:
        """Sends a goal to plan and execute, without waiting for the result."""
        return self._commander.go(wait=False)

    def execute(self, trajectory: bytes) -> bool:
        """Executes a moveit_msgs/RobotTrajectory; returns whether the execution succeeded."""
        return self._commander.execute(read(RobotTrajectory, trajectory), wait=True)

    def async_execute(self, trajectory: bytes) -> bool:
        """Sends a goal to execute a moveit_msgs/RobotTrajectory, without waiting for the result."""
        return self._commander.execute(read(RobotTrajectory, trajectory), wait=False)

    def compute_cartesian_path(
        self,
        waypoints: Sequence[Sequence[float]],
        eef_step: float,
        avoid_collisions: bool,
        path_constraints: bytes | None = None,
    ) -> tuple[bytes, float]:
        """Returns a moveit_msgs/RobotTrajectory of straight lines and the fraction it covers; -1 after an error.

        Args:
            waypoints: Poses of the end effector as [x, y, z, qx, qy, qz, qw] or [x, y, z, roll, pitch, yaw] [m, rad].
            eef_step: Maximum distance between two points of the path [m].
            avoid_collisions: Whether the path must be collision-free.
            path_constraints: moveit_msgs/Constraints that each point must satisfy.
        """
        constraints = None if path_constraints is None else read(Constraints, path_constraints)
        path, fraction = self._commander.compute_cartesian_path(
            waypoints, eef_step, avoid_collisions=avoid_collisions, path_constraints=constraints
        )
        return write(path), fraction

    def retime_trajectory(
        self,
        state: bytes,
        trajectory: bytes,
        velocity_scaling_factor: float,
        acceleration_scaling_factor: float,
        algorithm: str,
    ) -> bytes:
        """Returns the moveit_msgs/RobotTrajectory with new times.

        Args:
            state: moveit_msgs/RobotState in which the trajectory starts.
            trajectory: moveit_msgs/RobotTrajectory to retime.
            velocity_scaling_factor: Fraction of the velocity limits, in (0, 1].
            acceleration_scaling_factor: Fraction of the acceleration limits, in (0, 1].
            algorithm: Name of the time parameterization.
        """
        return write(
            self._commander.retime_trajectory(
                read(RobotState, state),
                read(RobotTrajectory, trajectory),
                velocity_scaling_factor,
                acceleration_scaling_factor,
                algorithm,
            )
        )

    # ---------------------------------------------------------------- objects
    def pick(self, object_name: str, grasps: bytes | Sequence[bytes] | bool = (), plan_only: bool = False) -> int:
        """Picks an object with one of the given moveit_msgs/Grasp; returns the error code.

        Args:
            object_name: Id of the object.
            grasps: A grasp or several grasps. A bool is the value of `plan_only`, with an empty list of grasps.
            plan_only: Whether to plan without moving.
        """
        if isinstance(grasps, bool):
            return self._commander.pick(object_name, [], grasps)
        given = [grasps] if isinstance(grasps, bytes) else grasps
        return self._commander.pick(object_name, [read(Grasp, grasp) for grasp in given], plan_only)

    def place(
        self, object_name: str, location: bytes | Sequence[float] | bool = False, plan_only: bool = False
    ) -> bool:
        """Places an object.

        Args:
            object_name: Id of the object.
            location: A moveit_msgs/PlaceLocation, or a pose as a list in the pose reference frame [m]. A bool is the
                value of `plan_only`, without a location.
            plan_only: Whether to plan without moving.
        """
        if isinstance(location, bool):
            return self._commander.place(object_name, None, location)
        if isinstance(location, bytes):
            return self._commander.place(object_name, read(PlaceLocation, location), plan_only)
        return self._commander.place(object_name, list_to_pose(location), plan_only)

    def place_poses_list(self, object_name: str, poses: Sequence[bytes], plan_only: bool = False) -> bool:
        """Places an object at one of several poses and returns whether the placing succeeded.

        Args:
            object_name: Held object.
            poses: geometry_msgs/PoseStamped each.
            plan_only: Whether to plan without moving.
        """
        return self._commander.place(object_name, [read(PoseStamped, pose) for pose in poses], plan_only)

    def place_locations_list(self, object_name: str, locations: Sequence[bytes], plan_only: bool = False) -> bool:
        """Places an object at one of several locations and returns whether the placing succeeded.

        Args:
            object_name: Held object.
            locations: moveit_msgs/PlaceLocation each.
            plan_only: Whether to plan without moving.
        """
        return self._commander.place(object_name, [read(PlaceLocation, place) for place in locations], plan_only)
