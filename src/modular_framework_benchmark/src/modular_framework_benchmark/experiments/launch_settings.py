# SPDX-License-Identifier: BSD-3-Clause
"""The settings of modes that start a launch file: the file, its arguments, the task, the objects."""

from __future__ import annotations

import re
from typing import Any

from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_benchmark.experiments.scene_objects import ObjectNodes, SceneObject, named_object
from modular_framework_benchmark.experiments.surroundings import NotThere
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, kind_of

DEFAULT_LAUNCH = "modular_framework_api/start_framework.launch"
DEFAULT_TASK = "simulation_pick.yaml"
OWN_ARGUMENTS = {
    "task_constructor_script": "give it with the key task",
    "end_with_task": "an episode needs its launch after the task has ended",
    "seed": "each episode has its own seed, made from the experiment's key seed",
}
"""Launch arguments that the episodes set, and what to do instead."""


def read_launch(node: Node, reading: Reading) -> str | None:
    """Reads PACKAGE/FILE, or the path of a launch file."""
    name = reading.text(node, "launch")
    if name is None:
        return None
    given = str(reading.path(name)) if name.startswith((".", "~", "/")) else name
    try:
        reading.surroundings.launch_file(given)
    except NotThere as error:
        reading.faults.add(node.location, str(error))
    return given


def read_task(node: Node, reading: Reading) -> str | None:
    """Reads the name of a task, or its path."""
    name = reading.text(node, "task")
    if name is None:
        return None
    try:
        return reading.surroundings.task(name, reading.folder)
    except NotThere as error:
        reading.faults.add(node.location, str(error))
    return None


def read_arguments(node: Node, reading: Reading) -> dict[str, str] | None:
    """Reads launch arguments; numbers and truth values become the text that roslaunch expects."""
    mapping = reading.mapping(node, "arguments", "{world_file: ur5_table.world}")
    if mapping is None:
        return None
    arguments: dict[str, str] = {}
    for name, value in mapping.entries.items():
        if name in OWN_ARGUMENTS:
            reading.faults.add(mapping.keys[name], f"the argument '{name}' cannot be given: {OWN_ARGUMENTS[name]}")
        elif not isinstance(value, Scalar):
            reading.faults.add(value.location, f"the argument '{name}' must be one value, found {kind_of(value)}")
        elif name == "simulation" and _argument_text(value).lower() not in ("true", "1"):
            reading.faults.add(
                value.location,
                f"the argument 'simulation' is {_argument_text(value)}; allowed: true. An experiment places "
                "objects and judges success in the simulated world; run the task on the robot with run_framework",
            )
        else:
            arguments[name] = _argument_text(value)
    return arguments


def _argument_text(value: Scalar) -> str:
    if value.value is None:
        return ""
    return str(value.value).lower() if isinstance(value.value, bool) else str(value.value)


def finish(node: Mapping, values: dict[str, Any], reading: Reading) -> dict[str, Any]:
    """Checks arguments against the launch file, looks the models up, and returns the settings."""
    launch, arguments = values["launch"], values["arguments"]
    try:
        known = reading.surroundings.launch_arguments(launch)
    except NotThere as error:
        reading.faults.add(_location_of(node, "launch"), str(error))
        return values
    given = node.entries.get("arguments")
    unknown = (
        {name: found for name, found in given.keys.items() if name not in known} if isinstance(given, Mapping) else {}
    )
    for name, location in unknown.items():
        reading.faults.add_unknown(location, f"the argument of {launch}", name, sorted(known), given=arguments)
    if unknown:
        return values
    try:
        reading.surroundings.check_launch(launch, arguments)
    except NotThere as error:
        reading.faults.add(_location_of_argument(node, str(error)), str(error))
    task = values.get("task")
    if task == DEFAULT_TASK:
        values["task"] = reading.surroundings.task(task, reading.folder)
    objects = placed_objects(values["objects"], launch, arguments, reading)
    wanted = (values["success"] or {}).get("object")
    names = [found.name for found in objects]
    if wanted is not None and wanted not in names:
        reading.faults.add_unknown(_location_of(node, "success"), "the object of success", wanted, names)
    elif values["success"] and not values["objects"]:
        reading.faults.add(_location_of(node, "success"), "success speaks of an object, and there is none in objects")
    return values | {"objects": objects}


def placed_objects(
    found: list[ObjectNodes], launch: str, arguments: dict[str, str], reading: Reading
) -> list[SceneObject]:
    """Returns objects with their models' files; notes faults.

    Args:
        found: The objects as they were read.
        launch: Launch file whose description package has the models.
        arguments: Its arguments.
        reading: Where faults are noted.
    """
    taken: set[str] = set()
    objects = []
    for item in found:
        try:
            file = reading.surroundings.model(item.model, launch, arguments, reading.folder)
        except NotThere as error:
            reading.faults.add(item.node.entries["model"].location, str(error))
            continue
        objects.append(named_object(item, file, taken, reading))
    return objects


def _location_of_argument(node: Mapping, fault: str) -> Any:
    """Returns where the argument is that a fault speaks of."""
    given, named = node.entries.get("arguments"), re.search(r"argument '([^']*)'", fault)
    if isinstance(given, Mapping) and named is not None and named[1] in given.keys:
        return given.keys[named[1]]
    return _location_of(node, "arguments")


def _location_of(node: Mapping, key: str) -> Any:
    return node.entries[key].location if key in node.entries else node.location
