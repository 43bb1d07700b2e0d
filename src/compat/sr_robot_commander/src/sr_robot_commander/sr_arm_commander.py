# SPDX-License-Identifier: BSD-3-Clause
"""Arm commander of this framework under the public name of sr_robot_commander's class."""

from modular_framework_core.commander.arm_commander import ArmCommander as SrArmCommander

__all__ = ["SrArmCommander"]
