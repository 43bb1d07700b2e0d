# SPDX-License-Identifier: BSD-3-Clause
"""Looks up the references of an experiment file in the ROS packages."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path

import roslaunch.core
import roslaunch.substitution_args
import rospkg

from modular_framework_benchmark.experiments.model_sizes import listed_lines, movable_joints
from modular_framework_benchmark.experiments.resource_lookup import UnreadableWorld, UnresolvedReference
from modular_framework_core.files.default_folders import API_PACKAGE, SCRIPTS_FOLDER, model_search_path
from modular_framework_core.files.model_files import model_file
from modular_framework_core.launching.launch_arguments import (
    ArgumentError,
    argument_values,
    check_arguments,
    known_arguments,
)
from modular_framework_core.launching.launch_values import file_faults
from modular_framework_ros.allowed_names import listing, nearest
from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.model_search import ros_resources
from modular_framework_simulation.models.sdf_reader import read_world


class RosResourceLookup:
    """Lookup through ROS_PACKAGE_PATH; implements `ResourceLookup`."""

    def __init__(self) -> None:
        self._packages = rospkg.RosPack()

    def package(self, name: str) -> Path:
        """Returns the folder of a package."""
        try:
            return Path(self._packages.get_path(name))
        except rospkg.ResourceNotFound as error:
            hint = nearest(name, self._packages.list())
            raise UnresolvedReference(
                f"there is no package '{name}'{hint}; build and source the workspace that has it, or correct the name"
            ) from error

    def launch_file(self, name: str) -> Path:
        """Returns the path of a launch file from PACKAGE/FILE or an absolute path."""
        if name.startswith("/"):
            if Path(name).is_file():
                return Path(name)
            raise UnresolvedReference(f"there is no launch file {name}; allowed: PACKAGE/FILE, or a path from /")
        package, _, file = name.partition("/")
        if not file:
            raise UnresolvedReference(
                f"'{name}' is not a launch file; allowed: PACKAGE/FILE such as {API_PACKAGE}/start_framework.launch"
            )
        folder = self.package(package) / "launch"
        if (folder / file).is_file():
            return folder / file
        files = sorted(path.name for path in folder.glob("*.launch"))
        raise UnresolvedReference(
            f"package {package} has no launch file '{file}'; {listing(files, 'it has none')}{nearest(file, files)}"
        )

    def launch_arguments(self, launch: str) -> Mapping[str, str | None]:
        """Returns the arguments of a launch file with their defaults."""
        return _arguments_of_file(str(self.launch_file(launch)))

    def launch_faults(self, launch: str, arguments: Mapping[str, str]) -> Sequence[str]:
        """Returns the errors in the values of launch arguments."""
        path = str(self.launch_file(launch))
        return _argument_faults(path, tuple(f"{name}:={value}" for name, value in arguments.items()))

    def task(self, name: str, folder: Path) -> str:
        """Returns the path of a task of the API package or of the user."""
        path = (folder / Path(name).expanduser()).resolve()
        if path.is_file():
            return str(path)
        scripts = self.package(API_PACKAGE) / SCRIPTS_FOLDER
        if name == Path(name).name and (scripts / name).is_file():
            return str(scripts / name)
        tasks = sorted(script.name for script in scripts.glob("*.yaml"))
        raise UnresolvedReference(
            f"there is no task '{name}'; {listing(tasks)}, or the path of a file{nearest(name, tasks)}"
        )

    def model(self, name: str, launch: str, arguments: Mapping[str, str], folder: Path) -> Path:
        """Returns the SDF file of a model.

        Args:
            name: Name of a model in the search path of models, or path of an .sdf file.
            launch: Launch file that names the description package.
            arguments: Arguments of the launch file.
            folder: Base of relative paths.
        """
        if "/" in name or name.endswith(".sdf"):
            path = (folder / Path(name).expanduser()).resolve()
            if path.is_file():
                return path
            raise UnresolvedReference(f"there is no model file {path}; give the path of an .sdf file")
        folders = model_search_path(self._description(launch, arguments) / "models")
        found = model_file(name, os.pathsep.join(map(str, folders)))
        if found.is_file():
            return found
        model_names = sorted(file.parent.name for folder in folders for file in folder.glob("*/model.sdf"))
        raise UnresolvedReference(f"there is no model '{name}'; {listing(model_names)}{nearest(name, model_names)}")

    def world_models(self, launch: str, arguments: Mapping[str, str]) -> Mapping[str, Sequence[str]]:
        """Returns the movable joints of each model in the world of a launch, keyed by model."""
        description = self._description(launch, arguments)
        file = self._launch_values(launch, arguments).get("world_file", "")
        models = os.pathsep.join(map(str, model_search_path(description / "models")))
        return models_of_world(description / "worlds" / file, models) if file else {}

    def _description(self, launch: str, arguments: Mapping[str, str]) -> Path:
        package = self._launch_values(launch, arguments).get("description_package", "")
        if not package:
            raise UnresolvedReference(
                f"{launch} has no argument description_package to find models by name; give the path of the model"
            )
        return self.package(package)

    def _launch_values(self, launch: str, arguments: Mapping[str, str]) -> dict[str, str]:
        path = str(self.launch_file(launch))
        return _argument_values(
            path, tuple(f"{name}:={value}" for name, value in arguments.items() if ":=" not in value)
        )


@lru_cache(maxsize=64)
def models_of_world(world: Path, models: str) -> Mapping[str, tuple[str, ...]]:
    """Returns the movable joints of each model in a world, keyed by model.

    Args:
        world: World file.
        models: Folders of models, separated by colons.

    Raises:
        UnreadableWorld: The world does not exist or is invalid, or has elements that SDF does not define.
    """
    try:
        content = read_world(world, ros_resources(models))
    except DescriptionError as error:
        raise UnreadableWorld(f"the world cannot be read: {error}") from error
    if content.unknown:
        raise UnreadableWorld(f"the world has unknown content: {listed_lines(content.unknown)}")
    return {model.name: movable_joints(model) for model in content.models}


@lru_cache(maxsize=256)
def _arguments_of_file(path: str) -> dict[str, str | None]:
    try:
        return {name: default for name, (_, default) in known_arguments(path).items()}
    except (roslaunch.core.RLException, roslaunch.substitution_args.SubstitutionException) as error:
        raise UnresolvedReference(f"{path} is not a valid launch file: {error}") from error


@lru_cache(maxsize=4096)
def _argument_faults(path: str, arguments: tuple[str, ...]) -> tuple[str, ...]:
    try:
        check_arguments(path, list(arguments), file_faults)  # numbers are checked with the parameters
    except ArgumentError as error:
        return error.faults
    except (roslaunch.core.RLException, roslaunch.substitution_args.SubstitutionException, ValueError) as error:
        return (str(error).removeprefix(f"{path}: "),)
    return ()


@lru_cache(maxsize=4096)
def _argument_values(path: str, arguments: tuple[str, ...]) -> dict[str, str]:
    try:
        return argument_values(path, list(arguments))
    except (roslaunch.core.RLException, roslaunch.substitution_args.SubstitutionException, ValueError) as error:
        raise UnresolvedReference(f"{path} cannot be read with these arguments: {error}") from error
