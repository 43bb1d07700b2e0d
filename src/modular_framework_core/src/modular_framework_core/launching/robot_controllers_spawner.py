# SPDX-License-Identifier: BSD-3-Clause
"""Reads controller files, and plans which of their controllers have to be loaded and started."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

JOINT_STATES_NAME = "joint_state_controller"
JOINT_STATES_TYPE = "joint_state_controller/JointStateController"
JOINT_STATES_RATE_HZ = 50.0


class ControllerFileError(Exception):
    """A controller file cannot be used; the message lists everything that is wrong with it."""


@dataclass(frozen=True, slots=True)
class ControllerFile:
    """A controller file, read and checked.

    Attributes:
        path: Where it was read from.
        parameters: The whole mapping, for the parameter server.
        controllers: Names of the controllers, in the order of the file: the keys whose mapping has a `type`.
    """

    path: Path
    parameters: dict[str, Any]
    controllers: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SpawnPlan:
    """The loads and starts that are needed until all controllers run.

    Attributes:
        load: Controllers that are not loaded yet.
        start: Controllers that are not running yet.
    """

    load: tuple[str, ...]
    start: tuple[str, ...]


def read_controller_file(path: Path) -> ControllerFile:
    """Reads `<robot package>/controllers/<file>`.

    Raises:
        ControllerFileError: No such file, not YAML, not a mapping, or no controller in it.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        present = ", ".join(sorted(file.name for file in path.parent.glob("*.yaml"))) or "none"
        raise ControllerFileError(
            f"controller file {path}: {error.strerror}; controller files beside it: {present}"
        ) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ControllerFileError(f"controller file {path}: not valid YAML: {error}") from error
    if not isinstance(content, dict) or not content:
        raise ControllerFileError(
            f"controller file {path}: got {type(content).__name__}; expected a mapping of "
            "controller names to their parameters"
        )
    faults = [f"key {name!r} is not a name" for name in content if not isinstance(name, str)]
    faults += [
        f"'{name}/type' is {entry['type']!r}; expected package/Class"
        for name, entry in content.items()
        if isinstance(entry, dict) and "type" in entry and not _is_type(entry["type"])
    ]
    names = tuple(name for name, entry in content.items() if isinstance(entry, dict) and "type" in entry)
    if not names:
        faults.append(f"none of its keys ({', '.join(map(str, content))}) has a 'type': there is no controller in it")
    if faults:
        raise ControllerFileError(f"controller file {path}: {'; '.join(faults)}")
    return ControllerFile(path, content, names)


def with_joint_states(file: ControllerFile, running_types: Iterable[str]) -> ControllerFile:
    """Returns the file with a joint state controller, where neither it nor the controller manager has one.

    Args:
        file: What was read.
        running_types: Types of the controllers that are loaded already.
    """
    types = [file.parameters[name]["type"] for name in file.controllers]
    if any(kind.rpartition("/")[2] == JOINT_STATES_TYPE.rpartition("/")[2] for kind in (*types, *running_types)):
        return file
    settings = {"type": JOINT_STATES_TYPE, "publish_rate": JOINT_STATES_RATE_HZ}
    return ControllerFile(
        file.path, {**file.parameters, JOINT_STATES_NAME: settings}, (JOINT_STATES_NAME, *file.controllers)
    )


def _is_type(value: object) -> bool:
    return isinstance(value, str) and value.count("/") == 1 and not value.startswith("/") and not value.endswith("/")


def plan_spawn(wanted: Sequence[str], states: Mapping[str, str]) -> SpawnPlan:
    """Plans what is to do for the controllers `wanted`, given the state of those the manager has loaded.

    Args:
        wanted: Controller names.
        states: State by name, as list_controllers reports them.
    """
    return SpawnPlan(
        load=tuple(name for name in wanted if name not in states),
        start=tuple(name for name in wanted if states.get(name) != "running"),
    )
