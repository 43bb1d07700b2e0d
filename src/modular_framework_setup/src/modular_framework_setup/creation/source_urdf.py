# SPDX-License-Identifier: BSD-3-Clause
"""Reads the source URDF of the packages and finds its mesh files."""

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
_REFERENCE = re.compile(r"^\s*(?:mtllib|map_\w+)\s+(?:-\S+\s+)*(\S+)\s*$|<init_from>\s*([^<]+?)\s*</init_from>", re.M)


@dataclass(frozen=True, slots=True)
class SourceUrdf:
    """A URDF whose mesh URIs refer to the new package.

    Attributes:
        root: Root element of the URDF.
        path: Path of the source file.
        copies: Files to copy, path in the new package -> source file.
    """

    root: Element
    path: Path
    copies: Mapping[str, Path]


def read_source(path: Path, arguments: Mapping[str, str], package: str) -> SourceUrdf:
    """Reads a URDF.

    Meshes in packages on ROS_PACKAGE_PATH stay in place. Meshes given by path or in unknown packages are searched for
    in the URDF's folder and its parents, and will be copied.

    Args:
        path: URDF or xacro file.
        arguments: Arguments of the xacro file.
        package: Name of the new package.

    Raises:
        CreationError: The URDF is invalid, or meshes are missing; the message names all of them.
    """
    faults = FaultList()
    with packages_beside(path.resolve().parent):
        document = read_document(path, arguments, faults)
        root = parse_document(document, faults) if document else None
        if root is None:
            raise CreationError("\n".join(map(str, faults.sorted_faults())))
        copies: dict[str, Path] = {}
        missing = [item.get("filename", "") for item in root.iter("mesh") if not _relocate(item, path, package, copies)]
    if missing:
        raise CreationError(
            f"{path}: {len(missing)} mesh files are not found: {', '.join(dict.fromkeys(missing))}; searched "
            "ROS_PACKAGE_PATH, the URDF's folder and its parents; put the files there"
        )
    for target, source in tuple(copies.items()):
        _add_references(target, source, copies)
    return SourceUrdf(root, path, copies)


def _relocate(mesh: Element, urdf: Path, package: str, copies: dict[str, Path]) -> bool:
    """Changes the URI of a mesh to the new package; returns whether the file was found.

    Args:
        mesh: Element of the mesh.
        urdf: Path of the URDF.
        package: Name of the new package.
        copies: Files to copy, extended by the mesh.
    """
    uri = mesh.get("filename", "")
    if uri.startswith("package://"):
        try:
            mesh_path(uri, find_package)
            return True
        except MeshError:
            pass
    relative = uri.partition("://")[2] if "://" in uri else uri
    source = _find_file(relative, urdf.resolve().parent)
    if source is None:
        return False
    subpath = "/".join(part for part in Path(relative).parts if part not in ("/", "..", ".", MESHES))
    target = f"{MESHES}/{subpath if not Path(relative).is_absolute() else source.name}"
    while target in copies and copies[target] != source:
        target = f"{MESHES}/{source.parent.name}/{target.removeprefix(f'{MESHES}/')}"
    copies[target] = source
    mesh.set("filename", f"package://{package}/{target}")
    return True


def _find_file(relative: str, folder: Path) -> Path | None:
    """Returns a file in a folder or its parents, by relative path with or without the first part (a package name)."""
    if Path(relative).is_absolute():
        return Path(relative) if Path(relative).is_file() else None
    without_package = relative.partition("/")[2]
    for parent in (folder, *folder.parents):
        for name in (relative, without_package):
            if name and (parent / name).is_file():
                return (parent / name).resolve()
    return None


def _add_references(target: str, source: Path, copies: dict[str, Path]) -> None:
    """Adds the existing materials and textures that a mesh file refers to."""
    if source.suffix.lower() not in (".obj", ".mtl", ".dae"):
        return
    for match in _REFERENCE.finditer(source.read_text(encoding="utf-8", errors="replace")):
        name = next(item for item in match.groups() if item)
        file = source.parent / name
        new_path = str(Path(target).parent / name)
        if ".." not in Path(name).parts and new_path not in copies and file.is_file():
            copies[new_path] = file
            _add_references(new_path, file, copies)
