# SPDX-License-Identifier: BSD-3-Clause
"""Settings of each mode: keys, allowed values and defaults."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from modular_framework_benchmark.experiments import launch_settings, problem_sets
from modular_framework_benchmark.experiments.reading import Reading, json_value
from modular_framework_benchmark.experiments.resource_lookup import UnresolvedReference
from modular_framework_benchmark.experiments.scene_objects import read_objects
from modular_framework_core.files.located_yaml import Mapping as Node_Mapping
from modular_framework_core.files.located_yaml import Node, Scalar

ReadValue = Callable[[Node, Reading], Any]
OWN_PARAMETERS = {
    "/seed": "each episode has its own seed, made from the experiment's key seed",
    "/task/wait_for_start": "an episode starts its task itself",
    "/task/record_directory": "an episode keeps the record of its task in its own folder",
}
"""Parameters that the episodes set themselves, with the alternative for the user."""


@dataclass(frozen=True, slots=True)
class SettingKey:
    """A key of a mode.

    Attributes:
        read: Reader of the value, which adds faults.
        default: Value of an absent key.
        required: Whether the key must be present.
    """

    read: ReadValue
    default: Any = None
    required: bool = False

    def value(self, key: str, mode: str, node: Node_Mapping, reading: Reading) -> Any:
        """Returns the value of the key; None with an added fault if it is unreadable or required and absent.

        Args:
            key: Name of the key.
            mode: Name of the mode.
            node: Settings of a combination.
            reading: Reader that collects faults.
        """
        if key in node.entries:
            return self.read(node.entries[key], reading)
        if self.required:
            reading.faults.add(node.location, f"mode {mode} needs the key '{key}', in the file or in every level")
            return None
        return self.default


@dataclass(frozen=True, slots=True)
class Mode:
    """Settings of a mode.

    Attributes:
        keys: Keys of the mode.
        finish: Check of the relations between keys, which returns the final settings; some may be omitted.
    """

    keys: Mapping[str, SettingKey]
    finish: Callable[[Node_Mapping, dict[str, Any], Reading], dict[str, Any]]


def read_settings(mode: str, node: Node_Mapping, reading: Reading) -> dict[str, Any]:
    """Reads the settings of a combination of levels.

    Args:
        mode: Name of the mode.
        node: Base settings overridden by the levels; known keys only.
        reading: Reader that collects faults and looks up references.

    Returns:
        A value for each key of the mode; keys with an unreadable value are omitted.
    """
    values = {key: setting.value(key, mode, node, reading) for key, setting in MODES[mode].keys.items()}
    return MODES[mode].finish(node, {key: value for key, value in values.items() if value is not None}, reading)


def _count(what: str, low: int = 1, high: int = 1_000_000) -> ReadValue:
    return lambda node, reading: reading.count(node, what, low, high)


def _seconds(what: str, low: float = 0.001) -> ReadValue:
    return lambda node, reading: reading.number(node, f"{what} [s]", low, 1e6)


def _text(what: str) -> ReadValue:
    def read(node: Node, reading: Reading) -> str | None:
        return "" if isinstance(node, Scalar) and node.value == "" else reading.text(node, what)

    return read


def _truth(what: str) -> ReadValue:
    return lambda node, reading: reading.truth(node, what)


def _success(allowed: Mapping[str, float]) -> ReadValue:
    """Returns a reader of the success criteria: numbers from 0, and the name of an object."""
    keys = (*allowed, "object")

    def read(node: Node, reading: Reading) -> dict[str, Any] | None:
        mapping = reading.mapping(node, "success", "{lifted: 0.10, hold_time: 2.0}")
        result: dict[str, Any] = {}
        for key, value in mapping.entries.items() if mapping is not None else ():
            if key not in keys:
                reading.faults.add_unknown(mapping.keys[key], "the key of success", key, keys)  # type: ignore[union-attr]
            else:
                found = reading.text(value, key) if key == "object" else reading.number(value, key, 0.0, allowed[key])
                result[key] = found
        return result

    return read


def _parameters(node: Node, reading: Reading) -> dict[str, Any] | None:
    mapping = reading.mapping(node, "parameters", "{/planner_name: RRTConnect}")
    if mapping is None:
        return None
    parameters: dict[str, Any] = {}
    for name, location in mapping.keys.items():
        if name in OWN_PARAMETERS:
            reading.faults.add(location, f"the parameter '{name}' cannot be given: {OWN_PARAMETERS[name]}")
        elif not name.startswith("/") or name != "/" + "/".join(part for part in name.split("/") if part):
            reading.faults.add(location, f"the parameter '{name}' must be a full name from /, such as /planner_name")
        else:
            parameters[name] = json_value(mapping.entries[name])
    return parameters


def _extra_parameters(node: Node, reading: Reading) -> list[str] | None:
    """Reads the names of parameters that the user's own nodes read."""
    items = reading.items(node, "extra_parameters", "[/my_node/my_parameter]")
    return (
        None
        if items is None
        else [name for item in items if (name := reading.text(item, "a name in extra_parameters")) is not None]
    )


def _named_values(what: str, example: str) -> ReadValue:
    def read(node: Node, reading: Reading) -> dict[str, Any] | None:
        mapping = reading.mapping(node, what, example)
        return None if mapping is None else {name: json_value(value) for name, value in mapping.entries.items()}

    return read


def _robot(node: Node, reading: Reading) -> Any:
    """Reads a MoveIt configuration package, or the URDF and SRDF files."""
    if isinstance(node, Node_Mapping):
        return _robot_files(node, reading)
    package = reading.text(node, "robot")
    if package is not None:
        try:
            reading.resources.package(package)
        except UnresolvedReference as error:
            reading.faults.add(node.location, str(error))
            return None
    return package


def _robot_files(node: Node_Mapping, reading: Reading) -> dict[str, str] | None:
    files: dict[str, str] = {}
    before = len(reading.faults)
    for key, value in node.entries.items():
        if key not in ("urdf", "srdf"):
            reading.faults.add_unknown(node.keys[key], "the key of robot", key, ("urdf", "srdf"))
            continue
        text = reading.text(value, key)
        path = reading.path(text) if text is not None else None
        if path is not None and not path.is_file():
            reading.faults.add(value.location, f"there is no file {path}; name the {key} file of the robot")
        files[key] = str(path)
    for key in ("urdf", "srdf"):
        if key not in node.entries:
            reading.faults.add(node.location, f"robot has no {key}; allowed: a package, or {{urdf: FILE, srdf: FILE}}")
    return files if len(reading.faults) == before else None


def _grasp_settings(node: Node_Mapping, values: dict[str, Any], reading: Reading) -> dict[str, Any]:
    """Finds the models and checks that the target is an object; the default target is the first object."""
    if "objects" not in values:
        return values
    before, target = len(reading.faults), values.get("target")
    objects = launch_settings.placed_objects(values["objects"], launch_settings.DEFAULT_LAUNCH, {}, reading)
    names = [found.name for found in objects]
    if not values["objects"]:
        reading.faults.add(node.entries["objects"].location, "objects is empty; add at least the object to grasp")
    elif target and target not in names and len(reading.faults) == before:
        reading.faults.add_unknown(node.entries["target"].location, "the target", target, names)
    with_files = [replace(found, model=str(found.file)) for found in objects]
    return values | {"objects": with_files, "target": target or (names[0] if names else "")}


def _as_read(node: Node_Mapping, values: dict[str, Any], reading: Reading) -> dict[str, Any]:
    return values


_LAUNCH_KEYS = {
    "launch": SettingKey(launch_settings.read_launch, launch_settings.DEFAULT_LAUNCH),
    "arguments": SettingKey(launch_settings.read_arguments, {}),
    "parameters": SettingKey(_parameters, {}),
    "extra_parameters": SettingKey(_extra_parameters, []),
    "objects": SettingKey(read_objects, []),
    "warm": SettingKey(_truth("warm"), True),
}
MODES: Mapping[str, Mode] = {
    "task": Mode(
        {
            **_LAUNCH_KEYS,
            "task": SettingKey(launch_settings.read_task, launch_settings.DEFAULT_TASK),
            "success": SettingKey(_success({"lifted": 10.0, "hold_time": 3600.0}), {}),
        },
        launch_settings.finish,
    ),
    "planning": Mode(
        {
            "robot": SettingKey(_robot, required=True),
            "problems": SettingKey(problem_sets.read_problems, required=True),
            "planner": SettingKey(_text("planner"), ""),
            "planner_parameters": SettingKey(_named_values("planner_parameters", "{range: 0.5}"), {}),
            "pipeline": SettingKey(_text("pipeline"), "ompl"),
            "group": SettingKey(_text("group"), ""),
            "planning_time": SettingKey(_seconds("planning_time"), 5.0),
            "attempts": SettingKey(_count("attempts", 1, 1000), 1),
            "parameters": SettingKey(_parameters, {}),
        },
        _as_read,
    ),
    "kinematics": Mode(
        {
            "robot": SettingKey(_robot, required=True),
            "group": SettingKey(_text("group"), ""),
            "solver": SettingKey(_text("solver"), ""),
            "poses": SettingKey(_count("poses"), 100),
            "timeout": SettingKey(_seconds("timeout"), 0.05),
            "parameters": SettingKey(_parameters, {}),
        },
        _as_read,
    ),
    "grasps": Mode(
        {
            "robot": SettingKey(_robot, required=True),
            "group": SettingKey(_text("group"), required=True),
            "gripper_joint": SettingKey(_text("gripper_joint"), required=True),
            "method": SettingKey(_text("method"), required=True),
            "method_parameters": SettingKey(_named_values("method_parameters", "{finger_clearance: 0.01}"), {}),
            "objects": SettingKey(read_objects, required=True),
            "target": SettingKey(_text("target"), ""),
            "max_checks": SettingKey(_count("max_checks", 1, 100_000), 40),
        },
        _grasp_settings,
    ),
}


def model_files(settings: Mapping[str, Any]) -> list[Path]:
    """Returns the files of a combination whose content determines its episodes."""
    objects = [found.file for found in settings.get("objects", ())]
    task = [Path(settings["task"])] if settings.get("task") else []
    problems = [Path(problem[key]) for problem in settings.get("problems", ()) for key in ("scene", "request")]
    return [*objects, *task, *problems]
