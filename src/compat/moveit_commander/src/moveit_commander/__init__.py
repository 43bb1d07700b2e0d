# SPDX-License-Identifier: BSD-3-Clause
"""Client of a move_group node for groups, planning scene and robot, over topics, services and actions only."""

from moveit_commander.constraints_storage import ConstraintsStorage
from moveit_commander.exception import MoveItCommanderException
from moveit_commander.group_commands import MoveGroupInfoLevel
from moveit_commander.interpreter import MoveGroupCommandInterpreter
from moveit_commander.move_group import MoveGroupCommander
from moveit_commander.planning_scene_interface import PlanningSceneInterface, acm_set_allowed, acm_set_default
from moveit_commander.robot import RobotCommander
from moveit_commander.roscpp_initializer import roscpp_initialize, roscpp_shutdown

__all__ = [
    "ConstraintsStorage",
    "MoveGroupCommandInterpreter",
    "MoveGroupCommander",
    "MoveGroupInfoLevel",
    "MoveItCommanderException",
    "PlanningSceneInterface",
    "RobotCommander",
    "acm_set_allowed",
    "acm_set_default",
    "roscpp_initialize",
    "roscpp_shutdown",
]
