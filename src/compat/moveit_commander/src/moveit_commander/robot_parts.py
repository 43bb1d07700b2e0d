# SPDX-License-Identifier: BSD-3-Clause
"""One joint and one link of a robot, as RobotCommander hands them out."""
from __future__ import annotations

from typing import TYPE_CHECKING

from geometry_msgs.msg import PoseStamped

from moveit_commander.exception import MoveItCommanderException

if TYPE_CHECKING:
    from moveit_commander.robot import RobotCommander


class Joint:
    """A joint with its bounds and its present value [rad or m]; a fixed joint has neither."""

    def __init__(self, robot: RobotCommander, name: str) -> None:
        self._robot = robot
        self._name = name

    def name(self) -> str:
        """Answers its name."""
        return self._name

    def variable_count(self) -> int:
        """Answers how many numbers describe its position."""
        return int(self._robot._model.joints[self._name].movable)

    def bounds(self) -> list[float]:
        """Answers [lower, upper]; [] of a fixed joint."""
        joint = self._robot._model.joints[self._name]
        return [joint.lower, joint.upper] if joint.movable else []

    def min_bound(self) -> float | list[float]:
        """Answers the lower bound; [] of a fixed joint."""
        return next(iter(self.bounds()), [])

    def max_bound(self) -> float | list[float]:
        """Answers the upper bound; [] of a fixed joint."""
        return next(iter(self.bounds()[1:]), [])

    def value(self) -> float | list[float]:
        """Answers where it is now; [] of a fixed joint."""
        if not self.variable_count():
            return []
        return self._robot._state.positions([self._name])[self._name]

    def move(self, position: float, wait: bool = True) -> bool:
        """Moves it, by the smallest group that has it; the group's other joints stay. Answers as go does.

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


class Link:
    """A link with its present pose."""

    def __init__(self, robot: RobotCommander, name: str) -> None:
        self._robot = robot
        self._name = name

    def name(self) -> str:
        """Answers its name."""
        return self._name

    def pose(self) -> PoseStamped:
        """Answers where it is now, in the planning frame."""
        return self._robot._link_pose(self._name)
