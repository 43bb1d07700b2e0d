# SPDX-License-Identifier: BSD-3-Clause
"""Planning settings of a group: planner, times, tolerances, scaling factors, workspace, start state, constraints."""

from __future__ import annotations

import math
from collections.abc import Sequence

from moveit_msgs.msg import Constraints, RobotState, TrajectoryConstraints, WorkspaceParameters

from moveit_commander.constraints_storage import ConstraintsStorage
from moveit_commander.exception import MoveItCommanderException
from moveit_commander.group_connection import GroupConnection

NO_DATABASE = (
    "no database of constraints is selected: call set_constraints_database with the path of an SQLite file, "
    "or give the moveit_msgs/Constraints message"
)


class GroupSettings(GroupConnection):
    """Settings of every planning request of a group."""

    def __init__(self, name: str, robot_description: str, ns: str, wait_for_servers: float) -> None:
        super().__init__(name, robot_description, ns, wait_for_servers)
        self._planning_time_s = 5.0
        self._attempts = 1
        self._pipeline_id = self._planner_id = ""
        self._looking = self._replanning = False
        kinematics = f"_kinematics/{name}/goal_"
        self._joint_tolerance = self._parameter(f"{kinematics}joint_tolerance", 1e-4)
        self._position_tolerance = self._parameter(f"{kinematics}position_tolerance", 1e-4)
        self._orientation_tolerance = self._parameter(f"{kinematics}orientation_tolerance", 1e-3)
        self._velocity_scaling = self._parameter("_planning/default_velocity_scaling_factor", 0.1)
        self._acceleration_scaling = self._parameter("_planning/default_acceleration_scaling_factor", 0.1)
        self._speed_limit = 0.0
        self._speed_limited_link = ""
        self._workspace = WorkspaceParameters()
        self._start_state = RobotState(is_diff=True)
        self._path_constraints = Constraints()
        self._trajectory_constraints = TrajectoryConstraints()
        self._support_surface = ""
        self.constraints_storage: ConstraintsStorage | None = None

    def set_start_state_to_current_state(self) -> None:
        """Plans from the current state."""
        self._start_state = RobotState(is_diff=True)

    def set_start_state(self, msg: RobotState) -> None:
        """Plans from a given state."""
        self._start_state = msg

    def get_goal_tolerance(self) -> tuple[float, float, float]:
        """Returns the tolerances of joint [rad or m], position [m] and orientation [rad] goals."""
        return self._joint_tolerance, self._position_tolerance, self._orientation_tolerance

    def get_goal_joint_tolerance(self) -> float:
        """Returns the tolerance of joint goals [rad or m]."""
        return self._joint_tolerance

    def get_goal_position_tolerance(self) -> float:
        """Returns the radius of the tolerance sphere of position goals [m]."""
        return self._position_tolerance

    def get_goal_orientation_tolerance(self) -> float:
        """Returns the tolerance of orientation goals about each axis [rad]."""
        return self._orientation_tolerance

    def set_goal_tolerance(self, value: float) -> None:
        """Sets all three tolerances to one value."""
        self._joint_tolerance = self._position_tolerance = self._orientation_tolerance = value

    def set_goal_joint_tolerance(self, value: float) -> None:
        """Sets the tolerance of joint goals [rad or m]."""
        self._joint_tolerance = value

    def set_goal_position_tolerance(self, value: float) -> None:
        """Sets the radius of the tolerance sphere of position goals [m]."""
        self._position_tolerance = value

    def set_goal_orientation_tolerance(self, value: float) -> None:
        """Sets the tolerance of orientation goals about each axis [rad]."""
        self._orientation_tolerance = value

    def allow_looking(self, value: bool) -> None:
        """Sets whether move_group may look around with its sensors during motions."""
        self._looking = bool(value)

    def allow_replanning(self, value: bool) -> None:
        """Sets whether move_group may replan when the scene changes during a motion."""
        self._replanning = bool(value)

    def get_known_constraints(self) -> list[str]:
        """Returns the names of the group's constraints in the database; empty without a database."""
        storage = self.constraints_storage
        return [] if storage is None else storage.get_known_constraints(self._model.name, self._group.name)

    def set_constraints_database(self, host: str, port: int) -> None:
        """Selects the database of named path constraints.

        Args:
            host: Path of an SQLite file of the plugin warehouse_ros_sqlite; ConstraintsStorage writes such files.
            port: Ignored for a file.

        Raises:
            MoveItCommanderException: The path is not a file of constraints.
        """
        self.constraints_storage = ConstraintsStorage(host)

    def get_path_constraints(self) -> Constraints:
        """Returns the path constraints."""
        return self._path_constraints

    def set_path_constraints(self, value: Constraints | str | None) -> None:
        """Sets the path constraints as a message or by name in the database; None clears them.

        Raises:
            MoveItCommanderException: The name is unknown, no database is selected, or the type is unsupported.
        """
        if value is None:
            self.clear_path_constraints()
        elif isinstance(value, Constraints):
            self._path_constraints = value
        elif isinstance(value, str) and self.constraints_storage is not None:
            self._path_constraints = self.constraints_storage.get_constraints(value, self._model.name, self._group.name)
        else:
            raise MoveItCommanderException(f"Unable to set path constraints {value!r}: {NO_DATABASE}")

    def clear_path_constraints(self) -> None:
        """Clears the path constraints."""
        self._path_constraints = Constraints()

    def get_trajectory_constraints(self) -> TrajectoryConstraints:
        """Returns the trajectory constraints."""
        return self._trajectory_constraints

    def set_trajectory_constraints(self, value: TrajectoryConstraints | None) -> None:
        """Sets the trajectory constraints; None clears them."""
        if value is None:
            self.clear_trajectory_constraints()
        elif isinstance(value, TrajectoryConstraints):
            self._trajectory_constraints = value
        else:
            raise MoveItCommanderException(
                f"Unable to set trajectory constraints {value!r}: a moveit_msgs/TrajectoryConstraints is needed"
            )

    def clear_trajectory_constraints(self) -> None:
        """Clears the trajectory constraints."""
        self._trajectory_constraints = TrajectoryConstraints()

    def set_planning_time(self, seconds: float) -> None:
        """Sets the planning time [s]; as in MoveIt, times of 0 or less are ignored."""
        if seconds > 0.0:
            self._planning_time_s = float(seconds)

    def get_planning_time(self) -> float:
        """Returns the planning time [s]."""
        return self._planning_time_s

    def set_planning_pipeline_id(self, planning_pipeline: str) -> None:
        """Selects the planning pipeline (e.g. ompl), "" for move_group's default, and clears the planner id."""
        if planning_pipeline != self._pipeline_id:
            self._pipeline_id, self._planner_id = planning_pipeline, ""

    def get_planning_pipeline_id(self) -> str:
        """Returns the planning pipeline; "" for move_group's default."""
        return self._pipeline_id

    def set_planner_id(self, planner_id: str) -> None:
        """Selects a planner of the pipeline (e.g. RRTConnect); "" for the group's default."""
        self._planner_id = planner_id

    def get_planner_id(self) -> str:
        """Returns the selected planner; "" for the group's default."""
        return self._planner_id

    def set_num_planning_attempts(self, num_planning_attempts: int) -> None:
        """Sets the number of plans; the shortest plan is returned."""
        self._attempts = int(num_planning_attempts)

    def set_workspace(self, ws: Sequence[float]) -> None:
        """Sets the workspace [m]: [], [min x, min y, max x, max y] or [min x, y, z, max x, y, z]."""
        values = [float(value) for value in ws]
        if len(values) not in (0, 4, 6):
            raise MoveItCommanderException(f"Expected 0, 4 or 6 values in list specifying workspace; got {len(values)}")
        if len(values) == 4:
            values = [values[0], values[1], 0.0, values[2], values[3], 0.0]
        values = values or [0.0] * 6
        box = WorkspaceParameters()
        box.header.frame_id = self.get_planning_frame()
        box.min_corner.x, box.min_corner.y, box.min_corner.z = values[:3]
        box.max_corner.x, box.max_corner.y, box.max_corner.z = values[3:]
        self._workspace = box

    def set_max_velocity_scaling_factor(self, value: float) -> None:
        """Sets the fraction of the maximum joint velocities, in (0, 1]."""
        self._velocity_scaling = _scaling_factor(value, "velocity")

    def set_max_acceleration_scaling_factor(self, value: float) -> None:
        """Sets the fraction of the maximum joint accelerations, in (0, 1]."""
        self._acceleration_scaling = _scaling_factor(value, "acceleration")

    def limit_max_cartesian_link_speed(self, speed: float, link_name: str = "") -> None:
        """Limits the speed of a link (default: the end effector link) [m/s]."""
        if not (math.isfinite(speed) and speed > 0.0):
            raise MoveItCommanderException(f"Expected speed value to be greater than 0; got {speed} m/s")
        self._speed_limit, self._speed_limited_link = float(speed), link_name

    def clear_max_cartesian_link_speed(self) -> None:
        """Removes the speed limit of a link."""
        self._speed_limit, self._speed_limited_link = 0.0, ""

    def set_support_surface_name(self, value: str) -> None:
        """Sets the object that supports picked and placed objects."""
        self._support_surface = value


def _scaling_factor(value: float, limit: str) -> float:
    if not 0.0 < value <= 1.0:
        raise MoveItCommanderException(
            f"Expected value in the range from 0 to 1 for scaling factor; got {value} for {limit}, allowed: (0, 1]"
        )
    return float(value)
