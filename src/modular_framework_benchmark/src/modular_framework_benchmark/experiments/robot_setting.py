# SPDX-License-Identifier: BSD-3-Clause
"""The robot of the modes without simulation: a MoveIt configuration package, or URDF and SRDF files."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TypeVar

from modular_framework_benchmark.experiments.mode import setting
from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_benchmark.experiments.resource_lookup import UnresolvedReference
from modular_framework_benchmark.records.episode_settings import EpisodeSettings
from modular_framework_core.files.located_yaml import Mapping, Node


@dataclass(frozen=True, slots=True)
class RobotFiles:
    """Absolute paths of the files of a robot without a configuration package."""

    urdf: str
    srdf: str


RobotSource = str | RobotFiles
"""Name of a MoveIt configuration package, or files."""


def read_robot(reading: Reading, node: Node, key: str) -> RobotSource | None:
    """Reads the robot, whose package or files must exist; None after a fault.

    Args:
        reading: Reader that collects faults and looks up references.
        node: Value in the file.
        key: Name of the key, for faults.
    """
    if isinstance(node, Mapping):
        return _read_files(node, key, reading)
    package = reading.text(node, key)
    if package is not None:
        try:
            reading.resources.package(package)
        except UnresolvedReference as error:
            reading.faults.add(node.location, str(error))
            return None
    return package


def _read_files(node: Mapping, key: str, reading: Reading) -> RobotFiles | None:
    kinds = tuple(item.name for item in fields(RobotFiles))
    files: dict[str, str] = {}
    before = len(reading.faults)
    for kind, value in node.entries.items():
        if kind not in kinds:
            reading.faults.add_unknown(node.keys[kind], f"the key of {key}", kind, kinds)
            continue
        text = reading.text(value, kind)
        path = reading.path(text) if text is not None else None
        if path is not None and not path.is_file():
            reading.faults.add(value.location, f"there is no file {path}; name the {kind} file of the robot")
        files[kind] = str(path)
    for kind in kinds:
        if kind not in node.entries:
            reading.faults.add(node.location, f"{key} has no {kind}; allowed: a package, or {{urdf: FILE, srdf: FILE}}")
    return RobotFiles(**files) if len(reading.faults) == before else None


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelSettings(EpisodeSettings):
    """Settings of the modes without simulation.

    Attributes:
        robot: Robot; required in experiment files.
    """

    robot: RobotSource = setting(read_robot, "", required=True)

    @property
    def packages(self) -> frozenset[str]:
        """Returns the package of the robot, if it has one."""
        return frozenset({self.robot} if isinstance(self.robot, str) else ())


ModelSettingsT = TypeVar("ModelSettingsT", bound=ModelSettings)
