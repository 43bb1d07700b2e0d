# SPDX-License-Identifier: BSD-3-Clause
"""Finds the models and meshes that world and model files refer to by URI."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.xml_nodes import XmlNode, read_xml
from modular_framework_urdf.mesh_paths import PackageFinder

MODEL_PATH, RESOURCE_PATH = "GAZEBO_MODEL_PATH", "GAZEBO_RESOURCE_PATH"
"""Environment variables with folders, separated by colons, as Gazebo reads them."""

_MOST_NAMED = 4
"""Folders that a message names."""

NEWEST_VERSION = (1, 11)
OLDEST_VERSION = (1, 0)


def no_packages(name: str) -> str:
    """Finds nothing: the lookup for an environment without ROS packages."""
    raise LookupError(f"package '{name}' cannot be looked up here")


@dataclass(frozen=True, slots=True)
class Resources:
    """The folders and packages that URIs refer to.

    Attributes:
        model_folders: Folders holding one folder a model, searched in order.
        find_package: Looks up ROS packages for package:// URIs.
        resource_folders: Folders that relative file:// URIs start at, beside that of the file they stand in.
    """

    model_folders: tuple[Path, ...] = ()
    find_package: PackageFinder = no_packages
    resource_folders: tuple[Path, ...] = ()

    def resolve(self, node: XmlNode, uri: str) -> Path:
        """Returns the file or folder a URI stands for.

        Args:
            node: Element the URI was read from; relative paths start at its file.
            uri: model://, package://, file:// or a path; of a model of Gazebo Fuel the name counts.

        Raises:
            DescriptionError: The URI has another scheme or leads nowhere.
        """
        scheme, separator, rest = uri.partition("://")
        if not separator:
            candidates = self._relative(node, uri)
        elif scheme == "file":
            candidates = self._relative(node, rest)
        elif scheme == "model":
            rest = rest.lstrip("/")
            candidates = [folder / rest for folder in self.model_folders]
        elif scheme == "package":
            candidates = [self._in_package(node, rest)]
        elif scheme in ("http", "https") and "/models/" in rest:
            candidates = self._downloaded(rest)
        else:
            raise DescriptionError(
                node.where, f"got URI '{uri}'", "allowed: model://, package://, file:// or a path relative to the file"
            )
        for candidate in candidates:
            if (rest if separator else uri) and candidate.exists():
                return candidate
        looked_in = ", ".join(str(candidate) for candidate in candidates[:_MOST_NAMED])
        if len(candidates) > _MOST_NAMED:
            looked_in += f" and in {len(candidates) - _MOST_NAMED} more folders"
        looked_in = looked_in or "nowhere: no model folder is known"
        ways = f"set gazebo_model_path or {MODEL_PATH}"
        raise DescriptionError(node.where, f"'{uri}' does not exist", f"looked for {looked_in}; {ways}")

    def _downloaded(self, address: str) -> list[Path]:
        """Returns where a model of Gazebo Fuel may be: nothing is fetched, a model of its name has to be there."""
        name = unquote(address.partition("/models/")[2]).split("/")[0]
        names = dict.fromkeys((name, name.lower().replace(" ", "_")))
        return [folder / each for folder in self.model_folders for each in names]

    def _relative(self, node: XmlNode, path: str) -> list[Path]:
        if Path(path).is_absolute():
            return [Path(path)]
        return [folder / path for folder in (Path(node.source).parent, *self.resource_folders)]

    def _in_package(self, node: XmlNode, rest: str) -> Path:
        package, _, relative = rest.partition("/")
        try:
            return Path(self.find_package(package)) / relative
        except Exception as error:  # the finder is the caller's: whatever it raises means "not there"
            raise DescriptionError(node.where, f"package '{package}' is not found ({error})", "install it") from error

    def model_file(self, node: XmlNode, uri: str) -> Path:
        """Returns the SDF file of an included model: a file itself, or what the folder's model.config names.

        Raises:
            DescriptionError: There is no such model or its model.config names no file that exists.
        """
        path = self.resolve(node, uri)
        if path.is_file():
            return path
        if not (path / "model.config").is_file() and not (path / "model.sdf").is_file():
            raise DescriptionError(node.where, f"'{path}' holds no model", "a model folder needs a model.config")
        return model_file(path)


def model_file(folder: Path) -> Path:
    """Returns the SDF file of a model's folder: what its model.config names, or model.sdf without one.

    Raises:
        DescriptionError: The model.config names no file that exists.
    """
    config, usual = folder / "model.config", folder / "model.sdf"
    if not config.is_file():
        return usual
    try:
        root = read_xml(config)
    except DescriptionError:
        if usual.is_file():  # an author's address in brackets is the usual fault, and of no account
            return usual
        raise
    return _newest_file(config, root)


def _newest_file(config: Path, root: XmlNode) -> Path:
    """Returns the file of the newest version of SDF that is read here, of those a model.config names."""
    entries = root.find_all("sdf")
    if not entries:
        raise DescriptionError(root.where, "names no <sdf> file", "add <sdf version='1.6'>model.sdf</sdf>")
    readable = [entry for entry in entries if _version_of(entry) <= NEWEST_VERSION]
    newest = max(readable or entries, key=_version_of)
    file = config.parent / newest.text.strip()
    if not file.is_file():
        raise DescriptionError(newest.where, f"'{file}' does not exist", "name a file of the model's folder")
    return file


def _version_of(entry: XmlNode) -> tuple[int, ...]:
    return version_numbers(entry.attributes.get("version", "0"))


def version_numbers(text: str) -> tuple[int, ...]:
    """Returns "1.6" as (1, 6); what is no number counts as 0."""
    return tuple(int(part) if part.isdigit() else 0 for part in text.strip().split("."))


def folders_of(environment: Mapping[str, str], variable: str) -> tuple[Path, ...]:
    """Returns the folders an environment variable lists."""
    return tuple(Path(entry).expanduser() for entry in environment.get(variable, "").split(os.pathsep) if entry)


def model_folders(first: Iterable[Path], environment: Mapping[str, str]) -> tuple[Path, ...]:
    """Returns where models are looked for: given folders, those of GAZEBO_MODEL_PATH, and ~/.gazebo/models.

    Args:
        first: Folders that come before.
        environment: Of the process.
    """
    home = Path(environment.get("HOME", "/")) / ".gazebo" / "models"
    return (*first, *folders_of(environment, MODEL_PATH), *([home] if home.is_dir() else []))
