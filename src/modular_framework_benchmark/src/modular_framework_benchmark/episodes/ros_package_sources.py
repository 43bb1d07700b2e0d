# SPDX-License-Identifier: BSD-3-Clause
"""Versions and digests of the sources of packages, which identify methods and nodes."""

from __future__ import annotations

import functools
import hashlib
import importlib.util
from collections.abc import Iterator
from pathlib import Path

import rospkg

from modular_framework_benchmark.episodes.ros_file_digests import file_digest

EXCLUDED_NAMES = {".git", "__pycache__", ".pytest_cache", ".mypy_cache", "tests"}


@functools.lru_cache(maxsize=256)
def package_source(package: str) -> tuple[str, str]:
    """Returns the version of a ROS package or Python module and the SHA-256 of its files; empty texts if unknown."""
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
    """Returns the folders of a Python module, which an install space keeps outside the ROS package's folder."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return []
    # Modules in the devel space only forward to the sources.
    return [Path(path) for path in (spec.submodule_search_locations or ()) if "devel" not in path] if spec else []


def tree_digest(folders: list[Path]) -> str:
    """Returns the SHA-256 of the files in folders, keyed by relative path; caches and tests are excluded."""
    digest = hashlib.sha256()
    for folder in dict.fromkeys(folders):
        for path in sorted(tree_files(folder)):
            digest.update(f"{path.relative_to(folder)}\0{file_digest(path)}\n".encode())
    return digest.hexdigest()


def tree_files(folder: Path) -> Iterator[Path]:
    """Yields the files in a folder and its subfolders, without caches and tests."""
    for path in folder.rglob("*"):
        if path.is_file() and not EXCLUDED_NAMES.intersection(path.relative_to(folder).parts) and path.suffix != ".pyc":
            yield path
