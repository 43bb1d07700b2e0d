# SPDX-License-Identifier: BSD-3-Clause
"""Versions and digests of the source trees of packages: what methods and nodes are made of."""

from __future__ import annotations

import functools
import hashlib
import importlib.util
from collections.abc import Iterator
from pathlib import Path

import rospkg

NO_SOURCES = {".git", "__pycache__", ".pytest_cache", ".mypy_cache", "tests"}


@functools.lru_cache(maxsize=256)
def package_source(package: str) -> tuple[str, str]:
    """Returns the version of a ROS package or Python module, and SHA-256 of its files; empty texts for neither."""
    folders, version = _module_folders(package), ""
    try:
        packages = rospkg.RosPack()
        folders = [Path(packages.get_path(package)), *folders]
        version = str(packages.get_manifest(package).version or "")
    except rospkg.ResourceNotFound:
        pass
    outer = [folder for folder in folders if not any(other in folder.parents for other in folders)]
    return (version, tree_digest(outer)) if outer else ("", "")


def _module_folders(name: str) -> list[Path]:
    """Returns where the Python module of a package is: in an install space not in the package's folder."""
    try:
        found = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return []
    # the modules that catkin makes in the devel space lead to the sources
    return [Path(path) for path in (found.submodule_search_locations or ()) if "devel" not in path] if found else []


def tree_digest(folders: list[Path]) -> str:
    """Returns SHA-256 of the files below folders, by their relative paths; caches and tests do not count."""
    digest = hashlib.sha256()
    for folder in dict.fromkeys(folders):
        for path in sorted(_files(folder)):
            digest.update(f"{path.relative_to(folder)}\0".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _files(folder: Path) -> Iterator[Path]:
    for path in folder.rglob("*"):
        if path.is_file() and not NO_SOURCES.intersection(path.relative_to(folder).parts) and path.suffix != ".pyc":
            yield path
