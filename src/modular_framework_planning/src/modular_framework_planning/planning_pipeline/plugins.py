# SPDX-License-Identifier: BSD-3-Clause
"""Planners and request adapters by their names in config packages: a MoveIt name or `module/Class`."""

from __future__ import annotations

import re

from modular_framework_planning.errors import ModelError
from modular_framework_planning.planning_interface.planner_interface import Planner
from modular_framework_planning.planning_interface.planning_request import PipelineSettings
from modular_framework_planning.planning_interface.plugin_classes import plugin_class
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_ros.allowed_names import closest, nearest

PACKAGE = "modular_framework_planning"
PLANNERS = {
    "ompl_interface/OMPLPlanner": f"{PACKAGE}.planners.ompl.planner/OmplPlanner",
    "pilz_industrial_motion_planner/CommandPlanner": f"{PACKAGE}.planners.pilz.command_planner/CommandPlanner",
    "stomp_moveit/StompPlannerManager": f"{PACKAGE}.planners.stomp.planner/StompPlanner",
    "mbf_method/ExternalPlanner": f"{PACKAGE}.planners.external.planner/ExternalPlanner",
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
# MoveIt adapters that are accepted without effect, with the reason.
NOT_NEEDED = {"Empty": "does nothing", "ResolveConstraintFrames": "frames are resolved when a request is read"}
PLANNER = f"{Planner.__module__}.{Planner.__name__}"
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
    """Returns the planner of a pipeline.

    Args:
        plugin: Parameter `planning_plugin`: a key of PLANNERS, with "/" or "::", or `module/Class`.
        model: Robot model.
        settings: Settings of the pipeline.

    Raises:
        ModelError: The class does not exist or is not derived from `Planner`; lists the allowed names.
        PlanningError: A parameter of the planner is invalid.
    """
    return planner_class(plugin).configure(model, settings)


def planner_class(plugin: str) -> type[Planner]:
    """Returns the planner class of a planning_plugin; raises ModelError as `make_planner` does."""
    name = plugin.replace("::", "/")
    allowed = f"allowed: {', '.join(sorted(PLANNERS))} and module/Class of a class derived from {PLANNER}"
    allowed += nearest(name, PLANNERS)
    planner_type = plugin_class(PLANNERS.get(name, name), f"planning_plugin '{plugin}'", allowed)
    if not issubclass(planner_type, Planner):
        raise ModelError(
            f"planning_plugin '{plugin}': {planner_type.__name__} is not derived from {PLANNER}; {allowed}"
        )
    if missing := sorted(planner_type.__abstractmethods__):
        raise ModelError(f"planning_plugin '{plugin}': {planner_type.__name__} does not define {', '.join(missing)}")
    return planner_type


def make_adapters(names: str = DEFAULT_ADAPTERS) -> tuple[RequestAdapter, ...]:
    """Returns the request adapters of a pipeline, outermost first.

    Args:
        names: Parameter `request_adapters`: MoveIt names or `module/Class`, separated by spaces.

    Raises:
        ModelError: A name is unknown; lists the allowed names.
    """
    result = []
    for name in names.split():
        short = name.removeprefix(f"{MOVEIT_ADAPTERS}/")
        if short in NOT_NEEDED:
            continue
        allowed = _allowed_adapters(name)
        path = f"{PACKAGE}.planning_pipeline.adapters.{_snake_case(short)}/{short}" if short in ADAPTERS else name
        adapter = plugin_class(path, f"request_adapters: '{name}'", allowed)()
        if not callable(getattr(adapter, "adapt_and_plan", None)):
            raise ModelError(f"request_adapters: '{name}' has no method adapt_and_plan; {allowed}")
        result.append(adapter)
    return tuple(result)


def _allowed_adapters(name: str) -> str:
    """Returns the allowed names, and the adapter most similar to a name."""
    known = sorted({*ADAPTERS, *NOT_NEEDED})
    meant = closest(name.rpartition("/")[2], known)  # the common first part would make all names similar
    hint = f"; did you mean '{MOVEIT_ADAPTERS}/{meant}'?" if meant else ""
    names = ", ".join(f"{MOVEIT_ADAPTERS}/{item}" for item in known)
    return f"allowed: {names} and module/Class of a class with a method adapt_and_plan{hint}"


def _snake_case(name: str) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()
