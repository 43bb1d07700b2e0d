# SPDX-License-Identifier: BSD-3-Clause
"""The mode `task`: the whole stack in simulation, started by a launch file."""

from __future__ import annotations

import re
from collections.abc import Mapping as Map
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from modular_framework_benchmark.experiments.mode import Mode, ReadSettings, ros_parameters, setting
from modular_framework_benchmark.experiments.model_sizes import joints_of_file
from modular_framework_benchmark.experiments.perturb_reading import read_perturbation
from modular_framework_benchmark.experiments.predicate_reading import KnownNames, PredicateReading, read_regions
from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_benchmark.experiments.resource_lookup import DEFAULT_LAUNCH, UnreadableWorld, UnresolvedReference
from modular_framework_benchmark.experiments.scene_objects import (
    ObjectNodes,
    SceneObject,
    perturbed_objects,
    placed_objects,
    read_objects,
)
from modular_framework_benchmark.experiments.success_criteria import NO_CRITERIA, SuccessCriteria
from modular_framework_benchmark.predicates.conditions import HeldFor, Lifted, Region
from modular_framework_benchmark.predicates.predicate import Condition
from modular_framework_benchmark.predicates.progress import Milestone
from modular_framework_benchmark.records.episode_settings import EpisodeSettings, PlacedObject, SettingsError
from modular_framework_benchmark.records.perturbation import PERTURBATION, Perturbation
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, kind_of
from modular_framework_core.task_constructor.key_spelling import intended_key
from modular_framework_core.task_constructor.machine_files import machine_files

DEFAULT_TASK = "simulation_pick.yaml"
OWN_ARGUMENTS = {
    "task_constructor_script": "give it with the key task",
    "end_with_task": "an episode needs its launch after the task has ended",
    "seed": "each episode has its own seed, made from the experiment's key seed",
}
"""Launch arguments that the episodes set themselves, with the alternative for the user."""
WORLD_ARGUMENTS = ("world_file", "description_package")
"""Arguments that name the world; the first argument names the world file."""
FILE_ARGUMENTS = ("world_file", "scene_file", "generated_state_machine_name")
"""Arguments that name a file but determine neither the launched nodes nor the robot."""


def _read_launch(reading: Reading, node: Node, key: str) -> str | None:
    """Reads a launch file as PACKAGE/FILE or as a path."""
    name = reading.text(node, key)
    if name is None:
        return None
    given = str(reading.path(name)) if name.startswith((".", "~", "/")) else name
    try:
        reading.resources.launch_file(given)
    except UnresolvedReference as error:
        reading.faults.add(node.location, str(error))
        return None
    return given


def _read_task(reading: Reading, node: Node, key: str) -> str | None:
    """Reads a task by name or path."""
    name = reading.text(node, key)
    if name is None:
        return None
    try:
        return reading.resources.task(name, reading.folder)
    except UnresolvedReference as error:
        reading.faults.add(node.location, str(error))
    return None


def _read_arguments(reading: Reading, node: Node, key: str) -> dict[str, str] | None:
    """Reads launch arguments as the text that roslaunch expects."""
    mapping = reading.mapping(node, key, "{world_file: ur5_table.world}")
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


def _read_extra_parameters(reading: Reading, node: Node, key: str) -> tuple[str, ...] | None:
    """Reads the names of parameters that the user's own nodes read."""
    items = reading.items(node, key, "[/my_node/my_parameter]")
    if items is None:
        return None
    return tuple(name for item in items if (name := reading.text(item, f"a name in {key}")) is not None)


def _placeholder_value(reading: Reading, node: Node, key: str) -> Any:
    """Returns a value that `_finish` replaces, once the names of objects and models are known."""
    return NO_CRITERIA if key == "success" else ()


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskSettings(EpisodeSettings):
    """Settings of an episode of the mode `task`.

    Attributes:
        launch: Launch file as PACKAGE/FILE, or its absolute path.
        arguments: Launch arguments.
        parameters: ROS parameters that override those of the launch files, keyed by full name.
        extra_parameters: Names of parameters that the user's own nodes read.
        objects: Objects to spawn before the task starts.
        warm: Whether the stack may be reused.
        task: Task script; "" for the default of the launch file.
        regions: Regions that predicates name.
        success: Success criteria.
        progress: Milestones in their order.
        perturbation: Values of the perturbed axes; None for none.
    """

    launch: str = setting(_read_launch, DEFAULT_LAUNCH)
    arguments: Map[str, str] = setting(_read_arguments, {})
    parameters: Map[str, Any] = setting(ros_parameters, {})
    extra_parameters: tuple[str, ...] = setting(_read_extra_parameters, ())
    objects: tuple[PlacedObject, ...] = setting(read_objects, ())
    warm: bool = setting(Reading.truth, True)
    task: str = setting(_read_task, "")
    regions: tuple[Region, ...] = setting(read_regions, ())
    success: SuccessCriteria = setting(_placeholder_value, NO_CRITERIA)
    progress: tuple[Milestone, ...] = setting(_placeholder_value, ())
    perturbation: Perturbation | None = setting(read_perturbation, None)

    @property
    def judged_object(self) -> str:
        """Name of the object that grasp metrics describe; "" if no object is judged.

        The object is the first object that a predicate wants lifted or held, or else the first object.

        Raises:
            SettingsError: An object must be lifted and held, but there are no objects.
        """
        if self.success == NO_CRITERIA and not self.progress:
            return ""
        if self.success.object is None and not self.objects and not self.success.is_pick:
            return ""
        if self.success.object is None and not self.objects:
            raise SettingsError(
                "setting 'success' names no object, and there are no objects; add 'object', or remove 'success'"
            )
        return self.success.object or self._first_grasped or self.objects[0].name

    @property
    def _first_grasped(self) -> str:
        """Returns the name of the first object that a predicate wants lifted or held; "" for none."""
        if self.success.is_pick:
            return ""
        return next((item.object for item in self.conditions if isinstance(item, Lifted | HeldFor)), "")

    @property
    def conditions(self) -> list[Condition]:
        """Returns the conditions of success and milestones."""
        required = self.success.required
        predicates = [*([required] if required is not None else []), *(each.predicate for each in self.progress)]
        return [condition for predicate in predicates for condition in predicate.conditions]

    @property
    def has_milestones(self) -> bool:
        """Returns whether the episode has milestones."""
        return bool(self.progress)

    @property
    def is_shaken(self) -> bool:
        """Returns whether the arm shakes the object after the check."""
        return bool(self.success.shake)

    @property
    def files(self) -> tuple[Path, ...]:
        """Returns the task script and the files of its machines."""
        return (Path(self.task), *machine_files(Path(self.task))) if self.task else ()


def _finish(
    read: ReadSettings[TaskSettings], nodes: Sequence[ObjectNodes], reading: Reading
) -> ReadSettings[TaskSettings]:
    """Checks the arguments against the launch file, finds the models, and looks up the default task.

    `arguments` is unreadable if an invalid argument leaves the launched nodes unknown.
    """
    if "launch" in read.unreadable:
        return _with_predicates(read, KnownNames(), reading)
    settings = read.settings
    try:
        arguments_of_launch = reading.resources.launch_arguments(settings.launch)
    except UnresolvedReference as error:
        reading.faults.add(_location_of(read.node, "launch"), str(error))
        return _with_predicates(replace(read, unreadable=read.unreadable | {"launch"}), KnownNames(), reading)
    sound, decides = _sound_arguments(read.node, settings.launch, settings.arguments, arguments_of_launch, reading)
    task = settings.task
    if not task and "task" not in read.unreadable:
        task = reading.resources.task(DEFAULT_TASK, reading.folder)
    models = _world_models(read, sound, reading)
    objects = placed_objects(nodes, settings.launch, sound, reading, models or ())
    if settings.perturbation is not None:
        location = _location_of(read.node, PERTURBATION)
        if not nodes and "objects" not in read.unreadable:
            reading.faults.add(location, "there are no objects to perturb; list them in the key objects")
        objects = perturbed_objects(objects, settings.perturbation, location, reading)
    if "objects" in read.unreadable or len(objects) < sum(node.count or 1 for node in nodes):
        names = KnownNames()
    else:
        names = _known_names(objects, models)
    settings = replace(settings, arguments=sound if decides else {}, task=task)
    read = _with_predicates(replace(read, settings=settings, objects=tuple(objects)), names, reading)
    return read if decides else replace(read, unreadable=read.unreadable | {"arguments"})


def _world_models(
    read: ReadSettings[TaskSettings], arguments: Map[str, str], reading: Reading
) -> Map[str, Sequence[str]] | None:
    """Returns the joints of each model in the world, keyed by model; None if the world is unknown.

    Adds a fault if the world cannot be read.
    """
    if read.settings.arguments.keys() & set(WORLD_ARGUMENTS) - arguments.keys():
        return None  # the world is not the intended one
    try:
        return reading.resources.world_models(read.settings.launch, arguments)
    except UnreadableWorld as error:
        given = read.node.entries.get("arguments")
        location = _location_of(given if isinstance(given, Mapping) else read.node, WORLD_ARGUMENTS[0])
        reading.faults.add(location, str(error))
    except UnresolvedReference:
        pass
    return None


def _known_names(objects: Sequence[SceneObject], models: Map[str, Sequence[str]] | None) -> KnownNames:
    """Returns the names that predicates may use."""
    joints = {item.name: found for item in objects if (found := joints_of_file(item.file)) is not None}
    return KnownNames(tuple(item.name for item in objects), models, {**(models or {}), **joints})


def _with_predicates(
    read: ReadSettings[TaskSettings], names: KnownNames, reading: Reading
) -> ReadSettings[TaskSettings]:
    """Returns the settings with their success criteria and milestones."""
    regions = {region.name: region for region in read.settings.regions}
    predicates = PredicateReading(reading, replace(names, regions=regions))
    settings_of_key: dict[str, Any] = {}
    for key, reader in (("success", predicates.success), ("progress", predicates.progress)):
        if key in read.node.entries:
            settings_of_key[key] = reader(read.node.entries[key], key)
    unreadable = {key for key, value in settings_of_key.items() if value is None}
    settings = replace(read.settings, **{key: settings_of_key[key] for key in settings_of_key.keys() - unreadable})
    return replace(read, settings=settings, unreadable=read.unreadable | unreadable)


def _sound_arguments(
    node: Mapping, launch: str, arguments: Map[str, str], known_arguments: Map[str, str | None], reading: Reading
) -> tuple[dict[str, str], bool]:
    """Returns the valid arguments, and whether they determine the launched nodes.

    A misspelt name counts as the intended argument.
    """
    keys = node.entries.get("arguments")
    locations = keys.keys if isinstance(keys, Mapping) else {}
    sound = {name: value for name, value in arguments.items() if name in known_arguments}
    decides = "arguments" not in node.entries or isinstance(keys, Mapping)
    for name in arguments:
        if name not in known_arguments:
            what = f"the argument of {launch}"
            reading.faults.add_unknown(locations[name], what, name, sorted(known_arguments), used=arguments)
            intended_name = intended_key(name, [free for free in known_arguments if free not in arguments])
            if intended_name is not None:
                sound[intended_name] = arguments[name]
            decides = decides and intended_name is not None
    wrong = {"": ""}
    while wrong:  # faults of files are found once the other values are right
        wrong = {_argument_in(text): text for text in reading.resources.launch_faults(launch, sound)}
        for name, text in wrong.items():
            reading.faults.add(locations.get(name, _location_of(node, "arguments")), text)
            is_truth = str(known_arguments.get(name)).lower() in ("true", "false")
            decides = decides and (name in FILE_ARGUMENTS or is_truth)
        if not wrong.keys() & sound.keys():
            break
        sound = {name: value for name, value in sound.items() if name not in wrong}
    return sound, decides


def _argument_in(fault: str) -> str:
    """Returns the argument named in a fault; empty if there is none."""
    named = re.search(r"argument '([^']*)'", fault)
    return named[1] if named is not None else ""


def _location_of(node: Mapping, key: str) -> Any:
    return node.entries[key].location if key in node.entries else node.location


TASK = Mode(
    "task",
    TaskSettings,
    "modular_framework_benchmark.episodes.ros_task_runner:TaskEpisodeRunner",
    "modular_framework_benchmark.modes.ros_setting_checks:check_task",
    frozenset({"task", "generation", "planning", "execution", "grasp", "policy"}),
    _finish,
)
