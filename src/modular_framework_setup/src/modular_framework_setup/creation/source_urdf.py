# SPDX-License-Identifier: BSD-3-Clause
"""Reads the URDF that packages are made from, and finds its mesh files wherever the URDF's author kept them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from modular_framework_core.files.faults import FaultList
from modular_framework_setup.config_files.config_package import find_package, packages_beside
from modular_framework_setup.config_files.description_files import parse_document, read_document
from modular_framework_setup.errors import CreationError
from modular_framework_urdf.mesh_paths import mesh_path
from modular_framework_urdf.mesh_reader import MeshError
from modular_framework_urdf.xml_text import Element

MESHES = "meshes"
_MENTIONED = re.compile(r"^\s*(?:mtllib|map_\w+)\s+(?:-\S+\s+)*(\S+)\s*$|<init_from>\s*([^<]+?)\s*</init_from>", re.M)


@dataclass(frozen=True, slots=True)
class SourceUrdf:
    """A URDF whose meshes are called as in the package that is to be made.

    Attributes:
        root: of the document.
        path: where it was read.
        copies: files to copy: path in the new package, and where the file is now.
    """

    root: Element
    path: Path
    copies: Mapping[str, Path]


def read_source(path: Path, arguments: Mapping[str, str], package: str) -> SourceUrdf:
    """Reads a URDF.

    Meshes of packages on ROS_PACKAGE_PATH stay where they are. Others, named by a path or by a package that is not
    there, are looked for in the folder of the URDF and those above it, and will be copied.

    Args:
        path: of the URDF, which may be xacro.
        arguments: of the xacro file.
        package: name of the package to be made.

    Raises:
        CreationError: it cannot be read, or meshes are not found; names all of them.
    """
    faults = FaultList()
    with packages_beside(path.resolve().parent):
        document = read_document(path, arguments, faults)
        root = parse_document(document, faults) if document else None
        if root is None:
            raise CreationError("\n".join(map(str, faults.sorted())))
        copies: dict[str, Path] = {}
        missing = [item.get("filename", "") for item in root.iter("mesh") if not _adopt(item, path, package, copies)]
    if missing:
        raise CreationError(
            f"{path}: {len(missing)} mesh files are not found: {', '.join(dict.fromkeys(missing))}; looked for as they "
            "are named, on ROS_PACKAGE_PATH and in the folders from the URDF's upwards; put them there"
        )
    for target, source in tuple(copies.items()):
        _add_mentioned(target, source, copies)
    return SourceUrdf(root, path, copies)


def _adopt(mesh: Element, urdf: Path, package: str, copies: dict[str, Path]) -> bool:
    """Names a mesh as in the new package; returns whether it was found."""
    uri = mesh.get("filename", "")
    if uri.startswith("package://"):
        try:
            mesh_path(uri, find_package)
            return True
        except MeshError:
            pass
    relative = uri.partition("://")[2] if "://" in uri else uri
    source = _look_for(relative, urdf.resolve().parent)
    if source is None:
        return False
    short = "/".join(part for part in Path(relative).parts if part not in ("/", "..", ".", MESHES))
    target = f"{MESHES}/{short if not Path(relative).is_absolute() else source.name}"
    while target in copies and copies[target] != source:
        target = f"{MESHES}/{source.parent.name}/{target.removeprefix(f'{MESHES}/')}"
    copies[target] = source
    mesh.set("filename", f"package://{package}/{target}")
    return True


def _look_for(relative: str, folder: Path) -> Path | None:
    """Returns the file of a name in a folder or one above it, also without the first part (a package's name)."""
    if Path(relative).is_absolute():
        return Path(relative) if Path(relative).is_file() else None
    shorter = relative.partition("/")[2]
    for place in (folder, *folder.parents):
        for name in (relative, shorter):
            if name and (place / name).is_file():
                return (place / name).resolve()
    return None


def _add_mentioned(target: str, source: Path, copies: dict[str, Path]) -> None:
    """Adds the materials and pictures that a mesh file mentions and that are there."""
    if source.suffix.lower() not in (".obj", ".mtl", ".dae"):
        return
    for match in _MENTIONED.finditer(source.read_text(encoding="utf-8", errors="replace")):
        name = next(item for item in match.groups() if item)
        file = source.parent / name
        beside = str(Path(target).parent / name)
        if ".." not in Path(name).parts and beside not in copies and file.is_file():
            copies[beside] = file
            _add_mentioned(beside, file, copies)
