# SPDX-License-Identifier: BSD-3-Clause
"""What a mode of experiments consists of: a dataclass of settings with their keys, a runner, a check, metrics."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Generic

from modular_framework_benchmark.experiments.problem_sets import Problem
from modular_framework_benchmark.experiments.reading import Reading, json_value
from modular_framework_benchmark.experiments.scene_objects import ObjectNodes, SceneObject
from modular_framework_benchmark.records.episode_settings import EpisodeSettings, SettingsT
from modular_framework_core.files.located_yaml import Mapping as NodeMapping
from modular_framework_core.files.located_yaml import Node

ReadValue = Callable[[Reading, Node, str], Any]
"""Reader of a value, given its key, such as a method of Reading; returns None for an unreadable value."""
_KEY = "key"
OWN_PARAMETERS = {
    "/seed": "each episode has its own seed, made from the experiment's key seed",
    "/task/wait_for_start": "an episode starts its task itself",
    "/task/record_directory": "an episode keeps the record of its task in its own folder",
}
"""Parameters that the episodes set themselves, with the alternative for the user."""


@dataclass(frozen=True, slots=True)
class SettingKey:
    """Key of an experiment file.

    Attributes:
        name: Name of the key; "" for the name of the field.
        read: Reader of the value.
        required: Whether the key must be present.
    """

    name: str
    read: ReadValue
    required: bool


def setting(read: ReadValue, default: Any, *, required: bool = False, key: str = "") -> Any:
    """Declares a field that a key of the experiment file sets.

    Args:
        read: Reader of the value.
        default: Value of an absent or unreadable key, and of a scene or problem that is not drawn yet.
        required: Whether the key must be present.
        key: Name of the key; "" for the name of the field.
    """
    return field(default_factory=lambda: default, metadata={_KEY: SettingKey(key, read, required)})


@dataclass(frozen=True, slots=True)
class ReadSettings(Generic[SettingsT]):
    """Readable settings of a combination of levels.

    Attributes:
        node: Mapping of the file: base settings overridden by the levels.
        settings: Settings without scene and problem, which each trial draws; unreadable keys have their default.
        unreadable: Keys without a usable value.
        objects: Objects that each trial places.
        problems: Planning problems; each trial has one problem.
    """

    node: NodeMapping
    settings: SettingsT
    unreadable: frozenset[str]
    objects: tuple[SceneObject, ...] = ()
    problems: tuple[Problem, ...] = ()


@dataclass(frozen=True, slots=True)
class SettingFault:
    """A fault of a setting.

    Attributes:
        keys: Keys that lead to the value in the experiment file, outermost first.
        text: Description of the fault.
    """

    keys: tuple[str, ...]
    text: str


@dataclass(frozen=True, slots=True)
class CheckedSettings:
    """Settings with resolved names.

    Attributes:
        faults: Faults of the settings.
        resolved: Description of the execution as JSON values, without scenes and problems; equal if the settings
            execute the same.
        substitutions: Substitutions of named planners and solvers, known in advance.
        without_effect: Settings that change nothing, and the reason as the end of a sentence. The key is the name of a
            parameter, or `/` and the keys that lead to the value, separated by `/`.
    """

    faults: tuple[SettingFault, ...]
    resolved: Any
    substitutions: tuple[str, ...] = ()
    without_effect: Mapping[str, str] = field(default_factory=dict)


SettingsCheck = Callable[[ReadSettings[Any]], CheckedSettings]
"""Check that resolves the names in the settings of a combination before any episode runs."""

Finish = Callable[[ReadSettings[Any], Sequence[ObjectNodes], Reading], ReadSettings[Any]]
"""Check of the relations between keys, which finds the models of the objects."""


def _unchanged_settings(read: ReadSettings[Any], nodes: Sequence[ObjectNodes], reading: Reading) -> ReadSettings[Any]:
    return read


@dataclass(frozen=True, slots=True)
class Mode:
    """A mode of experiments.

    Attributes:
        name: Value of the key `mode`.
        settings: Class of the settings; `setting` declares its keys.
        runner: MODULE:NAME of the factory of its runner.
        check: MODULE:NAME of its check: a function of a runner and `ReadSettings` that returns `CheckedSettings`.
        components: Components whose metrics the mode measures, in addition to success.
        finish: Check of the relations between keys.
    """

    name: str
    settings: type[EpisodeSettings]
    runner: str
    check: str
    components: frozenset[str]
    finish: Finish = _unchanged_settings

    @property
    def keys(self) -> Mapping[str, tuple[str, SettingKey]]:
        """Returns the name of the field and the declaration of each key, by its name in the file."""
        declared = [(item.name, item.metadata[_KEY]) for item in fields(self.settings) if _KEY in item.metadata]
        return {key.name or name: (name, key) for name, key in declared}

    def read(self, node: NodeMapping, reading: Reading) -> ReadSettings[Any]:
        """Reads the settings of a combination of levels.

        Args:
            node: Base settings overridden by the levels; known keys only.
            reading: Reader that collects faults and looks up references.
        """
        values: dict[str, Any] = {}
        unreadable = set()
        for name, (field_name, key) in self.keys.items():
            if name not in node.entries and not key.required:
                continue
            if name not in node.entries:
                text = f"mode {self.name} needs the key '{name}', in the file or in every level"
                reading.faults.add(node.location, text)
            value = key.read(reading, node.entries[name], name) if name in node.entries else None
            if value is None:
                unreadable.add(name)
            else:
                values[field_name] = value
        objects, problems = values.pop("objects", ()), values.pop("problem", ())
        read = ReadSettings(node, self.settings(**values), frozenset(unreadable), problems=tuple(problems))
        return self.finish(read, objects, reading)


def count(high: int = 1_000_000) -> ReadValue:
    """Returns a reader of whole numbers from 1."""
    return lambda reading, node, key: reading.count(node, key, 1, high)


def named_values(example: str) -> ReadValue:
    """Returns a reader of values by name."""

    def read(reading: Reading, node: Node, key: str) -> dict[str, Any] | None:
        mapping = reading.mapping(node, key, example)
        return None if mapping is None else {name: json_value(value) for name, value in mapping.entries.items()}

    return read


def ros_parameters(reading: Reading, node: Node, key: str) -> dict[str, Any] | None:
    """Reads ROS parameters by full name; None if the value is no mapping.

    Args:
        reading: Reader that collects faults and looks up references.
        node: Value in the file.
        key: Name of the key, for faults.
    """
    mapping = reading.mapping(node, key, "{/planner_name: RRTConnect}")
    if mapping is None:
        return None
    values: dict[str, Any] = {}
    for name, location in mapping.keys.items():
        if name in OWN_PARAMETERS:
            reading.faults.add(location, f"the parameter '{name}' cannot be given: {OWN_PARAMETERS[name]}")
        elif not name.startswith("/") or name != "/" + "/".join(part for part in name.split("/") if part):
            reading.faults.add(location, f"the parameter '{name}' must be a full name from /, such as /planner_name")
        else:
            values[name] = json_value(mapping.entries[name])
    return values
