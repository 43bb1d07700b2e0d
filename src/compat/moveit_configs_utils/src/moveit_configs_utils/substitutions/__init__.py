# SPDX-License-Identifier: BSD-3-Clause
"""Launch substitutions for config packages."""

from moveit_configs_utils.substitutions.xacro import Xacro

__all__ = ["Xacro"]
