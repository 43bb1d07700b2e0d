# SPDX-License-Identifier: BSD-3-Clause
"""The settings of move_group that may be adjusted while it runs, by dynamic_reconfigure as in MoveIt."""

from __future__ import annotations

from typing import Any

from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.node_parameters import declared_parameters
from modular_framework_ros.reconfiguration import Reconfiguration, adjustable


def reconfigurations(context: MoveGroupContext) -> tuple[Reconfiguration, ...]:
    """Returns a server for each part of the node that may be adjusted."""
    adjusted: tuple[tuple[str, Any, str], ...] = (
        ("trajectory_execution", context.execution, "settings"),
        ("planning_scene_monitor", context.monitor, "settings"),
        ("plan_execution", context.settings, "plan_execution"),
        ("pick_place", context.settings, "pick_place"),
        ("ompl", context.pipelines, "sampling_settings"),
    )
    return tuple(
        Reconfiguration(f"~{namespace}", adjustable(declared_parameters(), f"~{namespace}/"), holder, attribute)
        for namespace, holder, attribute in adjusted
    )
