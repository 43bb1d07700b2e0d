# SPDX-License-Identifier: BSD-3-Clause
"""Resolves the settings of an episode to its launch, without launching anything."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import roslaunch.config
import roslaunch.core
import roslaunch.rlutil
import roslaunch.xmlloader
import rospkg
import yaml

from modular_framework_benchmark.episodes.stack import StackLaunch
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.records.episode_settings import SettingsError
from modular_framework_core.launching.launch_arguments import (
    argument_values,
    check_arguments,
    known_arguments,
)
from modular_framework_core.launching.launch_values import METHOD, NO_METHOD, file_faults
from modular_framework_core.launching.robot_controllers_spawner import ControllerFileError, read_controller_file
from modular_framework_core.launching.ros_launch_preview import LaunchPreview, preview_launch

FIXED_ARGUMENTS = {"end_with_task": "false", "gui": "false", "rviz": "false"}
"""Launch arguments of every episode whose launch file has them."""
DEFAULT_ARGUMENTS = {"wait_for_planning": "true", "real_time_factor": "0"}
"""Launch arguments of episodes that do not set them: simulated time waits for computations and otherwise runs as fast
as possible, so that an episode does not depend on the load of the machine."""
TRUE_VALUES = ("true", "1")
LAUNCH_SEED = "/seed"
"""Seed of move_group's worker for seeded plans at the start; each episode sets its own seed."""


def resolve_launch(settings: TaskSettings) -> StackLaunch:
    """Returns the launch of an episode.

    Raises:
        SettingsError: The launch file does not exist, or an argument is wrong.
    """
    file = settings.launch
    package, _, name = ("", "", file) if file.startswith("/") else file.partition("/")
    if not name:
        raise SettingsError(f"setting 'launch' is {file!r}; allowed: PACKAGE/FILE.launch; correct it")
    try:
        path = roslaunch.rlutil.resolve_launch_arguments([*filter(None, (package, name))])[0]
        arguments_of_file = known_arguments(path)
        arguments = {name: value for name, value in DEFAULT_ARGUMENTS.items() if name in arguments_of_file}
        arguments |= {**settings.arguments, **({"task_constructor_script": settings.task} if settings.task else {})}
        arguments |= {name: value for name, value in FIXED_ARGUMENTS.items() if name in arguments_of_file}
        argument_texts = [f"{name}:={value}" for name, value in arguments.items()]
        check_arguments(path, argument_texts, file_faults)
        values = argument_values(path, argument_texts)
        controllers: tuple[str, ...] = ()
        method_nodes = _nodes_of(values.get(METHOD, ""))
        if values.get("robot_package") and values.get("controller_file"):
            folder = Path(rospkg.RosPack().get_path(values["robot_package"])) / "controllers"
            controllers = read_controller_file(folder / values["controller_file"]).controllers
    except (roslaunch.core.RLException, rospkg.ResourceNotFound, ControllerFileError, OSError) as error:
        raise SettingsError(f"setting 'launch' {package}/{name}: {error}") from error
    return StackLaunch(
        package,
        name,
        arguments,
        {"/task/wait_for_start": True, LAUNCH_SEED: 0, **settings.parameters},
        method_nodes,
        controllers,
        can_restart=values.get("wait_for_planning", "").lower() in TRUE_VALUES,
        regions=_regions_in(values.get("regions", "")),
    )


def _regions_in(text: str) -> dict[str, Any]:
    """Returns the regions in the launch argument `regions`; empty for a text that the check of the launch refuses."""
    try:
        regions = yaml.safe_load(text)
    except yaml.YAMLError:
        return {}
    return regions if isinstance(regions, dict) else {}


@dataclass(frozen=True, slots=True)
class StackPreview:
    """Launch of an episode, and the preview of its nodes and parameters."""

    launch: StackLaunch
    preview: LaunchPreview


def preview_stack(settings: TaskSettings) -> StackPreview:
    """Returns the preview of an episode's stack, without its parameters; equal launches are loaded once.

    Raises:
        SettingsError: See `resolve_launch`; or the launch file is invalid.
    """
    return loaded_stack(settings.launch, settings.task, tuple(sorted(settings.arguments.items())))


@lru_cache(maxsize=256)
def loaded_stack(launch: str, task: str, arguments: tuple[tuple[str, str], ...]) -> StackPreview:
    """Returns the preview of a stack; cached per process.

    Args:
        launch: Launch file, as in `TaskSettings`.
        task: Task file, as in `TaskSettings`.
        arguments: Names and values of the launch arguments.
    """
    resolved = resolve_launch(TaskSettings(launch=launch, task=task, arguments=dict(arguments)))
    try:
        path = roslaunch.rlutil.resolve_launch_arguments([*filter(None, (resolved.package, resolved.launch_file))])[0]
        preview = preview_launch(path, [f"{name}:={value}" for name, value in resolved.arguments.items()])
    except roslaunch.core.RLException as error:
        raise SettingsError(f"setting 'launch' {resolved.package}/{resolved.launch_file}: {error}") from error
    return StackPreview(resolved, preview)


def _nodes_of(method: str) -> tuple[str, ...]:
    """Returns the names of the nodes in the launch file of a method; NO_METHOD has none."""
    if method in NO_METHOD:
        return ()
    package, _, file = method.partition("/")
    path = method if not package else roslaunch.rlutil.resolve_launch_arguments([package, file])[0]
    loader = roslaunch.xmlloader.XmlLoader(resolve_anon=False)
    config = roslaunch.config.load_config_default([path], None, loader=loader, verbose=False, assign_machines=False)
    return tuple(node.namespace + node.name for node in config.nodes)
