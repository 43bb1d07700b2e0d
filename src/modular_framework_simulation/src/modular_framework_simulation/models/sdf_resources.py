# SPDX-License-Identifier: BSD-3-Clause
"""Finds the models and meshes that world and model files refer to by URI."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from modular_framework_ros.allowed_names import nearest
from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.xml_nodes import XmlNode, read_xml
from modular_framework_urdf.mesh_paths import PackageFinder

MODEL_PATH, RESOURCE_PATH = "GAZEBO_MODEL_PATH", "GAZEBO_RESOURCE_PATH"
"""Environment variables that list folders, separated by colons, as in Gazebo."""

_MAX_LISTED_FOLDERS = 4
"""Maximum number of folders in a message."""

NEWEST_VERSION = (1, 11)
OLDEST_VERSION = (1, 0)


def no_packages(name: str) -> str:
    """Raises LookupError for every package, in an environment without ROS packages."""
    raise LookupError(f"package '{name}' cannot be looked up without ROS packages")


@dataclass(frozen=True, slots=True)
class Resources:
    """Folders and packages that URIs refer to.

    Attributes:
        model_folders: Folders with one subfolder per model, in search order.
        find_package: Function that finds ROS packages for package:// URIs.
        resource_folders: Base folders of relative file:// URIs, searched after the folder of the referring file.
    """

    model_folders: tuple[Path, ...] = ()
    find_package: PackageFinder = no_packages
    resource_folders: tuple[Path, ...] = ()

    def resolve(self, node: XmlNode, uri: str) -> Path:
        """Returns the file or folder a URI stands for.

        Args:
            node: Element the URI was read from; relative paths start at its file.
            uri: A model://, package:// or file:// URI, a path, or the URL of a Gazebo Fuel model (found by its name).

        Raises:
            DescriptionError: The URI has another scheme or leads nowhere.
        """
        scheme, separator, rest = uri.partition("://")
        if not separator:
            candidates = self._relative_candidates(node, uri)
        elif scheme == "file":
            candidates = self._relative_candidates(node, rest)
        elif scheme == "model":
            rest = rest.lstrip("/")
            candidates = [folder / rest for folder in self.model_folders]
        elif scheme == "package":
            candidates = [self._in_package(node, rest)]
        elif scheme in ("http", "https") and "/models/" in rest:
            candidates = self._fuel_candidates(rest)
        else:
            raise DescriptionError(
                node.location,
                f"got URI '{uri}'",
                "allowed: model://, package://, file:// or a path relative to the file",
            )
        for candidate in candidates:
            if (rest if separator else uri) and candidate.exists():
                return candidate
        looked_in = ", ".join(str(candidate) for candidate in candidates[:_MAX_LISTED_FOLDERS])
        if len(candidates) > _MAX_LISTED_FOLDERS:
            looked_in += f" and in {len(candidates) - _MAX_LISTED_FOLDERS} more folders"
        looked_in = looked_in or "no folder, because no model folder is set"
        advice = f"set gazebo_model_path or {MODEL_PATH}"
        if scheme == "model":
            advice += nearest(rest.split("/")[0], self._model_names())
        raise DescriptionError(node.location, f"'{uri}' does not exist", f"looked for {looked_in}; {advice}")

    def _model_names(self) -> list[str]:
        """Returns the names of all models in the search path."""
        return [path.name for folder in self.model_folders if folder.is_dir() for path in sorted(folder.iterdir())]

    def _fuel_candidates(self, address: str) -> list[Path]:
        """Returns the local candidates of a Gazebo Fuel model, which is not downloaded."""
        name = unquote(address.partition("/models/")[2]).split("/")[0]
        names = dict.fromkeys((name, name.lower().replace(" ", "_")))
        return [folder / each for folder in self.model_folders for each in names]

    def _relative_candidates(self, node: XmlNode, path: str) -> list[Path]:
        if Path(path).is_absolute():
            return [Path(path)]
        return [folder / path for folder in (Path(node.source).parent, *self.resource_folders)]

    def _in_package(self, node: XmlNode, rest: str) -> Path:
        package, _, relative = rest.partition("/")
        try:
            return Path(self.find_package(package)) / relative
        except Exception as error:  # the caller's function may raise anything for a missing package
            raise DescriptionError(
                node.location, f"package '{package}' is not found ({error})", "install it"
            ) from error

    def model_file(self, node: XmlNode, uri: str) -> Path:
        """Returns the SDF file of an included model; a URI of a folder refers to the file in its model.config.

        Raises:
            DescriptionError: The model does not exist, or its model.config does not name an existing file.
        """
        path = self.resolve(node, uri)
        if path.is_file():
            return path
        if not (path / "model.config").is_file() and not (path / "model.sdf").is_file():
            raise DescriptionError(node.location, f"'{path}' contains no model", "a model folder needs a model.config")
        return model_file(path)


def model_file(folder: Path) -> Path:
    """Returns the SDF file of a model folder: the file in its model.config, or model.sdf without a model.config.

    Raises:
        DescriptionError: The model.config does not name an existing file.
    """
    config, default_file = folder / "model.config", folder / "model.sdf"
    if not config.is_file():
        return default_file
    try:
        root = read_xml(config)
    except DescriptionError:
        if default_file.is_file():  # the usual fault is an author's e-mail address in angle brackets
            return default_file
        raise
    return _newest_file(config, root)


def _newest_file(config: Path, root: XmlNode) -> Path:
    """Returns the file with the newest supported SDF version in a model.config."""
    entries = root.find_all("sdf")
    if not entries:
        raise DescriptionError(root.location, "names no <sdf> file", "add <sdf version='1.6'>model.sdf</sdf>")
    readable = [entry for entry in entries if _version_of(entry) <= NEWEST_VERSION]
    newest = max(readable or entries, key=_version_of)
    file = config.parent / newest.text.strip()
    if not file.is_file():
        raise DescriptionError(newest.location, f"'{file}' does not exist", "name a file of the model's folder")
    return file


def _version_of(entry: XmlNode) -> tuple[int, ...]:
    return version_numbers(entry.attributes.get("version", "0"))


def version_numbers(text: str) -> tuple[int, ...]:
    """Returns the numbers of a version, (1, 6) for "1.6"; parts that are not numbers are 0."""
    return tuple(int(part) if part.isdigit() else 0 for part in text.strip().split("."))


def folders_of(environment: Mapping[str, str], variable: str) -> tuple[Path, ...]:
    """Returns the folders in an environment variable."""
    return tuple(Path(entry).expanduser() for entry in environment.get(variable, "").split(os.pathsep) if entry)


def model_folders(first: Iterable[Path], environment: Mapping[str, str]) -> tuple[Path, ...]:
    """Returns the search path of models: the given folders, the folders in GAZEBO_MODEL_PATH, and ~/.gazebo/models.

    Args:
        first: Folders that are searched first.
        environment: Environment variables of the process.
    """
    home = Path(environment.get("HOME", "/")) / ".gazebo" / "models"
    return (*first, *folders_of(environment, MODEL_PATH), *([home] if home.is_dir() else []))
