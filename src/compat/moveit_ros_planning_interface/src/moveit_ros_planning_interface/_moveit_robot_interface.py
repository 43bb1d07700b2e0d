# SPDX-License-Identifier: BSD-3-Clause
"""Robot description and current state with serialized messages, as in MoveIt's Python binding."""

from __future__ import annotations

from typing import Any

from moveit_commander.conversions import pose_to_list
from moveit_commander.robot import RobotCommander
from moveit_commander.robot_state import current_state
from moveit_msgs.msg import RobotState

from moveit_ros_planning_interface.serialized import read, write


class RobotInterface:
    """Robot model and current state; methods return an empty result for an unknown name."""

    def __init__(self, robot_description: str, ns: str = "") -> None:
        """Reads the robot description; raises RuntimeError if it is missing or invalid.

        Args:
            robot_description: Parameter with the URDF; prefix of the parameters with SRDF and limits.
            ns: Namespace of move_group's services and of joint_states.
        """
        self._robot = RobotCommander(robot_description, ns)
        self._model = current_state(robot_description, ns).model

    def get_robot_name(self) -> str:
        """Returns the name in the robot description."""
        return self._robot.get_robot_name()

    def get_robot_root_link(self) -> str:
        """Returns the root link."""
        return self._robot.get_root_link()

    def get_planning_frame(self) -> str:
        """Returns the planning frame."""
        return self._robot.get_planning_frame()

    def get_joint_names(self) -> list[str]:
        """Returns all joints, including fixed joints and mimic joints."""
        return self._robot.get_joint_names()

    def get_active_joint_names(self) -> list[str]:
        """Returns the active joints."""
        return self._robot.get_active_joint_names()

    def get_link_names(self) -> list[str]:
        """Returns all links."""
        return self._robot.get_link_names()

    def has_group(self, group: str) -> bool:
        """Returns whether the planning group exists."""
        return self._robot.has_group(group)

    def get_group_names(self) -> list[str]:
        """Returns the planning groups."""
        return self._robot.get_group_names()

    def get_group_joint_names(self, group: str) -> list[str]:
        """Returns all joints of a group."""
        return self._robot.get_joint_names(group) if self.has_group(group) else []

    def get_group_active_joint_names(self, group: str) -> list[str]:
        """Returns the active joints of a group."""
        return self._robot.get_active_joint_names(group) if self.has_group(group) else []

    def get_group_link_names(self, group: str) -> list[str]:
        """Returns the links of a group."""
        return self._robot.get_link_names(group) if self.has_group(group) else []

    def get_group_joint_tips(self, group: str) -> list[str]:
        """Returns the parent links of the end effectors that are attached to a group."""
        return [item.parent_link for item in self._model.end_effectors if item.parent_group == group]

    def get_parent_group(self, group: str) -> tuple[str, str]:
        """Returns the parent group and parent link of an end effector's group; empty strings if not attached."""
        found = [item for item in self._model.end_effectors if item.group == group]
        return (found[0].parent_group, found[0].parent_link) if found else ("", "")

    def get_group_default_states(self, group: str) -> list[str]:
        """Returns the names of the group's states in the SRDF."""
        return sorted(self._model.groups[group].states) if self.has_group(group) else []

    def get_joint_values(self, group: str, named_state: str) -> dict[str, float]:
        """Returns the joint values of a group's state in the SRDF [rad or m]."""
        states = self._model.groups[group].states if self.has_group(group) else {}
        return dict(states.get(named_state, {}))

    def get_joint_limits(self, name: str) -> list[list[float]]:
        """Returns [lower, upper] of each variable of a joint [rad or m]."""
        bounds = self._robot.get_joint(name).bounds() if name in self._model.joints else []
        return [bounds] if bounds else []

    def get_link_pose(self, name: str) -> list[float]:
        """Returns [x, y, z, qx, qy, qz, qw] of a link in the planning frame [m]."""
        return pose_to_list(self._robot.get_link(name).pose().pose) if name in self._model.links else []

    def get_current_state(self) -> bytes:
        """Returns the current state (moveit_msgs/RobotState)."""
        return write(self._robot.get_current_state())

    def get_current_variable_values(self) -> dict[str, float]:
        """Returns the current joint positions by name [rad or m]."""
        return self._robot.get_current_variable_values()

    def get_current_joint_values(self, name: str) -> list[float]:
        """Returns the current values of a joint's variables [rad or m]."""
        value = self._robot.get_joint(name).value() if name in self._model.joints else []
        return value if isinstance(value, list) else [value]

    def get_robot_markers(self, *args: Any) -> bytes:
        """Returns visualization_msgs/MarkerArray of the robot.

        Args:
            args: Either no argument, a serialized moveit_msgs/RobotState, a list of links, or a dict of joint positions
                [rad or m], optionally followed by a list of links.
        """
        match args:
            case (bytes() as state,):
                args = (read(RobotState, state),)
            case (list() | tuple() as links,):
                args = ({}, links)
        return write(self._robot.get_robot_markers(*args))

    def get_group_markers(self, group: str, *values: dict[str, float]) -> bytes:
        """Returns visualization_msgs/MarkerArray of a group, optionally at given joint positions [rad or m]."""
        return write(self._robot.get_robot_markers(group, *values))
