# SPDX-License-Identifier: BSD-3-Clause
"""Loads a MoveIt config package into parameters, with the public interface of MoveIt 2's package on ROS 1."""

from moveit_configs_utils.moveit_configs import MoveItConfigs
from moveit_configs_utils.moveit_configs_builder import MoveItConfigsBuilder

__all__ = ["MoveItConfigs", "MoveItConfigsBuilder"]
