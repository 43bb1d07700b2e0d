# SPDX-License-Identifier: BSD-3-Clause
"""The table that says what may import what: `layers.toml` as values."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from source_tree import Import, package_of


class TableError(Exception):
    """The table cannot be read; the text says where and why."""


@dataclass(frozen=True, slots=True)
class Exemption:
    """Imports that break a rule: names or patterns of both modules, and the reason."""

    importer: str
    imported: str
    reason: str

    def covers(self, each: Import) -> bool:
        """Returns whether an import is one of these."""
        return fnmatchcase(each.importer, self.importer) and fnmatchcase(each.imported, self.imported)


@dataclass(frozen=True, slots=True)
class LayerTable:
    """What may import what; the attributes are the entries of the file.

    Attributes:
        max_modules_in_a_folder: Most modules in one folder.
        ros: Patterns of packages and modules that are clients or messages of ROS.
        ground_floor: Python packages that every package may import.
        packages: Folder of a catkin package (a pattern) -> the Python packages it may import besides.
        rooms: Package or room -> its rooms from the bottom up; those of a list do not import each other. The modules
            that lie directly in the folder are the room ".".
        ros_interface: Python package -> its rooms and modules (patterns) that may import ROS.
        exemptions: The imports that break these rules.
    """

    max_modules_in_a_folder: int
    ros: list[str]
    ground_floor: list[str]
    packages: dict[str, list[str]]
    rooms: dict[str, list[str | list[str]]]
    ros_interface: dict[str, list[str]]
    exemptions: list[Exemption]

    def allowed_packages(self, package: str, folder: str) -> list[str] | None:
        """Returns what a package may import, None where the table does not say it."""
        for pattern, allowed in self.packages.items():
            if fnmatchcase(folder, pattern):
                return allowed if package in self.ground_floor else [*allowed, *self.ground_floor]
        return None

    def levels(self, owner: str) -> list[list[str]]:
        """Returns the rooms of a package or room from the bottom up, those of one level in a list."""
        return [[level] if isinstance(level, str) else level for level in self.rooms.get(owner, [])]

    def is_ros(self, imported: str) -> bool:
        """Returns whether what is imported is a client or messages of ROS."""
        return any(fnmatchcase(imported, pattern) for pattern in self.ros)

    def may_use_ros(self, module: str) -> bool:
        """Returns whether a module may import ROS: its file is called `ros_*`, or the table says so."""
        inside = module.partition(".")[2]
        patterns = self.ros_interface.get(package_of(module), [])
        return inside.rpartition(".")[2].startswith("ros_") or any(
            fnmatchcase(inside, pattern) or fnmatchcase(inside, f"{pattern}.*") for pattern in patterns
        )


def read_layer_table(path: Path) -> LayerTable:
    """Reads the table.

    Raises:
        TableError: It is no TOML, or an entry is missing or unknown.
    """
    try:
        return make_layer_table(tomllib.loads(path.read_text()))
    except (tomllib.TOMLDecodeError, TypeError) as error:
        raise TableError(f"{path}: {error}; compare it with the table's history") from error


def make_layer_table(entries: dict) -> LayerTable:
    """Makes a table of the entries of a file; raises TypeError where one is missing or unknown."""
    exemptions = [Exemption(**entry) for entry in entries.get("exemptions", [])]
    return LayerTable(**entries | {"exemptions": exemptions})
