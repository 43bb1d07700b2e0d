# SPDX-License-Identifier: BSD-3-Clause
"""Selects the controller file of a robot, and converts its content to parameters of ROS 1's move_group."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from launch_param_builder import ParameterFileError

LOGGER = logging.getLogger(__name__)
SIMPLE, FAKE = "moveit_simple_controller_manager", "moveit_fake_controller_manager"
PLUGINS = {SIMPLE: f"{SIMPLE}/MoveItSimpleControllerManager", FAKE: f"{FAKE}/MoveItFakeControllerManager"}
# MoveIt 1's names of controller managers that only exist in MoveIt 2.
ROS_CONTROL = "moveit_ros_control_interface"
RENAMED = {
    f"{ROS_CONTROL}/Ros2ControlManager": f"{ROS_CONTROL}::MoveItControllerManager",
    f"{ROS_CONTROL}/Ros2ControlMultiManager": f"{ROS_CONTROL}::MoveItMultiControllerManager",
}
CONTROLLER_TYPES = {"ParallelGripperCommand": "GripperCommand"}
FILE_NAME = re.compile(r"^(.*)_controllers\.yaml$")
PUBLIC_ORDER = ("moveit", "moveit2")
# Files of MoveIt 1's Setup Assistant in order of preference; "" is controllers.yaml.
MOVEIT1_ORDER = ("simple_moveit", "", "ros")
FAKE_NAME = "fake"


def choose_controllers_file(folder: Path, robot_name: str, load: Callable[[Path], Mapping[str, Any]]) -> Path | None:
    """Returns the file in a config folder that lists the controllers for execution.

    A single `*_controllers.yaml` is selected. Otherwise, the file is `moveit_`, `moveit2_` or
    `<robot_name>_controllers.yaml`. In MoveIt 1 packages, it is the first of `simple_moveit_controllers.yaml`,
    `controllers.yaml` and `ros_controllers.yaml` with controllers, or else `fake_controllers.yaml`.

    Args:
        folder: Config folder.
        robot_name: Name of the robot in the builder.
        load: Function that loads a file.

    Returns:
        The file; None, with a warning, if no file exists.

    Raises:
        RuntimeError: Several files exist, and none has these names; the message lists the files.
    """
    files = {match[1]: path for path in _files(folder) if (match := FILE_NAME.match(path.name))}
    if (folder / "controllers.yaml").is_file():
        files.setdefault("", folder / "controllers.yaml")
    if not files:
        LOGGER.warning("no controllers: looked for %s/*_controllers.yaml and controllers.yaml there", folder)
        return None
    if len(files) == 1:
        return next(iter(files.values()))
    for name in (*PUBLIC_ORDER, robot_name):
        if name in files:
            return files[name]
    listing = [name for name, path in files.items() if lists_controllers(load(path))]
    for name in (*MOVEIT1_ORDER, *([FAKE_NAME] if listing == [FAKE_NAME] else [])):
        if name in listing:
            return files[name]
    options = "\n - ".join(path.name for path in files.values())
    raise RuntimeError(
        f"trajectory_execution: {folder} has several controller files and none with a default name "
        f"({', '.join(f'{name}_controllers.yaml' for name in (*PUBLIC_ORDER, robot_name))}); give file_path. "
        f"Options:\n - {options}"
    )


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_file()) if folder.is_dir() else []


def lists_controllers(content: Mapping[str, Any]) -> bool:
    """Returns whether a file lists controllers, in the format of MoveIt 1 or MoveIt 2."""
    return bool(content.get("controller_list")) or any(_listed_names(content, manager) for manager in PLUGINS)


def _listed_names(content: Mapping[str, Any], manager: str) -> Sequence[Any]:
    block = content.get(manager)
    names = block.get("controller_names") if isinstance(block, Mapping) else None
    return names if isinstance(names, list) else []


def ros1_controllers(content: Mapping[str, Any], where: Path) -> dict[str, Any]:
    """Returns the parameters of a file with `controller_list` and `moveit_controller_manager` of ROS 1.

    The names of the controllers are also in `moveit_simple_controller_manager/controller_names`, as in MoveIt 2.

    Args:
        content: Content of the file.
        where: Path of the file for messages.

    Raises:
        ParameterFileError: A listed controller has no parameters, or the list is invalid.
    """
    result = dict(content)
    manager = next((name for name in PLUGINS if _listed_names(content, name)), SIMPLE)
    plugin = str(content.get("moveit_controller_manager") or _plugin(manager, where))
    result["moveit_controller_manager"] = plugin = RENAMED.get(plugin, plugin)
    if "controller_list" not in content and _listed_names(content, manager):
        result["controller_list"] = _controller_list(content[manager], manager, where)
    entries = _checked_list(result.get("controller_list", []), where)
    if plugin == PLUGINS[FAKE]:
        LOGGER.warning("%s: the controllers are fake controllers; no robot or simulation executes the motions", where)
    if not entries and plugin.startswith(ROS_CONTROL):
        return result  # the plugin gets the controllers from the controller manager
    if not entries:
        LOGGER.warning(
            "%s: lists no controllers (looked for controller_list and %s/controller_names); motions can be planned, "
            "but not executed",
            where,
            SIMPLE,
        )
        return result
    result["controller_list"] = [{**entry, **_type(entry)} for entry in entries]
    described = {str(entry["name"]): _without_name(entry) for entry in result["controller_list"] if entry["name"]}
    result.setdefault(manager, {"controller_names": list(described), **described})
    return result


def _controller_list(block: Mapping[str, Any], manager: str, where: Path) -> list[dict[str, Any]]:
    missing = [str(name) for name in block["controller_names"] if not isinstance(block.get(name), Mapping)]
    if missing:
        described = [key for key, value in block.items() if isinstance(value, Mapping)]
        raise ParameterFileError(
            f"{where}: {manager}/controller_names has {', '.join(missing)} without parameters; controllers with "
            f"parameters: {', '.join(described) or 'none'}"
        )
    return [{"name": str(name), **block[name]} for name in block["controller_names"]]


def _checked_list(entries: Any, where: Path) -> list[dict[str, Any]]:
    if isinstance(entries, list) and all(isinstance(entry, dict) and "name" in entry for entry in entries):
        return entries
    raise ParameterFileError(f"{where}: controller_list is {entries!r}; expected a list of mappings with a name each")


def _without_name(entry: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in entry.items() if key != "name"}


def _type(entry: Mapping[str, Any]) -> dict[str, str]:
    kind = str(entry.get("type", ""))
    return {"type": CONTROLLER_TYPES[kind]} if kind in CONTROLLER_TYPES else {}


def _plugin(manager: str, where: Path) -> str:
    return PLUGINS[FAKE if where.name == "fake_controllers.yaml" else manager]
