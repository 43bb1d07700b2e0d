# SPDX-License-Identifier: BSD-3-Clause
"""Digests of the software and files of an experiment's episodes, which an extension of the experiment must reproduce.

The digests of a launch file cover its parameters, the packages of its nodes and plugins, and the files that arguments,
parameters and nodes name by path, or by package and name.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import rospkg

from modular_framework_benchmark.episodes.ros_external_methods import command_files, command_words, folder_digest
from modular_framework_benchmark.episodes.ros_file_digests import (
    file_digest,
    files_with_named,
    joint_digest,
    model_resources,
    portable_name,
    robot_digests,
    robot_files,
    world_files,
)
from modular_framework_benchmark.episodes.ros_package_sources import package_source, tree_digest, tree_files
from modular_framework_benchmark.episodes.ros_running_stack import DESCRIPTION_PARAMETERS, WORLD
from modular_framework_benchmark.episodes.ros_stack_launch import StackPreview, preview_stack
from modular_framework_benchmark.episodes.snapshot import RECORDED_PACKAGES, package_version
from modular_framework_benchmark.experiments.grasps_mode import GraspSettings
from modular_framework_benchmark.experiments.metric_choices import metric_files
from modular_framework_benchmark.experiments.planning_mode import PlanningSettings
from modular_framework_benchmark.experiments.robot_setting import ModelSettings, RobotSource
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_benchmark.modes.ros_robots import load_robot
from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.episode_settings import EpisodeSettings
from modular_framework_benchmark.records.level_digests import FILE_PREFIX, combination_key, digests_text
from modular_framework_core.files.model_files import model_file
from modular_framework_core.launching.ros_launch_preview import leaves
from modular_framework_core.task_constructor.known_names import MODEL_PATH
from modular_framework_core.task_constructor.machine_files import task_texts

DATASET_INFO = "meta/info.json"
"""File of a LeRobot dataset that describes its episodes."""
FOLDER_PARAMETERS = ("states_directory", "templates_directory")
"""Launch arguments that name folders of the user's code."""
LIBRARY_PACKAGES = tuple(
    f"modular_framework_{name}"
    for name in ("benchmark", "control", "core", "planning", "ros", "simulation", "states", "urdf")
)
MAX_TEXT_LENGTH = 1024
"""Maximum length of a parameter that may name a file or package; longer parameters are documents."""

Digests = Iterator[tuple[str, str]]
"""Descriptions with digests."""


def run_digests(episodes: Iterable[EpisodeSpec]) -> dict[str, str]:
    """Returns the digests of all software and files, keyed by description; see `records.level_digests`.

    Args:
        episodes: Episodes of the experiment.

    Raises:
        SettingsError: A launch file is invalid.
    """
    sources: dict[str, tuple[Callable[[], Digests], set[str]]] = {}
    combinations: set[str] = set()
    for spec in episodes:
        combination = combination_key(spec.configuration)
        combinations.add(combination)
        for key, digests in _sources(spec.settings):
            sources.setdefault(key, (digests, set()))[1].add(combination)
    digests_of_level: dict[str, dict[str, set[str]]] = {}
    for digests, users in sources.values():
        for description, digest in digests():
            by_combination = digests_of_level.setdefault(description, {key: set() for key in combinations})
            for key in users:
                by_combination[key].add(digest[:16])
    return {description: digests_text(digests) for description, digests in sorted(digests_of_level.items())}


def _sources(settings: EpisodeSettings) -> Iterator[tuple[str, Callable[[], Digests]]]:
    """Yields functions that compute digests of what an episode uses, each with a key: equal keys have equal digests."""
    yield "libraries", _library_digests
    for package in settings.packages:
        yield f"package {package}", functools.partial(_package_digests, package)
    files = [*settings.files, *metric_files(settings.metrics)]
    if isinstance(settings, PlanningSettings):
        files += [Path(settings.problem.scene), Path(settings.problem.request), *_named_files(settings.parameters)]
    if isinstance(settings, GraspSettings):
        files += _named_files(settings.method_parameters)
    for command in _commands(settings):
        yield f"command {command}", functools.partial(_command_digests, command)
    for file in files:
        yield f"file {file}", functools.partial(_file_digests, file, "")
    if isinstance(settings, ModelSettings):
        yield f"robot {settings.robot}", functools.partial(_robot_digests, settings.robot)
    model_path = ""
    if isinstance(settings, TaskSettings):
        stack = preview_stack(settings)
        model_path = str(stack.preview.parameters.get(MODEL_PATH, ""))
        changed = json.dumps(settings.parameters, sort_keys=True, default=str)
        yield f"stack {id(stack)} {changed}", functools.partial(_stack_digests, stack, settings.parameters)
    if isinstance(settings, TaskSettings | GraspSettings):
        for placed in settings.objects:
            file = model_file(placed.model, model_path)
            yield f"model {file}", functools.partial(_file_digests, file, model_path)


def _library_digests() -> Digests:
    for name in RECORDED_PACKAGES:
        yield f"Python package {name}", package_version(name) or "none"
    for name in LIBRARY_PACKAGES:
        yield from _package_digests(name)


def _package_digests(package: str) -> Digests:
    yield f"package {package}", package_source(package)[1]


def _file_digests(file: Path, model_path: str) -> Digests:
    """Yields the digests of a file and of the files that it names; nothing if the file does not exist."""
    if file.is_file():
        yield from _digests_of(files_with_named(file, model_resources(model_path)))


def _commands(settings: EpisodeSettings) -> list[tuple[str, ...]]:
    """Returns the commands of external methods and planners, and the texts in a task, such as commands of policies."""
    if isinstance(settings, TaskSettings):
        return [words for file in settings.files for words in task_texts(file) if words]
    parameters: Mapping[str, Any] = {}
    if isinstance(settings, PlanningSettings):
        parameters = leaves(dict(settings.parameters))
    if isinstance(settings, GraspSettings):
        parameters = settings.method_parameters
    return [command_words(value) for name, value in parameters.items() if name.rpartition("/")[2] == "command"]


def _command_digests(command: Iterable[str]) -> Digests:
    """Yields the digests of the files in a command, of the Python files beside each, and of a replayed dataset."""
    words = tuple(command)
    for folder in (Path(os.path.expanduser(word)) for word in words):
        if folder.is_absolute() and (folder / DATASET_INFO).is_file():
            files = [folder / DATASET_INFO, *sorted(folder.glob("data/*/*.parquet"))]
            yield f"dataset {portable_name(folder)}", joint_digest(files)
    for file in command_files(words):
        yield f"{FILE_PREFIX}{portable_name(file)}", file_digest(file)
        if file.parent.name != "bin":
            yield f"folder of {portable_name(file)}", folder_digest(file)


def _digests_of(files: Iterable[Path]) -> Digests:
    for file in files:
        yield f"{FILE_PREFIX}{portable_name(file)}", file_digest(file)


def _robot_digests(source: RobotSource) -> Digests:
    try:
        robot = load_robot(source)
    except ModeError:  # every episode will be broken, with this error as its cause
        return
    urdf, srdf, *_ = robot.model.source
    yield from robot_digests(urdf, srdf, robot.mesh_folder).items()
    yield from _digests_of(robot_files(urdf, robot.mesh_folder))


def _stack_digests(stack: StackPreview, changed: Mapping[str, Any]) -> Digests:
    """Yields the digests of a launch.

    Args:
        stack: Launch with its parameters and nodes.
        changed: Parameters that override the parameters of the launch.
    """
    for name, value in stack.preview.parameters.items():
        yield f"parameter {name}", _digest(json.dumps(value, sort_keys=True, default=str))
    parameters = stack.preview.with_parameters(changed).parameters
    texts = [
        *(node.arguments for node in stack.preview.nodes),
        *(text for value in (stack.launch.arguments, *parameters.values()) for text in _path_texts(value)),
    ]
    resources = model_resources(str(parameters.get(MODEL_PATH, "")))
    named = _NamedContent()
    for text in texts:
        named.add(text)
    files = [path for file in named.files for path in files_with_named(file, resources)]
    files += [
        *world_files(str(parameters.get(WORLD, "")), resources),
        *robot_files(str(parameters.get(DESCRIPTION_PARAMETERS[0], ""))),
    ]
    yield from _digests_of(dict.fromkeys(files))
    for package in {node.package for node in stack.preview.nodes} | named.packages:
        yield from _package_digests(package)
    for name, value in parameters.items():
        if name.rpartition("/")[2] == "command":
            yield from _command_digests(command_words(value))
    for name in FOLDER_PARAMETERS:
        folders = [Path(entry) for entry in str(stack.launch.arguments.get(name, "")).split(os.pathsep) if entry]
        if folders:
            yield f"folder {name}", tree_digest([folder for folder in folders if folder.is_dir()])


def _named_files(parameters: Mapping[str, Any]) -> list[Path]:
    """Returns the existing files that parameters name by path, such as the program of a method."""
    return [Path(text) for text in _path_texts(parameters) if text.startswith("/") and Path(text).is_file()]


def _path_texts(value: Any) -> Iterator[str]:
    """Yields the texts in a parameter that may name files or packages."""
    if isinstance(value, Mapping | list | tuple):
        for inner in value.values() if isinstance(value, Mapping) else value:
            yield from _path_texts(inner)
    elif isinstance(value, str) and len(value) < MAX_TEXT_LENGTH:
        yield value


class _NamedContent:
    """Files and packages that texts name.

    Attributes:
        files: Existing files: named by path, as PACKAGE/NAME, or as PACKAGE and later NAME.
        packages: Packages that are named without a file, such as the package of a plugin class.
    """

    def __init__(self) -> None:
        self.files: dict[Path, None] = {}
        self.packages: set[str] = set()

    def add(self, text: str) -> None:
        """Adds the files and packages that a text names, such as the arguments of a node."""
        package = ""
        for word in text.split():
            first, _, rest = word.partition("/")
            if word.startswith("/"):
                self._add_files([Path(word)] if Path(word).is_file() else [])
            elif not rest and word in package_folders():
                package = word
            elif rest and first in package_folders():
                if not self._add_files(files_in_package(first, rest)):
                    self.packages.add(first)
            elif package:
                self._add_files(files_in_package(package, word))

    def _add_files(self, files: Iterable[Path]) -> bool:
        new_files = dict.fromkeys(files)
        self.files.update(new_files)
        return bool(new_files)


@functools.cache
def package_folders() -> Mapping[str, Path]:
    """Returns the folders of all packages, by name."""
    packages = rospkg.RosPack()
    return {name: Path(packages.get_path(name)) for name in packages.list()}


@functools.lru_cache(maxsize=256)
def files_in_package(package: str, name: str) -> list[Path]:
    """Returns the files of a package whose path ends with a relative name, in any folder of the package."""
    parts = Path(name).parts
    if not Path(name).suffix:
        return []
    return sorted(file for file in tree_files(package_folders()[package]) if file.parts[-len(parts) :] == parts)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
