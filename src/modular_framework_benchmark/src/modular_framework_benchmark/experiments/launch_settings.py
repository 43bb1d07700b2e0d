# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the modes that start a launch file: the file, its arguments, the task, the objects."""

from __future__ import annotations

import re
from collections.abc import Mapping as Map
from typing import Any

from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_benchmark.experiments.resource_lookup import UnresolvedReference
from modular_framework_benchmark.experiments.scene_objects import ObjectNodes, SceneObject, named_object
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, kind_of
from modular_framework_core.task_constructor.key_spelling import intended_key

DEFAULT_LAUNCH = "modular_framework_api/start_framework.launch"
DEFAULT_TASK = "simulation_pick.yaml"
OWN_ARGUMENTS = {
    "task_constructor_script": "give it with the key task",
    "end_with_task": "an episode needs its launch after the task has ended",
    "seed": "each episode has its own seed, made from the experiment's key seed",
}
"""Launch arguments that the episodes set themselves, with the alternative for the user."""
FILE_ARGUMENTS = ("world_file", "scene_file", "generated_state_machine_name")
"""Arguments that name a file but determine neither the launched nodes nor the robot."""


def read_launch(node: Node, reading: Reading) -> str | None:
    """Reads a launch file as PACKAGE/FILE or as a path."""
    name = reading.text(node, "launch")
    if name is None:
        return None
    given = str(reading.path(name)) if name.startswith((".", "~", "/")) else name
    try:
        reading.resources.launch_file(given)
    except UnresolvedReference as error:
        reading.faults.add(node.location, str(error))
        return None
    return given


def read_task(node: Node, reading: Reading) -> str | None:
    """Reads a task by name or path."""
    name = reading.text(node, "task")
    if name is None:
        return None
    try:
        return reading.resources.task(name, reading.folder)
    except UnresolvedReference as error:
        reading.faults.add(node.location, str(error))
    return None


def read_arguments(node: Node, reading: Reading) -> dict[str, str] | None:
    """Reads launch arguments as the text that roslaunch expects."""
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
    """Checks the arguments against the launch file, finds the models, and returns the settings.

    The settings lack `arguments` if an invalid argument leaves the launched nodes unknown.

    Args:
        node: Settings of a combination.
        values: Values of the keys that could be read.
        reading: Reader that collects faults and looks up references.
    """
    if "launch" not in values:
        return values
    launch, arguments = values["launch"], values.get("arguments", {})
    try:
        known = reading.resources.launch_arguments(launch)
    except UnresolvedReference as error:
        reading.faults.add(_location_of(node, "launch"), str(error))
        return {key: value for key, value in values.items() if key != "launch"}
    sound, decides = _sound_arguments(node, launch, arguments, known, reading)
    if values.get("task") == DEFAULT_TASK:
        values["task"] = reading.resources.task(DEFAULT_TASK, reading.folder)
    before = len(reading.faults)
    objects = placed_objects(values.get("objects", []), launch, sound, reading)
    if len(reading.faults) == before and "objects" in values:
        _check_success(node, values.get("success") or {}, [found.name for found in objects], reading)
    result = values | {"objects": objects, "arguments": sound}
    return result if decides else {key: value for key, value in result.items() if key != "arguments"}


def _check_success(node: Mapping, success: dict[str, Any], names: list[str], reading: Reading) -> None:
    wanted = success.get("object")
    if wanted is not None and wanted not in names:
        reading.faults.add_unknown(_location_of(node, "success"), "the object of success", wanted, names)
    elif success and not names:
        reading.faults.add(_location_of(node, "success"), "success names an object, but objects is empty; add it there")


def _sound_arguments(
    node: Mapping, launch: str, given: dict[str, str], known: Map[str, str | None], reading: Reading
) -> tuple[dict[str, str], bool]:
    """Returns the valid arguments, and whether they determine the launched nodes.

    A misspelt name counts as the intended argument.
    """
    keys = node.entries.get("arguments")
    locations = keys.keys if isinstance(keys, Mapping) else {}
    sound = {name: value for name, value in given.items() if name in known}
    decides = "arguments" not in node.entries or isinstance(keys, Mapping)
    for name in given:
        if name not in known:
            what = f"the argument of {launch}"
            reading.faults.add_unknown(locations[name], what, name, sorted(known), given=given)
            meant = intended_key(name, [free for free in known if free not in given])
            if meant is not None:
                sound[meant] = given[name]
            decides = decides and meant is not None
    wrong = {"": ""}
    while wrong:  # faults of files are found once the other values are right
        wrong = {_argument_in(text): text for text in reading.resources.launch_faults(launch, sound)}
        for name, text in wrong.items():
            reading.faults.add(locations.get(name, _location_of(node, "arguments")), text)
            is_truth = str(known.get(name)).lower() in ("true", "false")
            decides = decides and (name in FILE_ARGUMENTS or is_truth)
        if not wrong.keys() & sound.keys():
            break
        sound = {name: value for name, value in sound.items() if name not in wrong}
    return sound, decides


def _argument_in(fault: str) -> str:
    """Returns the argument named in a fault; empty if there is none."""
    named = re.search(r"argument '([^']*)'", fault)
    return named[1] if named is not None else ""


def placed_objects(
    found: list[ObjectNodes], launch: str, arguments: dict[str, str], reading: Reading
) -> list[SceneObject]:
    """Returns objects with the files of their models, and adds faults.

    Args:
        found: Objects of the experiment file.
        launch: Launch file whose description package contains the models.
        arguments: Arguments of the launch file.
        reading: Reader that collects faults.
    """
    taken: set[str] = set()
    objects = []
    for item in found:
        try:
            file = reading.resources.model(item.model, launch, arguments, reading.folder)
        except UnresolvedReference as error:
            reading.faults.add(item.node.entries["model"].location, str(error))
            continue
        objects.append(named_object(item, file, taken, reading))
    return objects


def _location_of(node: Mapping, key: str) -> Any:
    return node.entries[key].location if key in node.entries else node.location
