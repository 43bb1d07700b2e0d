# SPDX-License-Identifier: BSD-3-Clause
"""Chooses the file with the controllers of a robot, and turns what it says into parameters of ROS 1's move_group."""

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
# Controller managers that only MoveIt 2 has, and MoveIt 1's name of what they do.
ROS_CONTROL = "moveit_ros_control_interface"
RENAMED = {
    f"{ROS_CONTROL}/Ros2ControlManager": f"{ROS_CONTROL}::MoveItControllerManager",
    f"{ROS_CONTROL}/Ros2ControlMultiManager": f"{ROS_CONTROL}::MoveItMultiControllerManager",
}
CONTROLLER_TYPES = {"ParallelGripperCommand": "GripperCommand"}
FILE_NAME = re.compile(r"^(.*)_controllers\.yaml$")
PUBLIC_ORDER = ("moveit", "moveit2")
# Files of MoveIt 1's Setup Assistant, those of real controllers first; "" is controllers.yaml.
MOVEIT1_ORDER = ("simple_moveit", "", "ros")
PRETENDED = "fake"


def choose_controllers_file(folder: Path, robot_name: str, load: Callable[[Path], Mapping[str, Any]]) -> Path | None:
    """Returns the file of a config folder that says which controllers execute motions.

    The only `*_controllers.yaml`; of several `moveit_`, `moveit2_` or `<robot_name>_controllers.yaml`, and, in packages
    of MoveIt 1, the first of `simple_moveit_controllers.yaml`, `controllers.yaml` and `ros_controllers.yaml` that lists
    any, or `fake_controllers.yaml` where no other file does.

    Args:
        folder: the config folder.
        robot_name: name given to the builder.
        load: loads one of the files.

    Returns:
        The file, or None, with a warning, where there is none of that name.

    Raises:
        RuntimeError: several files, and none of these names among them; lists them.
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
    for name in (*MOVEIT1_ORDER, *([PRETENDED] if listing == [PRETENDED] else [])):
        if name in listing:
            return files[name]
    options = "\n - ".join(path.name for path in files.values())
    raise RuntimeError(
        f"trajectory_execution: {folder} has several files of controllers and none of the names "
        f"{', '.join(f'{name}_controllers.yaml' for name in (*PUBLIC_ORDER, robot_name))}: give the one to load as "
        f"file_path. Options:\n - {options}"
    )


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_file()) if folder.is_dir() else []


def lists_controllers(content: Mapping[str, Any]) -> bool:
    """Whether the content of a file names controllers, in MoveIt 1's form or in MoveIt 2's."""
    return bool(content.get("controller_list")) or any(_listed_names(content, manager) for manager in PLUGINS)


def _listed_names(content: Mapping[str, Any], manager: str) -> Sequence[Any]:
    block = content.get(manager)
    names = block.get("controller_names") if isinstance(block, Mapping) else None
    return names if isinstance(names, list) else []


def ros1_controllers(content: Mapping[str, Any], where: Path) -> dict[str, Any]:
    """Returns the parameters of a file with `controller_list` and `moveit_controller_manager` as ROS 1 has them.

    The names of the controllers also stand in `moveit_simple_controller_manager/controller_names`, MoveIt 2's form.

    Args:
        content: of the file.
        where: the file, for messages.

    Raises:
        ParameterFileError: a listed controller is not described, or the list is none.
    """
    result = dict(content)
    manager = next((name for name in PLUGINS if _listed_names(content, name)), SIMPLE)
    plugin = str(content.get("moveit_controller_manager") or _plugin(manager, where))
    result["moveit_controller_manager"] = plugin = RENAMED.get(plugin, plugin)
    if "controller_list" not in content and _listed_names(content, manager):
        result["controller_list"] = _controller_list(content[manager], manager, where)
    entries = _checked_list(result.get("controller_list", []), where)
    if plugin == PLUGINS[FAKE]:
        LOGGER.warning("%s: its controllers are fake ones: motions are not executed by a robot or a simulation", where)
    if not entries and plugin.startswith(ROS_CONTROL):
        return result  # it asks the controller manager which controllers there are
    if not entries:
        LOGGER.warning(
            "%s: lists no controllers (looked for controller_list and %s/controller_names): motions can be planned, "
            "not executed",
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
            f"{where}: {manager}/controller_names has {', '.join(missing)}, of which nothing else is said; described "
            f"are {', '.join(described) or 'none'}"
        )
    return [{"name": str(name), **block[name]} for name in block["controller_names"]]


def _checked_list(entries: Any, where: Path) -> list[dict[str, Any]]:
    if isinstance(entries, list) and all(isinstance(entry, dict) and "name" in entry for entry in entries):
        return entries
    raise ParameterFileError(f"{where}: controller_list is {entries!r}; a list of mappings with a name each is needed")


def _without_name(entry: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in entry.items() if key != "name"}


def _type(entry: Mapping[str, Any]) -> dict[str, str]:
    kind = str(entry.get("type", ""))
    return {"type": CONTROLLER_TYPES[kind]} if kind in CONTROLLER_TYPES else {}


def _plugin(manager: str, where: Path) -> str:
    return PLUGINS[FAKE if where.name == "fake_controllers.yaml" else manager]
