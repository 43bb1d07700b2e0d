# SPDX-License-Identifier: BSD-3-Clause
"""Digests of the software and files of an experiment's episodes, which an extension of the experiment must reproduce.

The digests of a launch file cover its parameters, the files given to its nodes, and the packages of its nodes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from importlib import metadata
from pathlib import Path

from modular_framework_benchmark.episodes.ros_package_sources import package_source, tree_digest
from modular_framework_benchmark.episodes.ros_stack_launch import StackPreview, preview_stack
from modular_framework_benchmark.episodes.snapshot import PACKAGES
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.records.episode import EpisodeSpec

FOLDERS = ("states_directory", "templates_directory")
"""Launch arguments that name a folder of the user's code."""
LIBRARIES = tuple(
    f"modular_framework_{name}"
    for name in ("benchmark", "control", "core", "planning", "ros", "simulation", "states", "urdf")
)


def run_digests(episodes: Iterable[EpisodeSpec]) -> dict[str, str]:
    """Returns the digests of all software and files, keyed by description; several digests are separated by spaces.

    Args:
        episodes: Episodes of the experiment.

    Raises:
        SettingsError: A launch file is invalid.
    """
    found: dict[str, set[str]] = {f"Python package {name}": {_python_version(name)} for name in PACKAGES}
    packages, stacks = set(LIBRARIES), dict[int, StackPreview]()
    for settings in (spec.settings for spec in episodes):
        packages |= settings.packages
        if isinstance(settings, TaskSettings):
            stack = preview_stack(settings)
            stacks[id(stack)] = stack
    for stack in stacks.values():
        packages |= {node.package for node in stack.preview.nodes}
        for description, digest in _launch_digests(stack):
            found.setdefault(description, set()).add(digest[:16])
    for package in packages:
        found[f"package {package}"] = {package_source(package)[1][:16]}
    return {description: " ".join(sorted(digests)) for description, digests in sorted(found.items())}


def _python_version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "none"


def _launch_digests(stack: StackPreview) -> Iterator[tuple[str, str]]:
    texts = [str(stack.launch.arguments[name]) for name in sorted(stack.launch.arguments)]
    for name, value in stack.preview.parameters.items():
        yield f"parameter {name}", _digest(json.dumps(value, sort_keys=True, default=str))
        texts.append(str(value))
    arguments = {
        argument for text in (*texts, *(node.arguments for node in stack.preview.nodes)) for argument in text.split()
    }
    for file in sorted(Path(argument) for argument in arguments if argument.startswith("/") and len(argument) < 1024):
        if file.is_file():
            yield f"file {file.parent.name}/{file.name}", hashlib.sha256(file.read_bytes()).hexdigest()
    for name in FOLDERS:
        folder = str(stack.launch.arguments.get(name, ""))
        if folder and Path(folder).is_dir():
            yield f"folder {name}", tree_digest([Path(folder)])


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
