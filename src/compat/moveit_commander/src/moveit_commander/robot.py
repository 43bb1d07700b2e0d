# SPDX-License-Identifier: BSD-3-Clause
"""RobotCommander: joints, links, groups and current state of the robot."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import PoseStamped
from moveit_msgs.msg import RobotState
from visualization_msgs.msg import MarkerArray

from moveit_commander.exception import MoveItCommanderException
from moveit_commander.group_connection import forward_kinematics
from moveit_commander.move_group import MoveGroupCommander
from moveit_commander.robot_markers import robot_markers
from moveit_commander.robot_state import current_state
from moveit_commander.servers import Servers


class _RobotPart:
    """A named part of a robot."""

    def __init__(self, robot: RobotCommander, name: str) -> None:
        self._robot = robot
        self._name = name

    def name(self) -> str:
        """Returns the name."""
        return self._name


class Joint(_RobotPart):
    """A joint with its bounds and current value [rad or m]; lists for several variables, [] for a fixed joint."""

    def variable_count(self) -> int:
        """Returns the number of variables."""
        return len(self._robot._model.joints[self._name].variables)

    def bounds(self) -> list[Any]:
        """Returns [lower, upper]; a list of bounds for several variables, [] for a fixed joint."""
        limits = [[item.lower, item.upper] for item in self._robot._model.joints[self._name].variables]
        return limits[0] if len(limits) == 1 else limits

    def min_bound(self) -> float | list[float]:
        """Returns the lower bound; [] for a fixed joint."""
        return self._bound(0)

    def max_bound(self) -> float | list[float]:
        """Returns the upper bound; [] for a fixed joint."""
        return self._bound(1)

    def _bound(self, number: int) -> float | list[float]:
        limits = self.bounds()
        return [pair[number] for pair in limits] if self.variable_count() != 1 else float(limits[number])

    def value(self) -> float | list[float]:
        """Returns the current value; [] for a fixed joint."""
        names = [item.name for item in self._robot._model.joints[self._name].variables]
        if not names:
            return []
        positions = self._robot._state.positions(names)
        if any(name not in positions for name in names):
            raise MoveItCommanderException(f"tf has no transform of joint {self._name}; publish its transform")
        values = [positions[name] for name in names]
        return values[0] if len(values) == 1 else values

    def move(self, position: float | list[float], wait: bool = True) -> bool:
        """Moves the joint with the smallest group that contains it; other joints of the group stay.

        Returns:
            The result of `MoveGroupCommander.go`.

        Raises:
            MoveItCommanderException: No group contains the joint, or the position is out of bounds.
        """
        group = self._robot.get_default_owner_group(self._name)
        if group is None:
            raise MoveItCommanderException(f"There is no known group containing joint {self._name}. Cannot move.")
        commander = self._robot.get_group(group)
        commander.set_joint_value_target(commander.get_current_joint_values())
        commander.set_joint_value_target(self._name, position)
        return commander.go(wait)


class Link(_RobotPart):
    """A link with its current pose."""

    def pose(self) -> PoseStamped:
        """Returns the current pose in the planning frame."""
        return self._robot._link_pose(self._name)


class RobotCommander:
    """Access to a robot; groups, joints and links are also attributes (robot.arm, robot.elbow_joint)."""

    Joint = Joint
    Link = Link

    def __init__(self, robot_description: str = "robot_description", ns: str = "") -> None:
        """Reads the robot's description.

        Args:
            robot_description: Parameter of the URDF; SRDF and limits are beside it.
            ns: Namespace of move_group's endpoints and of joint_states.

        Raises:
            RobotModelError: A description is missing or invalid (a RuntimeError too).
        """
        self._robot_description = robot_description
        self._ns = ns
        self._state = current_state(robot_description, ns)
        self._model = self._state.model
        self._servers = Servers(ns)
        self._groups: dict[str, MoveGroupCommander] = {}

    def get_planning_frame(self) -> str:
        """Returns the planning frame."""
        return self._model.planning_frame

    def get_robot_name(self) -> str:
        """Returns the name of the robot."""
        return self._model.name

    def get_root_link(self) -> str:
        """Returns the root link."""
        return self._model.root_link

    def get_active_joint_names(self, group: str | None = None) -> list[str]:
        """Returns the active joints of a group or of the robot."""
        joints = self._model.joints.values() if group is None else self._model.group(group).joints
        return [joint.name for joint in joints if joint.active]

    def get_joint_names(self, group: str | None = None) -> list[str]:
        """Returns all joints of a group or of the robot, including fixed and mimic joints."""
        joints = self._model.joints.values() if group is None else self._model.group(group).joints
        return [joint.name for joint in joints]

    def get_link_names(self, group: str | None = None) -> list[str]:
        """Returns the links of a group or of the robot."""
        return list(self._model.links if group is None else self._model.group(group).links)

    def get_group_names(self) -> list[str]:
        """Returns the planning groups."""
        return sorted(self._model.groups)

    def has_group(self, name: str) -> bool:
        """Returns whether a group of this name exists."""
        return name in self._model.groups

    def get_current_state(self) -> RobotState:
        """Returns the robot's current state."""
        return self._state.message()

    def get_current_variable_values(self) -> dict[str, float]:
        """Returns the current positions [rad or m], keyed by variable; includes a moving base that tf provides."""
        return self._state.positions()

    def get_joint(self, name: str) -> Joint:
        """Returns a joint; raises MoveItCommanderException for an unknown name."""
        if name not in self._model.joints:
            raise MoveItCommanderException(f"There is no joint named {name}; get_joint_names lists the joints")
        return self.Joint(self, name)

    def get_link(self, name: str) -> Link:
        """Returns a link; raises MoveItCommanderException for an unknown name."""
        if name not in self._model.links:
            raise MoveItCommanderException(f"There is no link named {name}; get_link_names lists the links")
        return self.Link(self, name)

    def get_group(self, name: str) -> MoveGroupCommander:
        """Returns the cached commander of a group."""
        if name not in self._groups:
            self._model.group(name)
            self._groups[name] = MoveGroupCommander(name, self._robot_description, self._ns)
        return self._groups[name]

    def get_default_owner_group(self, joint_name: str) -> str | None:
        """Returns the smallest group that contains a joint, by the number of links; None if no group contains it."""
        owners = [
            group for group in self._model.groups.values() if any(joint.name == joint_name for joint in group.joints)
        ]
        return min(owners, key=lambda group: (len(group.links), group.name)).name if owners else None

    def get_robot_markers(self, *args: Any) -> MarkerArray:
        """Returns markers that show the robot.

        Args:
            args: Nothing for the current state; a RobotState; a dict of joint positions [rad or m] and optionally a
                list of links; or a group name and optionally a dict of joint positions.
        """
        values: dict[str, float] = {}
        links = self._model.links
        match args:
            case ():
                pass
            case (RobotState() as state,):
                values = self._state.values_of(state)
            case (dict() as values,):
                pass
            case (dict() as values, list() | tuple() as chosen):
                links = tuple(chosen)
            case (str() as group,):
                links = self._model.group(group).links
            case (str() as group, dict() as values):
                links = self._model.group(group).links
            case _:
                raise MoveItCommanderException(
                    f"Unexpected type: {[type(item) for item in args]}; allowed: nothing, "
                    "RobotState, dict, (dict, list of links), group, (group, dict)"
                )
        variables = {variable.name for variable in self._model.variables}
        unknown = [
            name for name in (*values, *links) if name not in {*self._model.links, *self._model.joints, *variables}
        ]
        if unknown:
            raise MoveItCommanderException(f"get_robot_markers: robot '{self._model.name}' has no {unknown}")
        positions = self._model.complete({**self._state.positions(), **values})
        return robot_markers(self._model, self._servers, self._state.message_of(positions), links)

    def _link_pose(self, link: str) -> PoseStamped:
        return forward_kinematics(self._servers, self._model.planning_frame, link, self.get_current_state())

    def __getattr__(self, name: str) -> Any:
        """Returns the group, joint or link with this name."""
        if not name.startswith("_"):
            if self.has_group(name):
                return self.get_group(name)
            if name in self._model.joints:
                return self.get_joint(name)
            if name in self._model.links:
                return self.get_link(name)
        raise AttributeError(
            f"RobotCommander has no attribute '{name}', and the robot has no group, joint or link of this name"
        )
