# SPDX-License-Identifier: BSD-3-Clause
"""Looks up what the settings of each mode name, before any episode runs; nothing is started."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import rospkg

from modular_framework_benchmark.episodes.errors import SettingsError
from modular_framework_benchmark.episodes.ros_stack_launch import preview_stack
from modular_framework_benchmark.experiments.ros_launch_check import LaunchCheck
from modular_framework_benchmark.experiments.setting_checks import CheckedSettings, SettingFault, SettingsCheck
from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_benchmark.modes.ros_grasp_runner import GraspEpisodeRunner, load_method
from modular_framework_benchmark.modes.ros_kinematics_runner import KinematicsEpisodeRunner
from modular_framework_benchmark.modes.ros_planning_runner import PLUGINS, PlanningEpisodeRunner
from modular_framework_benchmark.records.what_ran import solver_substitutions, substitution_text
from modular_framework_core.files.faults import listing, nearest
from modular_framework_core.launching.ros_launch_preview import LaunchedNode, LaunchPreview, leaves
from modular_framework_planning.errors import ModelError, PlanningError
from modular_framework_planning.planning_pipeline.planner_registry import (
    PlannerRegistry,
    ResolvedPlanner,
    UnknownNameError,
)
from modular_framework_urdf.urdf_reader import read_urdf

NODE = LaunchedNode("modular_framework_planning", "move_group", "/move_group", "/")


def setting_checks() -> dict[str, SettingsCheck]:
    """Returns what looks up the settings of each mode."""
    planning, kinematics, grasps = PlanningEpisodeRunner(), KinematicsEpisodeRunner(), GraspEpisodeRunner()

    def check_kinematics(settings: Mapping[str, Any]) -> None:
        kinematics.prepared(settings)

    def check_grasps(settings: Mapping[str, Any]) -> None:
        joint = str(settings["gripper_joint"])
        joints = [item.name for item in read_urdf(grasps.robot(settings["robot"]).urdf).joints]
        if joint not in joints:
            raise ModeError(f"gripper_joint '{joint}': the robot has none; {listing(joints)}{nearest(joint, joints)}")
        load_method(str(settings["method"]), settings["method_parameters"])
        grasps.prepared(settings)

    return {
        "task": check_task,
        "planning": lambda settings: check_planning(planning, settings),
        "kinematics": lambda settings: _checked_by(check_kinematics, settings),
        "grasps": lambda settings: _checked_by(check_grasps, settings),
    }


def _plain(settings: Mapping[str, Any], *without: str) -> dict[str, Any]:
    return {key: value for key, value in settings.items() if key not in without}


def _checked_by(prepare: Any, settings: Mapping[str, Any]) -> CheckedSettings:
    """Checks settings by making what their episodes share; a fault begins with the key that it speaks of."""
    try:
        prepare(settings)
    except (ModeError, ModelError, PlanningError) as error:
        text = str(error)
        key = next((key for key in settings if text.startswith((f"{key} ", f"{key}:"))), "group")
        return CheckedSettings((SettingFault((key,), text),), None)
    return CheckedSettings((), dict(settings))


def check_task(settings: Mapping[str, Any]) -> CheckedSettings:
    """Checks the launch and the task of mode `task`."""
    try:
        launch = preview_stack(settings).preview
    except (SettingsError, rospkg.ResourceNotFound) as error:
        return CheckedSettings((SettingFault(("arguments",), str(error)),), None)
    check = LaunchCheck(launch, settings["parameters"], tuple(settings["extra_parameters"]))
    faults = tuple(
        SettingFault((found.key, found.name) if found.name else (found.key,), found.text) for found in check.faults()
    )
    if faults:
        return CheckedSettings(faults, None)
    return CheckedSettings(
        (),
        {
            **_plain(settings, "arguments", "parameters", "launch"),
            "nodes": sorted(map(repr, check.launch.nodes)),
            "parameters": {**check.launch.parameters, "/planner_name": repr(check.planner())},
        },
        (*_substitutions(check.registry(), check.planner()), *solver_substitutions(check.named_solvers())),
    )


def check_planning(runner: PlanningEpisodeRunner, settings: Mapping[str, Any]) -> CheckedSettings:
    """Checks robot, group, pipeline, planner and parameters of mode `planning`."""
    try:
        robot = runner.robot(settings["robot"])
    except (ModeError, ModelError, PlanningError) as error:
        return CheckedSettings((SettingFault(("robot",), str(error)),), None)
    pipeline = str(settings["pipeline"])
    pipelines = {**robot.pipelines}
    pipelines.setdefault(pipeline, {"planning_plugin": PLUGINS.get(pipeline, pipeline)})
    parameters = leaves({"/move_group/planning_pipelines": pipelines, "/robot_description_planning": robot.planning})
    check = LaunchCheck(LaunchPreview((NODE,), parameters), settings["parameters"])
    faults = [
        SettingFault(("parameters", found.name), found.text)
        for found in check.faults()
        if found.name in leaves(settings["parameters"])
    ]
    groups = robot.model.groups
    if settings["group"] and settings["group"] not in groups:
        hint = f"{listing(groups)}{nearest(settings['group'], groups)}"
        faults.append(SettingFault(("group",), f"there is no planning group '{settings['group']}'; {hint}"))
    found = _planner(check, settings, faults, sorted({*robot.pipelines, *PLUGINS}))
    return CheckedSettings(tuple(faults), {**settings, "planner": repr(found)}, _substitutions(check.registry(), found))


def _substitutions(registry: PlannerRegistry | None, planner: ResolvedPlanner | None) -> tuple[str, ...]:
    """Returns what would run in place of a planner, as its records would say."""
    constrained = registry.constrained_planner(planner) if registry is not None and planner is not None else ""
    return (substitution_text(planner.planner, constrained),) if planner is not None and constrained else ()


def _planner(
    check: LaunchCheck, settings: Mapping[str, Any], faults: list[SettingFault], pipelines: list[str]
) -> ResolvedPlanner | None:
    """Returns the planner of mode `planning`; notes faults."""
    try:
        registry = check.registry()
        assert registry is not None
        found = registry.resolve(str(settings["planner"]), str(settings["group"]), str(settings["pipeline"]))
    except UnknownNameError as error:
        hint = f"{listing(error.known)}{nearest(error.name, error.known)}"
        faults.append(SettingFault((error.what,), f"there is no {error.what} '{error.name}'; {hint}"))
        return None
    except (ModelError, PlanningError):
        name = str(settings["pipeline"])
        text = f"there is no pipeline '{name}'; {listing(pipelines)}, or module/Class{nearest(name, pipelines)}"
        faults.append(SettingFault(("pipeline",), text))
        return None
    faults.extend(_setting_faults(check, found, settings))
    return found


def _setting_faults(check: LaunchCheck, found: ResolvedPlanner, settings: Mapping[str, Any]) -> Iterator[SettingFault]:
    for key, value in settings["planner_parameters"].items():
        registry = check.registry()
        for text in registry.faults(found, {key: value}) if registry is not None else ():
            yield SettingFault(("planner_parameters", key), text.replace("; it is ignored", ""))
