# SPDX-License-Identifier: BSD-3-Clause
"""Lists the files that a world, a model or a robot description names, so that a changed file can be found."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.sdf_models import converted_version
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.visual_meshes import referenced_files
from modular_framework_simulation.models.xml_nodes import XmlNode, parse_xml, read_xml

SDF_SUFFIXES = (".world", ".sdf")
_SDF_TAGS = ("sdf", "gazebo")


def description_files(path: Path, resources: Resources) -> tuple[Path, ...]:
    """Returns a world or model file and all files that it names, directly or through included models.

    An included model adds its model.config, a mesh adds its images, and a material script adds all files in its
    folders. Unresolved references are skipped; the reader decides whether they are errors.

    Args:
        path: SDF file.
        resources: Folders and packages for included models, meshes and materials.
    """
    files: dict[Path, None] = {}
    _add_description(path, resources, files)
    return tuple(files)


def files_in_description(text: str, resources: Resources) -> tuple[Path, ...]:
    """Returns the files that a robot description (URDF) or model (SDF) refers to, found as in `description_files`.

    Args:
        text: URDF or SDF text.
        resources: Folders and packages for the references.
    """
    files: dict[Path, None] = {}
    try:
        _add_referenced_files(parse_xml(text, ""), resources, files)
    except DescriptionError:
        return ()
    return tuple(files)


def _add_description(path: Path, resources: Resources, files: dict[Path, None]) -> None:
    if path in files:  # also breaks include cycles
        return
    files[path] = None
    try:
        root = read_xml(path)
        if root.tag in _SDF_TAGS:
            converted_version(root)
    except DescriptionError:
        return
    _add_referenced_files(root, resources, files)


def _add_referenced_files(node: XmlNode, resources: Resources, files: dict[Path, None]) -> None:
    for child in node.children:
        try:
            if child.tag == "include":
                model = resources.model_file(child, child.require("uri").text.strip())
                _add_all([config for config in [model.parent / "model.config"] if config.is_file()], files)
                _add_description(model, resources, files)
            elif child.tag == "uri":
                path = resources.resolve(child, child.text.strip())
                _add_all(_material_files(path) if node.tag == "script" else _mesh_files(path), files)
            elif child.tag in ("mesh", "texture") and "filename" in child.attributes:
                _add_all(_mesh_files(resources.resolve(child, child.attributes["filename"])), files)
        except DescriptionError:
            continue
        _add_referenced_files(child, resources, files)


def _add_all(paths: Iterable[Path], files: dict[Path, None]) -> None:
    files.update(dict.fromkeys(path for path in paths if path.is_file()))


def _mesh_files(path: Path) -> list[Path]:
    return [path, *referenced_files(path)]


def _material_files(path: Path) -> list[Path]:
    """Returns the files of a material script's folder and of the folder of its images."""
    folder = path if path.is_dir() else path.parent
    return sorted([*folder.glob("*"), *(folder.parent / "textures").glob("*")])
