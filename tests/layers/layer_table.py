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
    """Imports that break a rule, and why.

    Attributes:
        importer: Dotted name of a module, or a pattern of such names.
        imported: The same of what it imports.
        reason: One sentence, also on when it goes.
    """

    importer: str
    imported: str
    reason: str

    def covers(self, each: Import) -> bool:
        """Returns whether an import is one of these."""
        return fnmatchcase(each.importer, self.importer) and fnmatchcase(each.imported, self.imported)


@dataclass(frozen=True, slots=True)
class LayerTable:
    """What may import what.

    Attributes:
        max_modules: Most modules in one folder.
        ros: Patterns of packages and modules that are clients or messages of ROS.
        ground_floor: Python packages that every package may import.
        packages: Folder of a catkin package (a pattern) -> the Python packages it may import besides.
        rooms: Package or room -> its rooms from the bottom up; those of one level do not import each other. The modules
            that lie directly in the folder are the room ".".
        ros_interface: Python package -> its rooms and modules (patterns) that may import ROS.
        exemptions: The imports that break these rules.
    """

    max_modules: int
    ros: tuple[str, ...]
    ground_floor: tuple[str, ...]
    packages: dict[str, tuple[str, ...]]
    rooms: dict[str, tuple[tuple[str, ...], ...]]
    ros_interface: dict[str, tuple[str, ...]]
    exemptions: tuple[Exemption, ...]

    def allowed_packages(self, package: str, folder: str) -> tuple[str, ...] | None:
        """Returns what a package may import, None where the table does not say it."""
        for pattern, allowed in self.packages.items():
            if fnmatchcase(folder, pattern):
                return allowed if package in self.ground_floor else (*allowed, *self.ground_floor)
        return None

    def is_ros(self, imported: str) -> bool:
        """Returns whether what is imported is a client or messages of ROS."""
        return any(fnmatchcase(imported, pattern) for pattern in self.ros)

    def may_use_ros(self, module: str) -> bool:
        """Returns whether a module may import ROS: its file is called `ros_*`, or the table says so."""
        inside = module.partition(".")[2]
        patterns = self.ros_interface.get(package_of(module), ())
        return inside.rpartition(".")[2].startswith("ros_") or any(
            fnmatchcase(inside, pattern) or fnmatchcase(inside, f"{pattern}.*") for pattern in patterns
        )


def read_layer_table(path: Path) -> LayerTable:
    """Reads the table from TOML.

    Raises:
        TableError: It is no TOML, or an entry is missing or unknown.
    """
    try:
        return parse_layer_table(tomllib.loads(path.read_text()))
    except (tomllib.TOMLDecodeError, KeyError, TypeError) as error:
        raise TableError(f"{path}: {type(error).__name__}: {error}; compare it with the table's history") from error


def parse_layer_table(text: dict) -> LayerTable:
    """Turns what TOML says into a table.

    Raises:
        KeyError: An entry is missing.
        TypeError: An entry is unknown.
    """
    known = {"max_modules_in_a_folder", "ros", "ground_floor", "packages", "rooms", "ros_interface", "exemptions"}
    if unknown := set(text) - known:
        raise TypeError(f"unknown entries {sorted(unknown)}")
    return LayerTable(
        max_modules=text["max_modules_in_a_folder"],
        ros=tuple(text["ros"]),
        ground_floor=tuple(text["ground_floor"]),
        packages={folder: tuple(allowed) for folder, allowed in text["packages"].items()},
        rooms={
            owner: tuple((item,) if isinstance(item, str) else tuple(item) for item in levels)
            for owner, levels in text["rooms"].items()
        },
        ros_interface={package: tuple(patterns) for package, patterns in text["ros_interface"].items()},
        exemptions=tuple(Exemption(**entry) for entry in text.get("exemptions", ())),
    )
