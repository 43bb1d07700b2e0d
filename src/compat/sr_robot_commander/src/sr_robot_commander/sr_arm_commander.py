# SPDX-License-Identifier: BSD-3-Clause
"""The arm commander of this framework under the public name of the one it stands in for."""

from modular_framework_core.commander.arm_commander import ArmCommander as SrArmCommander

__all__ = ["SrArmCommander"]
