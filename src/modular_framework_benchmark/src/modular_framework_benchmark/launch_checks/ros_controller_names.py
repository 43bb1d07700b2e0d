# SPDX-License-Identifier: BSD-3-Clause
"""Checks the controllers and the hardware in the configuration of a launch: types, joints and parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import rospkg

from modular_framework_benchmark.launch_checks.ros_robot_names import RobotNames
from modular_framework_control.controller_manager.controller_parameters import parameter_faults
from modular_framework_control.controller_manager.controller_types import BUILT_IN_TYPES, ControllerTypes
from modular_framework_control.hardware_interface.plugins import ROBOT_HW_BASE, PluginIndex
from modular_framework_core.launching.robot_controllers_spawner import (
    ControllerFile,
    ControllerFileError,
    read_controller_file,
)
from modular_framework_core.launching.ros_declared_names import DeclaredNames, LaunchFault
from modular_framework_core.launching.ros_launch_preview import LaunchPreview
from modular_framework_core.launching.vendor_driver import controller_list_faults
from modular_framework_ros.allowed_names import listing, nearest

VENDOR_DRIVER, CONTROLLER_LIST = "vendor_driver", "/move_group/controller_list"
SPAWNER, CONTROLLER_FILE, ARGUMENTS = "robot_controllers_spawner", "controller_file", "arguments"
JOINT_KEYS = (
    "joint", "joints", "left_wheel", "right_wheel", "front_wheel", "rear_wheel", "front_steer", "front_steering",
    "rear_steering",
)  # fmt: skip
"""Keys of a controller that name joints."""


def controller_faults(launch: LaunchPreview, joints: tuple[str, ...]) -> Iterator[LaunchFault]:
    """Yields unreadable controller files, and unknown controller types, joints and parameters in them.

    Args:
        launch: Launch to check.
        joints: Movable joints of the robot; empty if unknown.
    """
    for node in launch.nodes:
        if node.executable != SPAWNER or len(node.arguments.split()) != 2:
            continue
        package, file = node.arguments.split()
        folder = Path(rospkg.RosPack.get_instance().get_path(package)) / "controllers"
        try:
            faults = list(_faults_in(read_controller_file(folder / file), joints))
        except ControllerFileError as error:
            file_names = [path.name for path in folder.glob("*.yaml")]
            faults = [f"{error}{'' if file in file_names else nearest(file, file_names)}"]
        for text in faults:
            yield LaunchFault(CONTROLLER_FILE, f"argument '{CONTROLLER_FILE}': {text}", ARGUMENTS)


def vendor_controller_faults(launch: LaunchPreview, joints: tuple[str, ...]) -> Iterator[LaunchFault]:
    """Yields unknown keys, types and joints in the list of a vendor driver's controllers.

    Args:
        launch: Launch to check.
        joints: Movable joints of the robot; empty if unknown.
    """
    controllers = launch.parameters.get(CONTROLLER_LIST)
    if isinstance(controllers, list) and any(node.executable == VENDOR_DRIVER for node in launch.nodes):
        for text in controller_list_faults(controllers, joints):
            yield LaunchFault(CONTROLLER_LIST, f"parameter '{CONTROLLER_LIST}' {text}")


def _faults_in(file: ControllerFile, joints: tuple[str, ...]) -> Iterator[str]:
    known_types = _controller_types()
    for name in file.controllers:
        entry = file.parameters[name]
        where, kind = f"{file.path}: controller '{name}'", str(entry["type"])
        if kind not in known_types:
            yield f"{where}: there is no controller type '{kind}'; {listing(known_types)}{nearest(kind, known_types)}"
        elif kind in BUILT_IN_TYPES:
            for joint in _unknown_joints(entry, joints):
                yield f"{where}: the robot has no joint '{joint}'; {listing(joints)}{nearest(joint, joints)}"
        yield from (f"{where}: {text}" for text in parameter_faults(kind, entry))


def _names(value: Any) -> list[str]:
    return [str(name) for name in (value if isinstance(value, list) else [value]) if isinstance(name, str)]


def _unknown_joints(entry: Mapping[str, Any], joints: tuple[str, ...]) -> list[str]:
    named = dict.fromkeys(name for key in JOINT_KEYS for name in _names(entry.get(key)))
    return [name for name in named if joints and name not in joints]


def hardware_faults(names: DeclaredNames, launch: LaunchPreview, robot: RobotNames) -> Iterator[LaunchFault]:
    """Yields hardware without parameters, unknown hardware types, and joints that the robot does not have.

    Args:
        names: Declared parameters of the launch.
        launch: Launch to check.
        robot: Names of the robot.
    """
    for name, value in names.naming("joint_prefix") if robot.joints else ():
        if value not in robot.joint_prefixes:
            text = f"parameter '{name}': no joint name begins with '{value}_'; {listing(robot.joints)}"
            yield LaunchFault(name, f"{text}{nearest(value, robot.joint_prefixes)}")
    for part in names.hardware():
        below = {name: value for name, value in launch.parameters.items() if name.startswith(f"{part}/")}
        yield from names.below_trees(below, robot.by_kind())
        parameter, parent = f"{part}/type", part.rpartition("/")[0]
        sections = [
            name.removesuffix("/type").lstrip("/")
            for name in launch.parameters
            if name.endswith("/type") and name.removesuffix("/type").rpartition("/")[0] == parent
        ]
        kind = launch.parameters.get(parameter)
        if kind is None:
            text = f"robot_hardware names '{part.lstrip('/')}', and there is no parameter '{parameter}'"
            yield LaunchFault(parameter, f"{text}; {listing(sections)}{nearest(part.lstrip('/'), sections)}")
        elif str(kind) not in _hardware_types():
            hardware_types = _hardware_types()
            hint = f"{listing(hardware_types)}{nearest(str(kind), hardware_types)}"
            yield LaunchFault(parameter, f"parameter '{parameter}': there is no hardware '{kind}'; {hint}")


@cache
def _controller_types() -> tuple[str, ...]:
    """Returns the controller types of the framework and of the packages."""
    return tuple(ControllerTypes().names)


@cache
def _hardware_types() -> tuple[str, ...]:
    """Returns the hardware types of the packages."""
    return tuple(PluginIndex(ROBOT_HW_BASE).names)
