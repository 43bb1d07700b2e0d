# SPDX-License-Identifier: BSD-3-Clause
"""Finds planners and request adapters by the names config packages give them: MoveIt's, or `module/Class`."""

from __future__ import annotations

import re
from typing import Any

from modular_framework_planning.errors import ModelError
from modular_framework_planning.planning_interface.planner_interface import Planner
from modular_framework_planning.planning_interface.planning_request import PipelineSettings
from modular_framework_planning.planning_interface.plugin_classes import plugin_class
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter
from modular_framework_planning.robot_model.robot_model import RobotModel

PACKAGE = "modular_framework_planning"
PLANNERS = {
    "ompl_interface/OMPLPlanner": f"{PACKAGE}.planners.ompl.planner/OmplPlanner",
    "pilz_industrial_motion_planner/CommandPlanner": f"{PACKAGE}.planners.pilz.command_planner/CommandPlanner",
    "stomp_moveit/StompPlannerManager": f"{PACKAGE}.planners.stomp.planner/StompPlanner",
    "stomp_moveit/StompPlanner": f"{PACKAGE}.planners.stomp.planner/StompPlanner",
}
ADAPTERS = (
    "AddIterativeSplineParameterization",
    "AddRuckigTrajectorySmoothing",
    "AddTimeOptimalParameterization",
    "AddTimeParameterization",
    "FixStartStateBounds",
    "FixStartStateCollision",
    "FixStartStatePathConstraints",
    "FixWorkspaceBounds",
    "LimitMaxCartesianLinkSpeed",
)
# Names of MoveIt's adapters that have no effect here, and why.
NOT_NEEDED = {"Empty": "does nothing", "ResolveConstraintFrames": "frames are resolved when a request is read"}
DEFAULT_PLANNER = "ompl_interface/OMPLPlanner"
MOVEIT_ADAPTERS = "default_planner_request_adapters"
DEFAULT_ADAPTERS = " ".join(
    f"{MOVEIT_ADAPTERS}/{name}"
    for name in (
        "LimitMaxCartesianLinkSpeed",
        "AddTimeOptimalParameterization",
        "FixWorkspaceBounds",
        "FixStartStateBounds",
        "FixStartStateCollision",
        "FixStartStatePathConstraints",
    )
)


def make_planner(plugin: str, model: RobotModel, settings: PipelineSettings) -> Planner:
    """Makes the planner of a pipeline.

    Args:
        plugin: parameter `planning_plugin`: a name of PLANNERS ("::" may stand for "/"), or `module/Class`.
        model: argument of the class method `configure` of planners that have one.
        settings: its other argument.

    Raises:
        ModelError: there is no such class, or it has no method `plan`; lists the planners there are.
        PlanningError: the planner refuses its parameters.
    """
    kind = planner_class(plugin)
    planner: Planner = kind.configure(model, settings) if hasattr(kind, "configure") else kind()
    return planner


def planner_class(plugin: str) -> Any:
    """Returns the class that a planning_plugin names; arguments and errors as for `make_planner`."""
    name = plugin.replace("::", "/")
    known = f"known are {', '.join(sorted(PLANNERS))} and module/Class of a class with a method plan(problem)"
    kind = plugin_class(PLANNERS.get(name, name), f"planning_plugin '{plugin}'", known)
    if not callable(getattr(kind, "plan", None)):
        raise ModelError(f"planning_plugin '{plugin}': class {kind.__name__} has no method plan; {known}")
    return kind


def make_adapters(names: str = DEFAULT_ADAPTERS) -> tuple[RequestAdapter, ...]:
    """Makes the adapters of a pipeline, outermost first.

    Args:
        names: parameter `request_adapters`, separated by spaces; each MoveIt's name or `module/Class`.

    Raises:
        ModelError: one is not known; lists those that are.
    """
    known = (
        f"known are {', '.join(f'{MOVEIT_ADAPTERS}/{name}' for name in sorted({*ADAPTERS, *NOT_NEEDED}))} and "
        "module/Class of a class with a method adapt_and_plan"
    )
    result = []
    for name in names.split():
        short = name.removeprefix(f"{MOVEIT_ADAPTERS}/")
        if short in NOT_NEEDED:
            continue
        path = f"{PACKAGE}.planning_pipeline.adapters.{_snake_case(short)}/{short}" if short in ADAPTERS else name
        adapter = plugin_class(path, f"request_adapters: '{name}'", known)()
        if not callable(getattr(adapter, "adapt_and_plan", None)):
            raise ModelError(f"request_adapters: '{name}' has no method adapt_and_plan; {known}")
        result.append(adapter)
    return tuple(result)


def _snake_case(name: str) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()
