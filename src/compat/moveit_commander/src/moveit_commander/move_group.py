# SPDX-License-Identifier: BSD-3-Clause
"""The commander of one planning group: MoveGroupCommander."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Real

import rospy
from moveit_msgs.msg import RobotState, RobotTrajectory

from moveit_commander.chain_jacobian import jacobian
from moveit_commander.exception import MoveItCommanderException
from moveit_commander.group_objects import GroupObjects
from moveit_commander.robot_model import group_values
from moveit_commander.trajectory_timing import ALGORITHMS
from moveit_commander.trajectory_waypoints import retimed_trajectory


class MoveGroupCommander(GroupObjects):
    """Plans and executes motions of a planning group through the move_group node."""

    def __init__(
        self, name: str, robot_description: str = "robot_description", ns: str = "", wait_for_servers: float = 5.0
    ) -> None:
        """Connects to move_group.

        Args:
            name: Planning group.
            robot_description: Parameter of the robot's URDF; SRDF and limits are beside it.
            ns: Namespace of move_group's endpoints and of joint_states.
            wait_for_servers: Timeout of the connection [s]; 0 waits forever.

        Raises:
            RobotModelError: The group or the description does not exist (a RuntimeError too).
            ServerError: move_group did not answer in time (a RuntimeError too).
        """
        super().__init__(name, robot_description, ns, wait_for_servers)

    def get_jacobian_matrix(
        self, joint_values: Sequence[float], reference_point: Sequence[float] | None = None
    ) -> list[list[float]]:
        """Returns the 6 x n Jacobian of the group's last link, in the frame of the group's base link.

        Args:
            joint_values: Positions of the group's variables [rad or m].
            reference_point: Point of the last link in its frame [m]; None for its origin.

        Raises:
            MoveItCommanderException: The group is not a chain, or the number of values is wrong.
        """
        if not self._group.is_chain:
            raise MoveItCommanderException(f"get_jacobian_matrix: group '{self._group.name}' is not a chain")
        if any(joint.parts for joint in self._group.joints):
            raise MoveItCommanderException(
                f"get_jacobian_matrix: group '{self._group.name}' has a planar or floating joint; use a group of "
                "revolute and prismatic joints only"
            )
        chain = self._model.chain(self._group.joints[0].parent, self._group.tip)
        positions = self._model.complete(group_values(self._group, joint_values))
        matrix = jacobian(chain, positions, reference_point or (0.0, 0.0, 0.0))
        return [[float(value) for value in row] for row in matrix]

    def retime_trajectory(
        self,
        ref_state_in: RobotState,
        traj_in: RobotTrajectory,
        velocity_scaling_factor: float = 1.0,
        acceleration_scaling_factor: float = 1.0,
        algorithm: str = "iterative_time_parameterization",
    ) -> RobotTrajectory:
        """Returns the trajectory with the same waypoints but new times, velocities and accelerations.

        The joints and a planar or floating base are timed together.

        Args:
            ref_state_in: State of the other joints, which is ignored.
            traj_in: Trajectory; repeated points are removed.
            velocity_scaling_factor: Fraction of the maximum velocities, in (0, 1].
            acceleration_scaling_factor: Fraction of the maximum accelerations, in (0, 1].
            algorithm: One of MoveIt's names, which all select the same time-optimal algorithm. As in MoveIt, an
                unknown name logs an error and returns an empty trajectory.

        Raises:
            MoveItCommanderException: An argument has a wrong type, a joint is unknown, the positions of a point are
                not one finite number per joint, or a limit is not above 0.
        """
        for name, value, kind in (
            ("ref_state_in", ref_state_in, RobotState),
            ("traj_in", traj_in, RobotTrajectory),
            ("velocity_scaling_factor", velocity_scaling_factor, Real),
            ("acceleration_scaling_factor", acceleration_scaling_factor, Real),
            ("algorithm", algorithm, str),
        ):
            if not isinstance(value, kind):
                raise MoveItCommanderException(
                    f"retime_trajectory: {name} is a {type(value).__name__}; a {kind.__name__} is needed"
                )
        if algorithm not in ALGORITHMS:
            rospy.logerr(
                "retime_trajectory: unknown time parameterization algorithm '%s'; allowed: %s; the answer is "
                "an empty trajectory",
                algorithm,
                ", ".join(ALGORITHMS),
            )
            return RobotTrajectory()
        velocity_factor = _factor("velocity", velocity_scaling_factor)
        acceleration_factor = _factor("acceleration", acceleration_scaling_factor)
        return retimed_trajectory(self._model, traj_in, velocity_factor, acceleration_factor)


def _factor(kind: str, value: float) -> float:
    """Returns the scaling factor; as in MoveIt, a factor outside (0, 1] is replaced by 1 with a warning."""
    if 0.0 < value <= 1.0:
        return value
    rospy.logwarn("retime_trajectory: %s_scaling_factor is %s; allowed: 0 < factor <= 1; 1 is used", kind, value)
    return 1.0
