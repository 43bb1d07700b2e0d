# SPDX-License-Identifier: BSD-3-Clause
"""Digests of files, and of the files that worlds, models and robot descriptions name.

The digest of a file is computed once per process until the file changes.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.gazebo_ros.world_files import find_world_file
from modular_framework_simulation.models.description_files import SDF_SUFFIXES, description_files, files_in_description
from modular_framework_simulation.models.model_search import ros_resources
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_urdf.mesh_paths import PackageFinder

model_resources = functools.lru_cache(maxsize=16)(ros_resources)
"""Cached search paths of models, by the value of `/gazebo_model_path`."""


def file_digest(path: Path) -> str:
    """Returns the SHA-256 of a file, hexadecimal."""
    status = path.stat()
    return _file_digest(path, status.st_mtime_ns, status.st_ctime_ns, status.st_size)


@functools.lru_cache(maxsize=65536)
def _file_digest(path: Path, *_status: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def portable_name(path: Path) -> str:
    """Returns the last two parts of a path, which do not depend on the machine."""
    return f"{path.parent.name}/{path.name}"


def joint_digest(paths: Iterable[Path]) -> str:
    """Returns the SHA-256 of files with their portable names, hexadecimal; "" without files."""
    lines = sorted(f"{portable_name(path)} {file_digest(path)}" for path in paths)
    return hashlib.sha256("\n".join(lines).encode()).hexdigest() if lines else ""


def files_with_named(path: Path, resources: Resources) -> tuple[Path, ...]:
    """Returns a file, and for a world or model also the files that it names.

    Args:
        path: Existing file.
        resources: Search paths of models.
    """
    return description_files(path, resources) if path.suffix in SDF_SUFFIXES else (path,)


def world_files(name: str, resources: Resources) -> tuple[Path, ...]:
    """Returns a world file and the files that it names; nothing if the file does not exist.

    Args:
        name: Path of the world file, which may be relative to a resource folder.
        resources: Search paths of models.
    """
    try:
        return description_files(find_world_file(name, resources.resource_folders), resources)
    except DescriptionError:
        return ()


@functools.lru_cache(maxsize=64)
def robot_digests(urdf: str, srdf: str, folder: Path | None = None) -> Mapping[str, str]:
    """Returns the SHA-256 of a robot's descriptions and of its meshes, keyed by description.

    Args:
        urdf: Robot description; may be empty.
        srdf: Semantic description; may be empty.
        folder: Folder of the meshes of packages that do not exist; None for no such meshes.
    """
    texts = {"robot description": urdf, "semantic description": srdf}
    digests = {description: hashlib.sha256(text.encode()).hexdigest() for description, text in texts.items() if text}
    meshes = joint_digest(robot_files(urdf, folder))
    return digests | ({"robot meshes": meshes} if meshes else {})


@functools.lru_cache(maxsize=64)
def robot_files(urdf: str, folder: Path | None = None) -> tuple[Path, ...]:
    """Returns the meshes that a robot description names, with their images.

    Args:
        urdf: Robot description; may be empty.
        folder: Folder of the meshes of packages that do not exist; None for no such meshes.
    """
    resources = model_resources("")
    installed = files_in_description(urdf, resources) if urdf else ()
    if folder is None:
        return installed
    finders: tuple[PackageFinder, ...] = (lambda name: str(folder / name), lambda _: str(folder))
    beside = (files_in_description(urdf, Resources(find_package=find)) for find in finders)
    return tuple(dict.fromkeys([*installed, *(path for paths in beside for path in paths)]))
