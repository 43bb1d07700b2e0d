# SPDX-License-Identifier: BSD-3-Clause
"""Checks the pipeline parameters of an experiment, and the planner names in these parameters."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from modular_framework_core.launching.ros_declared_names import DeclaredNames, LaunchFault
from modular_framework_core.launching.ros_launch_preview import LaunchedNode, LaunchPreview, leaves
from modular_framework_planning.errors import ModelError
from modular_framework_planning.move_group.plugin_names import (
    CONTROLLER_MANAGERS,
    DEFAULT_CAPABILITIES,
    OPTIONAL_CAPABILITIES,
    SIMPLE_MANAGER,
)
from modular_framework_planning.planning_interface.collision_detectors import checker_name, collision_detector
from modular_framework_planning.planning_pipeline.planner_registry import PlannerRegistry, UnknownNameError
from modular_framework_ros.allowed_names import listing, misspelling, nearest
from modular_framework_ros.declared_trees import tree_fault
from modular_framework_ros.parameter_declarations import existing_declaration

PACKAGE = "modular_framework_planning"
PLANNER_KEYS = ("default_planner_config", "planner_configs")
"""Keys of a pipeline or of a group in it that name planners."""
NO_PLANNER = ("", "None")
"""Names that stand for the default; MoveIt's Setup Assistant writes the latter."""


@dataclass(frozen=True, slots=True)
class PipelineNames:
    """Checks parameters below planning_pipelines.

    Attributes:
        parent: Whole name of planning_pipelines, with a slash at the end.
        pipelines: Names of the pipelines.
        groups: Planning groups of the robot.
        registry: Planners of the launch.
    """

    parent: str
    pipelines: Collection[str]
    groups: Collection[str]
    registry: PlannerRegistry

    def faults(self, name: str, value: Any) -> Iterator[LaunchFault]:
        """Yields the faults of a parameter; none if the parameter is not below planning_pipelines."""
        if not name.startswith(self.parent):
            return
        declared = existing_declaration(PACKAGE, "planning_pipeline").parameters
        pipeline, key, *settings = [*name.removeprefix(self.parent).split("/"), ""]
        known_names = (*declared, *self.groups)
        if pipeline not in self.pipelines:
            yield unknown_name(name, "pipeline", pipeline, self.pipelines)
        elif key not in known_names:
            text = f"pipeline '{pipeline}' has no parameter '{key}'; {listing(known_names)}{nearest(key, known_names)}"
            yield LaunchFault(name, text)
        elif key == "planner_configs" and len(settings) > 2:
            yield from self._setting_faults(name, value, pipeline, settings)
        elif (key in self.groups and settings[0] in PLANNER_KEYS) or key == PLANNER_KEYS[0]:
            yield from self._planner_faults(name, value, pipeline, key if key in self.groups else "")
        elif key in declared and declared[key].below and settings[0]:
            below = existing_declaration(*declared[key].below.split("/"))
            text = tree_fault("/".join(settings).rstrip("/"), value, below, {})
            if text:
                yield LaunchFault(name, f"parameter '{name}' {text}")
        elif key in declared and not settings[1:] and declared[key].fault(value):
            yield LaunchFault(name, f"parameter '{name}' {declared[key].fault(value)}")

    def misspelt(self, name: str) -> Iterator[LaunchFault]:
        """Yields a fault if a key differs slightly from a known key; other keys may belong to planners of users."""
        if name.startswith(self.parent):
            pipeline, _, key = name.removeprefix(self.parent).partition("/")
            key = key.partition("/")[0]
            known_names = (*existing_declaration(PACKAGE, "planning_pipeline").parameters, *self.groups)
            if key not in known_names and any(misspelling(key, item) for item in known_names):
                yield LaunchFault(name, f"pipeline '{pipeline}' has no parameter '{key}'{nearest(key, known_names)}")

    def _planner_faults(self, name: str, value: Any, pipeline: str, group: str) -> Iterator[LaunchFault]:
        """Yields the planners in a value that the pipeline does not have."""
        for planner in value if isinstance(value, list) else [value]:
            if str(planner) in NO_PLANNER:
                continue
            try:
                self.registry.resolve(str(planner), group, pipeline)
            except UnknownNameError as error:
                yield unknown_name(name, error.what, error.name, error.known)

    def _setting_faults(self, name: str, value: Any, pipeline: str, setting: list[str]) -> Iterator[LaunchFault]:
        try:
            planner = self.registry.resolve(setting[0], "", pipeline)
        except UnknownNameError as error:
            yield unknown_name(name, error.what, error.name, error.known)
            return
        for text in self.registry.faults(planner, {setting[1]: value}):
            yield LaunchFault(name, text.replace("; it is ignored", ""))


def unknown_name(name: str, what: str, found_text: str, known_names: Collection[str]) -> LaunchFault:
    """Returns the fault of an unknown name.

    Args:
        name: Parameter with the unknown name; "" if the name is not the value of a parameter.
        what: Kind of name, such as `pipeline`.
        found_text: Unknown name.
        known_names: Existing names.
    """
    text = f"there is no {what} '{found_text}'; {listing(known_names)}{nearest(found_text, known_names)}"
    return LaunchFault(name, f"parameter '{name}': {text}" if name else text)


DETECTOR, MANAGER = "collision_detector", "moveit_controller_manager"
CAPABILITY_PARAMETERS = ("capabilities", "disable_capabilities")
CAPABILITIES = (*DEFAULT_CAPABILITIES, *OPTIONAL_CAPABILITIES)


def move_group_faults(names: DeclaredNames, parameters: Mapping[str, Any]) -> Iterator[LaunchFault]:
    """Yields unknown names.

    Args:
        names: Parameters of the launch.
        parameters: Parameters set by the experiment, by full name. Capabilities are checked only in these, since other
            configuration packages may name capabilities that only MoveIt has.
    """
    for name, value in names.naming(DETECTOR):
        try:
            collision_detector(value)
        except ModelError as error:
            yield LaunchFault(name, f"parameter '{name}': {error}")
    for name, value in names.naming(MANAGER):
        if value.replace("::", "/") not in CONTROLLER_MANAGERS:
            hint = f"{listing(CONTROLLER_MANAGERS)}{nearest(value, CONTROLLER_MANAGERS)}"
            yield LaunchFault(name, f"parameter '{name}': there is no controller manager '{value}'; {hint}")
    for name, value in leaves(parameters).items():
        if name.rpartition("/")[2] in CAPABILITY_PARAMETERS and name in names.known or _is_of_pipeline(name):
            yield from _capability_faults(name, value)


def _is_of_pipeline(name: str) -> bool:
    return "/planning_pipelines/" in name and name.endswith("/capabilities")


def _capability_faults(name: str, value: Any) -> Iterator[LaunchFault]:
    for capability in value if isinstance(value, list) else str(value or "").split():
        if capability not in CAPABILITIES:
            hint = f"{listing(CAPABILITIES)}{nearest(str(capability), CAPABILITIES)}"
            yield LaunchFault(name, f"parameter '{name}': there is no capability '{capability}'; {hint}")


def named_detector(launch: LaunchPreview, node: LaunchedNode) -> str:
    """Returns the collision detector that a launch names; "" for the default.

    Args:
        launch: Launch.
        node: Node move_group of the launch.
    """
    names = (f"{node.name}/{DETECTOR}", f"{node.namespace}{DETECTOR}", f"/{DETECTOR}")
    return str(next((launch.parameters[name] for name in names if name in launch.parameters), ""))


def resolved_names(launch: LaunchPreview, node: LaunchedNode) -> dict[str, str]:
    """Returns the implementation of each name.

    Args:
        launch: Launch without faults.
        node: Node move_group of the launch.
    """
    checker = checker_name(collision_detector(named_detector(launch, node)))
    manager = str(launch.parameters.get(f"{node.name}/{MANAGER}") or SIMPLE_MANAGER)
    return {DETECTOR: checker, MANAGER: manager.replace("::", "/")}
