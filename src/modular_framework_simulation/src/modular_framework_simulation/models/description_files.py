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

    Included models count with their model.config, meshes with their images, and material scripts with all files of
    their folders. References that lead nowhere are skipped, because only the reader decides whether they are faults.

    Args:
        path: SDF file.
        resources: Folders and packages for included models, meshes and materials.
    """
    found: dict[Path, None] = {}
    _add_description(path, resources, found)
    return tuple(found)


def files_in_description(text: str, resources: Resources) -> tuple[Path, ...]:
    """Returns the files that the text of a robot description (URDF) or model (SDF) names, as `description_files`.

    Args:
        text: URDF or SDF text.
        resources: Folders and packages for the references.
    """
    found: dict[Path, None] = {}
    try:
        _add_named(parse_xml(text, ""), resources, found)
    except DescriptionError:
        return ()
    return tuple(found)


def _add_description(path: Path, resources: Resources, found: dict[Path, None]) -> None:
    if path in found:  # also ends circles of includes
        return
    found[path] = None
    try:
        root = read_xml(path)
        if root.tag in _SDF_TAGS:
            converted_version(root)
    except DescriptionError:
        return
    _add_named(root, resources, found)


def _add_named(node: XmlNode, resources: Resources, found: dict[Path, None]) -> None:
    for child in node.children:
        try:
            if child.tag == "include":
                model = resources.model_file(child, child.require("uri").text.strip())
                _add_all([config for config in [model.parent / "model.config"] if config.is_file()], found)
                _add_description(model, resources, found)
            elif child.tag == "uri":
                path = resources.resolve(child, child.text.strip())
                _add_all(_material_files(path) if node.tag == "script" else _mesh_files(path), found)
            elif child.tag in ("mesh", "texture") and "filename" in child.attributes:
                _add_all(_mesh_files(resources.resolve(child, child.attributes["filename"])), found)
        except DescriptionError:
            continue
        _add_named(child, resources, found)


def _add_all(paths: Iterable[Path], found: dict[Path, None]) -> None:
    found.update(dict.fromkeys(path for path in paths if path.is_file()))


def _mesh_files(path: Path) -> list[Path]:
    return [path, *referenced_files(path)]


def _material_files(path: Path) -> list[Path]:
    """Returns the files of a material script's folder and of the folder of its images."""
    folder = path if path.is_dir() else path.parent
    return sorted([*folder.glob("*"), *(folder.parent / "textures").glob("*")])
