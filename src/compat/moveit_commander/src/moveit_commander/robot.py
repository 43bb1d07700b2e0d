# SPDX-License-Identifier: BSD-3-Clause
"""RobotCommander: the joints, links, groups and current state of the robot."""

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
    """Something of a robot that has a name."""

    def __init__(self, robot: RobotCommander, name: str) -> None:
        self._robot = robot
        self._name = name

    def name(self) -> str:
        """Returns its name."""
        return self._name


class Joint(_RobotPart):
    """A joint with its bounds and its present value [rad or m], lists of these if it has several variables, or none."""

    def variable_count(self) -> int:
        """Returns how many numbers describe its position."""
        return len(self._robot._model.joints[self._name].variables)

    def bounds(self) -> list[Any]:
        """Returns [lower, upper], a list of these for several variables, [] of a fixed joint."""
        limits = [[item.lower, item.upper] for item in self._robot._model.joints[self._name].variables]
        return limits[0] if len(limits) == 1 else limits

    def min_bound(self) -> float | list[float]:
        """Returns the lower bound; [] of a fixed joint."""
        return self._bound(0)

    def max_bound(self) -> float | list[float]:
        """Returns the upper bound; [] of a fixed joint."""
        return self._bound(1)

    def _bound(self, number: int) -> float | list[float]:
        limits = self.bounds()
        return [pair[number] for pair in limits] if self.variable_count() != 1 else float(limits[number])

    def value(self) -> float | list[float]:
        """Returns where it is now; [] of a fixed joint."""
        names = [item.name for item in self._robot._model.joints[self._name].variables]
        if not names:
            return []
        positions = self._robot._state.positions(names)
        if any(name not in positions for name in names):
            raise MoveItCommanderException(f"tf does not show where joint {self._name} is; publish its transform")
        values = [positions[name] for name in names]
        return values[0] if len(values) == 1 else values

    def move(self, position: float | list[float], wait: bool = True) -> bool:
        """Moves it, by the smallest group that has it; the group's other joints stay. Returns as go does.

        Raises:
            MoveItCommanderException: no group has it, or the position is out of bounds.
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
        """Returns where it is now, in the planning frame."""
        return self._robot._link_pose(self._name)


class RobotCommander:
    """Answers questions about a robot; groups, joints and links are attributes too (robot.arm, robot.elbow_joint)."""

    Joint = Joint
    Link = Link

    def __init__(self, robot_description: str = "robot_description", ns: str = "") -> None:
        """Reads the robot's description.

        Args:
            robot_description: parameter with the URDF; SRDF and limits are beside it.
            ns: namespace of move_group's endpoints and of joint_states.

        Raises:
            RobotModelError: a description is missing or cannot be read (a RuntimeError too).
        """
        self._robot_description = robot_description
        self._ns = ns
        self._state = current_state(robot_description, ns)
        self._model = self._state.model
        self._servers = Servers(ns)
        self._groups: dict[str, MoveGroupCommander] = {}

    def get_planning_frame(self) -> str:
        """Returns the frame in which planning is done."""
        return self._model.planning_frame

    def get_robot_name(self) -> str:
        """Returns the name in the robot's description."""
        return self._model.name

    def get_root_link(self) -> str:
        """Returns the link that has no parent."""
        return self._model.root_link

    def get_active_joint_names(self, group: str | None = None) -> list[str]:
        """Returns the joints of a group, or of the robot, that move by themselves."""
        joints = self._model.joints.values() if group is None else self._model.group(group).joints
        return [joint.name for joint in joints if joint.active]

    def get_joint_names(self, group: str | None = None) -> list[str]:
        """Returns all joints of a group, or of the robot, fixed and mimic ones included."""
        joints = self._model.joints.values() if group is None else self._model.group(group).joints
        return [joint.name for joint in joints]

    def get_link_names(self, group: str | None = None) -> list[str]:
        """Returns the links of a group, or of the robot."""
        return list(self._model.links if group is None else self._model.group(group).links)

    def get_group_names(self) -> list[str]:
        """Returns the planning groups."""
        return sorted(self._model.groups)

    def has_group(self, name: str) -> bool:
        """Returns whether there is a group of that name."""
        return name in self._model.groups

    def get_current_state(self) -> RobotState:
        """Returns the robot's current state."""
        return self._state.message()

    def get_current_variable_values(self) -> dict[str, float]:
        """Returns the current positions by variable [rad or m]; a base that moves is among them where tf has it."""
        return self._state.positions()

    def get_joint(self, name: str) -> Joint:
        """Returns a joint; raises MoveItCommanderException if there is none of that name."""
        if name not in self._model.joints:
            raise MoveItCommanderException(f"There is no joint named {name}; get_joint_names lists those there are")
        return self.Joint(self, name)

    def get_link(self, name: str) -> Link:
        """Returns a link; raises MoveItCommanderException if there is none of that name."""
        if name not in self._model.links:
            raise MoveItCommanderException(f"There is no link named {name}; get_link_names lists those there are")
        return self.Link(self, name)

    def get_group(self, name: str) -> MoveGroupCommander:
        """Returns the commander of a group, the same one each time."""
        if name not in self._groups:
            self._model.group(name)
            self._groups[name] = MoveGroupCommander(name, self._robot_description, self._ns)
        return self._groups[name]

    def get_default_owner_group(self, joint_name: str) -> str | None:
        """Returns the group with the fewest links of those that have a joint; None if no group has it."""
        owners = [
            group for group in self._model.groups.values() if any(joint.name == joint_name for joint in group.joints)
        ]
        return min(owners, key=lambda group: (len(group.links), group.name)).name if owners else None

    def get_robot_markers(self, *args: Any) -> MarkerArray:
        """Returns markers that show the robot.

        Args:
            args: nothing: as it is now; a RobotState; a dict of joint positions [rad or m], and perhaps a list of
                links; or a group's name, and perhaps a dict of joint positions.
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
        """Finds groups, joints and links by their names."""
        if not name.startswith("_"):
            if self.has_group(name):
                return self.get_group(name)
            if name in self._model.joints:
                return self.get_joint(name)
            if name in self._model.links:
                return self.get_link(name)
        raise AttributeError(
            f"RobotCommander has no attribute '{name}', and the robot no group, joint or link of that name"
        )
