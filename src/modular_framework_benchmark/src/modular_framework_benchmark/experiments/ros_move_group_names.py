# SPDX-License-Identifier: BSD-3-Clause
"""Checks the names that move_group would replace by a default: collision detector, managers and capabilities."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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
from modular_framework_planning.planning_interface.collision_detectors import collision_detector
from modular_framework_ros.allowed_names import listing, nearest

DETECTOR, MANAGER = "collision_detector", "moveit_controller_manager"
CAPABILITY_PARAMETERS = ("capabilities", "disable_capabilities")
CAPABILITIES = (*DEFAULT_CAPABILITIES, *OPTIONAL_CAPABILITIES)


def move_group_faults(names: DeclaredNames, given: Mapping[str, Any]) -> Iterator[LaunchFault]:
    """Yields unknown names.

    Args:
        names: Parameters of the launch.
        given: Parameters set by the experiment, by full name. Capabilities are checked only in these, since other
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
    for name, value in leaves(given).items():
        if name.rpartition("/")[2] in CAPABILITY_PARAMETERS and name in names.known or _is_of_pipeline(name):
            yield from _capability_faults(name, value)


def _is_of_pipeline(name: str) -> bool:
    return "/planning_pipelines/" in name and name.endswith("/capabilities")


def _capability_faults(name: str, value: Any) -> Iterator[LaunchFault]:
    for capability in value if isinstance(value, list) else str(value or "").split():
        if capability not in CAPABILITIES:
            hint = f"{listing(CAPABILITIES)}{nearest(str(capability), CAPABILITIES)}"
            yield LaunchFault(name, f"parameter '{name}': there is no capability '{capability}'; {hint}")


def resolved_names(launch: LaunchPreview, node: LaunchedNode) -> dict[str, str]:
    """Returns the implementation of each name.

    Args:
        launch: Launch without faults.
        node: Node move_group of the launch.
    """
    places = (f"{node.name}/{DETECTOR}", f"{node.namespace}{DETECTOR}", f"/{DETECTOR}")
    detector = next((launch.parameters[place] for place in places if place in launch.parameters), "")
    kind: Any = collision_detector(str(detector))
    manager = str(launch.parameters.get(f"{node.name}/{MANAGER}") or SIMPLE_MANAGER)
    return {DETECTOR: f"{kind.__module__}/{kind.__qualname__}", MANAGER: manager.replace("::", "/")}
