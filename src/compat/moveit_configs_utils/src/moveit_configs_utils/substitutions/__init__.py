# SPDX-License-Identifier: BSD-3-Clause
"""Substitutions of launch files that config packages need."""

from moveit_configs_utils.substitutions.xacro import Xacro

__all__ = ["Xacro"]
