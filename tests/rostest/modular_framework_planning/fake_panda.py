# SPDX-License-Identifier: BSD-3-Clause
"""The public Panda on fake controllers, and its arm at full speed."""

from __future__ import annotations

from typing import Any

from moveit_commander import MoveGroupCommander

FAKE_PANDA = """  <node name="joint_state_publisher" pkg="joint_state_publisher" type="joint_state_publisher">
    <rosparam param="source_list">[move_group/fake_controller_joint_states]</rosparam>
  </node>
  <node name="robot_state_publisher" pkg="robot_state_publisher" type="robot_state_publisher"/>
  <include file="$(find panda_moveit_config)/launch/move_group.launch">
    <arg name="moveit_controller_manager" value="fake"/>
    <arg name="load_robot_description" value="true"/>
  </include>
"""
"""Nodes of a launch file."""


def fast_panda_arm(session: Any) -> MoveGroupCommander:
    """Waits for move_group and returns the arm, at the robot's own limits."""
    session.wait_for_service("plan_kinematic_path", 120.0)
    commander = MoveGroupCommander("panda_arm", wait_for_servers=30.0)
    commander.set_max_velocity_scaling_factor(1.0)
    commander.set_max_acceleration_scaling_factor(1.0)
    return commander
