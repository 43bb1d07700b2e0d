# SPDX-License-Identifier: BSD-3-Clause
"""Pose targets of a group: poses, positions and orientations of a link."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from moveit_msgs.msg import Constraints, MotionPlanRequest

from modular_framework_ros.messages.ros_goal_constraints import joint_goal, orientation_goal, position_goal
from moveit_commander import conversions
from moveit_commander.exception import MoveItCommanderException
from moveit_commander.group_joint_targets import GroupJointTargets, Target

PoseLike = Pose | PoseStamped | Sequence[float]


class GroupPoseTargets(GroupJointTargets):
    """Pose targets of a group by link, and the planning request of the active target."""

    def __init__(self, name: str, robot_description: str, ns: str, wait_for_servers: float) -> None:
        super().__init__(name, robot_description, ns, wait_for_servers)
        self._pose_targets: dict[str, list[PoseStamped]] = {}

    def set_pose_target(self, pose: PoseLike, end_effector_link: str = "") -> None:
        """Sets the target pose of a link.

        Args:
            pose: Pose, PoseStamped, [x, y, z, roll, pitch, yaw] or [x, y, z, qx, qy, qz, qw] [m, rad].
            end_effector_link: Link; "" for the end effector link.
        """
        self.set_pose_targets([pose], end_effector_link)

    def set_pose_targets(self, poses: Sequence[PoseLike], end_effector_link: str = "") -> None:
        """Sets alternative target poses of a link."""
        link = self._link(end_effector_link, "set poses for")
        if not poses:
            raise MoveItCommanderException("Unable to set target poses: the list is empty")
        self._pose_targets[link] = [self._stamped_pose(pose) for pose in poses]
        self._active_target = Target.POSE

    def set_position_target(self, xyz: Sequence[float], end_effector_link: str = "") -> None:
        """Sets the target position of a link [m], with any orientation."""
        link = self._link(end_effector_link, "set the pose for")
        if len(xyz) != 3:
            raise MoveItCommanderException(f"Expected [x, y, z]; got {len(xyz)} numbers")
        self._pose_targets[link] = [self._stamped_pose([*xyz, 0.0, 0.0, 0.0, 1.0])]
        self._active_target = Target.POSITION

    def set_orientation_target(self, q: Sequence[float], end_effector_link: str = "") -> None:
        """Sets the target orientation of a link (quaternion xyzw), at any position."""
        link = self._link(end_effector_link, "set the pose for")
        if len(q) != 4:
            raise MoveItCommanderException(f"Expected [qx, qy, qz, qw]; got {len(q)} numbers")
        pose = self._stamped_pose(Pose(Point(), Quaternion(*(float(value) for value in q))))
        self._pose_targets[link] = [pose]
        self._active_target = Target.ORIENTATION

    def set_rpy_target(self, rpy: Sequence[float], end_effector_link: str = "") -> None:
        """Sets the target orientation of a link ([roll, pitch, yaw] [rad]), at any position."""
        self._link(end_effector_link, "set the pose for")
        if len(rpy) != 3:
            raise MoveItCommanderException(f"Expected [roll, pitch, yaw]; got {len(rpy)} numbers")
        self.set_orientation_target(conversions.quaternion_from_rpy(*rpy), end_effector_link)

    def shift_pose_target(self, axis: int, value: float, end_effector_link: str = "") -> None:
        """Sets the current pose of a link, translated along or rotated about one axis, as the target.

        Args:
            axis: Index from 0 to 5: x, y, z, roll, pitch, yaw.
            value: Translation [m] or rotation [rad].
            end_effector_link: Link; "" for the end effector link.
        """
        if axis not in range(6):
            raise MoveItCommanderException(f"An axis value between 0 and 5 expected; got {axis}")
        pose = self.get_current_pose(end_effector_link)
        numbers = conversions.pose_to_list(pose.pose)
        if axis > 2:
            numbers[3:] = conversions.rpy_from_quaternion(numbers[3:])
        numbers[axis] += value
        self.set_pose_target(conversions.list_to_pose_stamped(numbers, pose.header.frame_id), end_effector_link)

    def clear_pose_target(self, end_effector_link: str) -> None:
        """Removes the pose targets of a link."""
        self._pose_targets.pop(end_effector_link or self._end_effector_link, None)

    def clear_pose_targets(self) -> None:
        """Removes the pose targets of all links."""
        self._pose_targets.clear()

    def construct_motion_plan_request(self) -> MotionPlanRequest:
        """Returns the planning request for the current settings and the active target."""
        return MotionPlanRequest(
            group_name=self._group.name,
            num_planning_attempts=self._attempts,
            allowed_planning_time=self._planning_time_s,
            pipeline_id=self._pipeline_id,
            planner_id=self._planner_id,
            max_velocity_scaling_factor=self._velocity_scaling,
            max_acceleration_scaling_factor=self._acceleration_scaling,
            max_cartesian_speed=self._speed_limit,
            cartesian_speed_limited_link=self._limited_link(),
            workspace_parameters=self._workspace,
            start_state=self._start_state,
            goal_constraints=self._goals(),
            path_constraints=self._path_constraints,
            trajectory_constraints=self._trajectory_constraints,
        )

    def _limited_link(self) -> str:
        """Returns the speed-limited link, held object or subframe; "" without a limit."""
        return (self._speed_limited_link or self._end_effector_link) if self._speed_limit > 0.0 else ""

    def _goals(self) -> list[Constraints]:
        """Returns the goal constraints; the k-th goal contains the k-th pose of every link."""
        if self._active_target is Target.JOINT:
            active = {item.name: self._joint_target[item.name] for item in self._group.active_variables}
            return [joint_goal(active, self._joint_tolerance)]
        goals = [Constraints() for _ in range(max((len(poses) for poses in self._pose_targets.values()), default=0))]
        for link, poses in self._pose_targets.items():
            for goal, pose in zip(goals, poses, strict=False):
                if self._active_target is not Target.ORIENTATION:
                    goal.position_constraints.append(position_goal(link, pose, self._position_tolerance))
                if self._active_target is not Target.POSITION:
                    goal.orientation_constraints.append(orientation_goal(link, pose, self._orientation_tolerance))
        return goals

    def _stamped_pose(self, pose: Any) -> PoseStamped:
        if isinstance(pose, PoseStamped):
            stamped = PoseStamped(pose=pose.pose)
            stamped.header.frame_id = pose.header.frame_id or self.get_pose_reference_frame()
        else:
            stamped = PoseStamped(pose=pose if isinstance(pose, Pose) else conversions.list_to_pose(pose))
            stamped.header.frame_id = self.get_pose_reference_frame()
        stamped.header.stamp = rospy.Time.now()
        return stamped
