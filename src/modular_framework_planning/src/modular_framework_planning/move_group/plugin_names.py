# SPDX-License-Identifier: BSD-3-Clause
"""MoveIt's names of the plugins of move_group that parameters may name: controller managers and capabilities."""

SIMPLE_MANAGER = "moveit_simple_controller_manager/MoveItSimpleControllerManager"
FAKE_MANAGER = "moveit_fake_controller_manager/MoveItFakeControllerManager"
ROS_CONTROL_MANAGER = "moveit_ros_control_interface/MoveItControllerManager"
ALL_ROS_CONTROL_MANAGERS = "moveit_ros_control_interface/MoveItMultiControllerManager"
CONTROLLER_MANAGERS = (SIMPLE_MANAGER, FAKE_MANAGER, ROS_CONTROL_MANAGER, ALL_ROS_CONTROL_MANAGERS)
"""Values of the parameter `moveit_controller_manager`; "::" may stand for "/"."""

DEFAULT_CAPABILITIES = (
    "move_group/MoveGroupPlanService",
    "move_group/MoveGroupCartesianPathService",
    "move_group/MoveGroupKinematicsService",
    "move_group/MoveGroupStateValidationService",
    "move_group/MoveGroupGetPlanningSceneService",
    "move_group/ApplyPlanningSceneService",
    "move_group/ClearOctomapService",
    "move_group/MoveGroupQueryPlannersService",
    "move_group/MoveGroupMoveAction",
    "move_group/MoveGroupExecuteTrajectoryAction",
    "move_group/MoveGroupPickPlaceAction",
)
OPTIONAL_CAPABILITIES = (
    "pilz_industrial_motion_planner/MoveGroupSequenceAction",
    "pilz_industrial_motion_planner/MoveGroupSequenceService",
    "move_group/TfPublisher",
)
"""Capabilities that move_group has only if the parameter `capabilities` names them."""
