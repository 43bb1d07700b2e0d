# SPDX-License-Identifier: BSD-3-Clause
"""Reads controller files and plans which controllers to load and start."""

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
    """A controller file is invalid; the message lists all faults."""


@dataclass(frozen=True, slots=True)
class ControllerFile:
    """A checked controller file.

    Attributes:
        path: Path of the file.
        parameters: Content of the file, for the parameter server.
        controllers: Controller names in file order, which are the keys whose mapping has a `type`.
    """

    path: Path
    parameters: dict[str, Any]
    controllers: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SpawnPlan:
    """Controllers to load and to start.

    Attributes:
        load: Names of controllers that are not loaded.
        start: Names of controllers that are not running.
    """

    load: tuple[str, ...]
    start: tuple[str, ...]


def read_controller_file(path: Path) -> ControllerFile:
    """Reads `<robot package>/controllers/<file>`.

    Raises:
        ControllerFileError: The file does not exist, is not a YAML mapping, or contains no valid controller.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        file_names = ", ".join(sorted(file.name for file in path.parent.glob("*.yaml"))) or "none"
        raise ControllerFileError(
            f"controller file {path}: {error.strerror}; controller files beside it: {file_names}"
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
        faults.append(f"none of its keys ({', '.join(map(str, content))}) has a 'type'; add a controller")
    if faults:
        raise ControllerFileError(f"controller file {path}: {'; '.join(faults)}")
    return ControllerFile(path, content, names)


def with_joint_states(file: ControllerFile, loaded_types: Iterable[str]) -> ControllerFile:
    """Returns the file with an added joint state controller, unless the file or the controller manager has one.

    Args:
        file: Controller file.
        loaded_types: Types of the loaded controllers.
    """
    types = [file.parameters[name]["type"] for name in file.controllers]
    if any(kind.rpartition("/")[2] == JOINT_STATES_TYPE.rpartition("/")[2] for kind in (*types, *loaded_types)):
        return file
    settings = {"type": JOINT_STATES_TYPE, "publish_rate": JOINT_STATES_RATE_HZ}
    return ControllerFile(
        file.path, {**file.parameters, JOINT_STATES_NAME: settings}, (JOINT_STATES_NAME, *file.controllers)
    )


def _is_type(value: object) -> bool:
    return isinstance(value, str) and value.count("/") == 1 and not value.startswith("/") and not value.endswith("/")


def plan_spawn(names: Sequence[str], states: Mapping[str, str]) -> SpawnPlan:
    """Plans which controllers to load and start so that all requested controllers run.

    Args:
        names: Names of the requested controllers.
        states: State of each loaded controller by name, as reported by list_controllers.
    """
    return SpawnPlan(
        load=tuple(name for name in names if name not in states),
        start=tuple(name for name in names if states.get(name) != "running"),
    )
