# SPDX-License-Identifier: BSD-3-Clause
"""Finds the models and meshes that world and model files refer to by URI."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.xml_nodes import XmlNode, read_xml
from modular_framework_urdf.mesh_paths import PackageFinder


def no_packages(name: str) -> str:
    """Finds nothing: the lookup for an environment without ROS packages."""
    raise LookupError(f"package '{name}' cannot be looked up here")


@dataclass(frozen=True, slots=True)
class Resources:
    """The folders and packages that URIs refer to.

    Attributes:
        model_folders: Folders holding one folder a model, searched in order.
        find_package: Looks up ROS packages for package:// URIs.
    """

    model_folders: tuple[Path, ...] = ()
    find_package: PackageFinder = no_packages

    def resolve(self, node: XmlNode, uri: str) -> Path:
        """Returns the file or folder a URI stands for.

        Args:
            node: Element the URI was read from; relative paths start at its file.
            uri: model://, package://, file:// or a path.

        Raises:
            DescriptionError: The URI has another scheme or leads nowhere.
        """
        scheme, separator, rest = uri.partition("://")
        if not separator:
            candidates = [Path(uri) if Path(uri).is_absolute() else Path(node.source).parent / uri]
        elif scheme == "file":
            candidates = [Path(rest) if Path(rest).is_absolute() else Path(node.source).parent / rest]
        elif scheme == "model":
            candidates = [folder / rest for folder in self.model_folders]
        elif scheme == "package":
            candidates = [self._in_package(node, rest)]
        else:
            raise DescriptionError(
                node.where, f"got URI '{uri}'", "allowed: model://, package://, file:// or a path relative to the file"
            )
        for candidate in candidates:
            if candidate.exists():
                return candidate
        looked_in = ", ".join(str(candidate) for candidate in candidates) or "nowhere: no model folder is known"
        raise DescriptionError(node.where, f"'{uri}' does not exist", f"looked for {looked_in}; set gazebo_model_path")

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
        config = path / "model.config"
        if not config.is_file():
            fallback = path / "model.sdf"
            if fallback.is_file():
                return fallback
            raise DescriptionError(node.where, f"'{path}' holds no model", "a model folder needs a model.config")
        root = read_xml(config)
        entries = root.find_all("sdf")
        if not entries:
            raise DescriptionError(root.where, "names no <sdf> file", "add <sdf version='1.6'>model.sdf</sdf>")
        newest = max(entries, key=lambda entry: _version_key(entry.attributes.get("version", "0")))
        file = path / newest.text.strip()
        if not file.is_file():
            raise DescriptionError(newest.where, f"'{file}' does not exist", "name a file of the model's folder")
        return file


def _version_key(version: str) -> tuple[int, ...]:
    return tuple(int(part) if part.isdigit() else 0 for part in version.split("."))
