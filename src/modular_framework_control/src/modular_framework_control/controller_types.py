# SPDX-License-Identifier: BSD-3-Clause
"""Finds controller classes under the names users write in controller files."""
from __future__ import annotations

import importlib
from collections.abc import Callable

from modular_framework_control.controller import Controller, ControllerError

BASE_CLASS = "controller_interface::ControllerBase"

_PACKAGE = "modular_framework_control"
BUILT_IN_TYPES: dict[str, str] = {
    "joint_state_controller/JointStateController": f"{_PACKAGE}.joint_state_controller:JointStateController",
    "position_controllers/JointTrajectoryController":
        f"{_PACKAGE}.joint_trajectory_controller:JointTrajectoryController",
    "position_controllers/GripperActionController": f"{_PACKAGE}.gripper_action_controller:GripperActionController",
}


class ControllerTypes:
    """Controller classes by type name.

    Args:
        locations: type name -> "module:Class"; the built-in ones when not given.
    """

    def __init__(self, locations: dict[str, str] | None = None) -> None:
        self._locations = dict(BUILT_IN_TYPES if locations is None else locations)
        self._factories: dict[str, Callable[[], Controller]] = {}

    @property
    def names(self) -> list[str]:
        """Known type names, sorted."""
        return sorted({*self._locations, *self._factories})

    def register(self, type_name: str, factory: Callable[[], Controller]) -> None:
        """Make a class known under `type_name` ("package/Class"); an earlier one of that name is replaced."""
        if "/" not in type_name:
            raise ControllerError(f"controller type '{type_name}': expected the form package/Class")
        self._factories[type_name] = factory

    def create(self, type_name: str) -> Controller:
        """A new controller of that type.

        Raises:
            ControllerError: unknown type (the message lists the known ones), or its module cannot be imported.
        """
        if type_name in self._factories:
            return self._factories[type_name]()
        if type_name not in self._locations:
            raise ControllerError(f"unknown controller type '{type_name}'; known types: {', '.join(self.names)}")
        module_name, _, class_name = self._locations[type_name].partition(":")
        try:
            controller_class = getattr(importlib.import_module(module_name), class_name)
        except (ImportError, AttributeError) as error:
            raise ControllerError(f"controller type '{type_name}': cannot load {class_name} of {module_name}: "
                                  f"{error}") from error
        controller: Controller = controller_class()
        return controller

    def reload(self) -> None:
        """Look again for modules installed since the program started."""
        importlib.invalidate_caches()
