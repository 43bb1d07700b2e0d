# SPDX-License-Identifier: BSD-3-Clause
"""Settings of move_group that dynamic_reconfigure can change at runtime, as in MoveIt."""

from __future__ import annotations

from typing import Any

from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.node_parameters import declared_parameters
from modular_framework_ros.reconfiguration import Reconfiguration, adjustable


def reconfigurations(context: MoveGroupContext) -> tuple[Reconfiguration, ...]:
    """Returns a dynamic_reconfigure server for each adjustable part of the node."""
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
