# SPDX-License-Identifier: BSD-3-Clause
"""Resolves the names in the settings of each mode before any episode runs, without starting anything."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import rospkg

from modular_framework_benchmark.episodes.ros_file_digests import file_digest
from modular_framework_benchmark.episodes.ros_stack_launch import preview_stack
from modular_framework_benchmark.experiments.grasps_mode import GraspSettings
from modular_framework_benchmark.experiments.kinematics_mode import KinematicsSettings
from modular_framework_benchmark.experiments.mode import CheckedSettings, ReadSettings, SettingFault
from modular_framework_benchmark.experiments.planning_mode import PlanningSettings
from modular_framework_benchmark.experiments.problem_sets import Problem
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.launch_checks.ros_launch_check import LaunchCheck
from modular_framework_benchmark.launch_checks.ros_task_check import PLANNER_CONFIGS, has_framework_plugins
from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_benchmark.modes.robots import Robot
from modular_framework_benchmark.modes.ros_grasp_runner import (
    GraspEpisodeRunner,
    load_method,
    method_class,
    method_parameters,
)
from modular_framework_benchmark.modes.ros_grasp_widths import grasp_width_faults
from modular_framework_benchmark.modes.ros_kinematics_runner import (
    KinematicsEpisodeRunner,
    check_solver,
    solver_parameters,
)
from modular_framework_benchmark.modes.ros_model_runner import ModelEpisodeRunner
from modular_framework_benchmark.modes.ros_planning_parameters import pipeline_parameters
from modular_framework_benchmark.modes.ros_planning_runner import (
    PLUGINS,
    PlanningEpisodeRunner,
    load_problem,
    pipeline_spec,
)
from modular_framework_benchmark.predicates.conditions import REGIONS
from modular_framework_benchmark.records.episode_settings import SettingsError, as_json
from modular_framework_benchmark.records.used_software import (
    detector_substitutions,
    named_solvers,
    solver_substitutions,
    substitution_text,
)
from modular_framework_core.launching.ros_launch_preview import LaunchedNode, LaunchPreview, leaves
from modular_framework_planning.errors import ModelError, PlanningError
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics
from modular_framework_planning.planning_pipeline.planner_registry import (
    PlannerRegistry,
    ResolvedPlanner,
    UnknownNameError,
)
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_ros.allowed_names import listing, nearest
from modular_framework_urdf.urdf_reader import read_urdf

MAX_PATH_LENGTH = 1000
MAX_PROBLEM_FAULTS = 5
"""Maximum number of problems whose faults are listed."""
MOVE_GROUP_NODE = LaunchedNode("modular_framework_planning", "move_group", "/move_group", "/")


def _faults_of(checks: Iterable[tuple[tuple[str, ...], Callable[[], object]]]) -> list[SettingFault]:
    """Returns the errors raised by checks, each with the keys of its setting."""
    faults = []
    for keys, check in checks:
        try:
            check()
        except (ModeError, ModelError, PlanningError) as error:
            faults.append(SettingFault(keys, str(error)))
    return faults


def _robot(runner: ModelEpisodeRunner[Any, Any], read: ReadSettings[Any]) -> tuple[Robot | None, list[SettingFault]]:
    """Returns the robot and the faults of loading; None without a fault if the setting is unreadable."""
    if "robot" in read.unreadable:
        return None, []
    faults = _faults_of([(("robot",), lambda: runner.robot(read.settings.robot))])
    return (None if faults else runner.robot(read.settings.robot)), faults


def _check_group(robot: Robot, name: str) -> None:
    groups = robot.model.groups
    if name not in groups:
        raise ModeError(f"planning group '{name}' does not exist; {listing(groups)}{nearest(name, groups)}")


def _check_chain(robot: Robot, name: str) -> None:
    _check_group(robot, name)
    robot.chain(name)


def check_kinematics(runner: KinematicsEpisodeRunner, read: ReadSettings[KinematicsSettings]) -> CheckedSettings:
    """Checks robot, group, solver and parameters of the mode `kinematics`."""
    settings, group = read.settings, read.settings.group

    def check_parameter(name: str, value: object) -> Callable[[], object]:
        return lambda: solver_parameters({name: value}, group)

    robot, faults = _robot(runner, read)
    faults += _faults_of([(("solver",), lambda: check_solver(settings.solver))])
    if "group" not in read.unreadable:
        given = settings.parameters
        faults += _faults_of((("parameters", name), check_parameter(name, value)) for name, value in given.items())
    if robot is not None and "group" not in read.unreadable:
        faults += _faults_of([(("group",), lambda: _check_chain(robot, group))])
    if robot is not None and not faults and not read.unreadable:
        faults += _faults_of([(("group",), lambda: runner.cached_setup(settings))])
        if not faults:
            return _checked_solver(runner.cached_setup(settings), settings)
    return CheckedSettings(tuple(faults), None)


def _checked_solver(solver: InverseKinematics, settings: KinematicsSettings) -> CheckedSettings:
    """Returns the settings of the mode `kinematics` with the method that solves in place of the named solver."""
    resolved = repr(replace(solver.settings, solver=solver.method))
    return CheckedSettings(
        (),
        as_json(replace(settings, parameters={}, solver=resolved)),
        solver_substitutions([solver.settings.solver]),
    )


def check_grasps(runner: GraspEpisodeRunner, read: ReadSettings[GraspSettings]) -> CheckedSettings:
    """Checks robot, group, gripper joint, method and its parameters of the mode `grasps`."""
    settings = read.settings
    robot, faults = _robot(runner, read)
    joint = settings.gripper_joint

    def check_joint(robot: Robot) -> None:
        joints = [item.name for item in read_urdf(robot.urdf).joints]
        if joint not in joints:
            raise ModeError(f"gripper_joint '{joint}': the robot has none; {listing(joints)}{nearest(joint, joints)}")

    if "method" not in read.unreadable:
        faults += _faults_of([(("method",), lambda: method_class(settings.method))]) or _faults_of(
            [(("method_parameters",), lambda: load_method(settings.method, settings.method_parameters))]
        )
    if robot is not None and "group" not in read.unreadable:
        faults += _faults_of([(("group",), lambda: _check_chain(robot, settings.group))])
    if robot is not None and "gripper_joint" not in read.unreadable:
        faults += _faults_of([(("gripper_joint",), lambda: check_joint(robot))])
    if robot is not None and not faults and not read.unreadable:
        faults += _faults_of([(("gripper_joint",), lambda: runner.cached_setup(settings))])
        if not faults:
            named = runner.cached_setup(settings).solver.settings.solver
            values = method_parameters(settings.method, settings.method_parameters).values
            resolved = as_json(replace(settings, method_parameters=values))
            return CheckedSettings((), resolved, solver_substitutions([named]))
    return CheckedSettings(tuple(faults), None)


def check_task(runner: object, read: ReadSettings[TaskSettings]) -> CheckedSettings:
    """Checks the launch and the task of the mode `task`."""
    if "launch" in read.unreadable:
        return CheckedSettings((), None)
    settings, is_known = read.settings, "arguments" not in read.unreadable
    try:
        stack = preview_stack(settings)
        regions = {region.name: region.as_parameter for region in settings.regions}
        launch = stack.preview.with_parameters({REGIONS: regions} if regions else {})
    except (SettingsError, rospkg.ResourceNotFound) as error:
        return CheckedSettings((SettingFault(("arguments",), str(error)),) if is_known else (), None)
    objects = None if "objects" in read.unreadable or not is_known else [item.name for item in read.objects]
    check = LaunchCheck(launch, settings.parameters, settings.extra_parameters, objects)
    found = check.faults() if is_known else check.faults_of_values()
    faults = tuple(
        SettingFault((item.key, item.name) if item.name else (item.key,), item.text)
        for item in found
        if item.key not in read.unreadable
    )
    if not faults and not read.unreadable:
        parameters = {**launch.parameters, **settings.parameters}
        faults = tuple(grasp_width_faults(read, parameters, stack.launch.method_nodes))
    if faults or read.unreadable:
        return CheckedSettings(faults, None)
    return CheckedSettings(
        (),
        {
            **as_json(replace(settings, arguments={}, parameters={}, launch="", regions=(), extra_parameters=())),
            "task": _content_of(settings.task),
            "nodes": sorted(map(repr, check.launch.nodes)),
            "parameters": {
                **{name: _content_of(value) for name, value in check.resolved_parameters().items()},
                "/planner_name": repr(check.planner()),
            },
        },
        (
            *_substitutions(check.registry(), check.planners()),
            *solver_substitutions(named_solvers(check.kinematics())),
            *detector_substitutions(check.collision_detector()),
        ),
        {**check.without_effect(), "/extra_parameters": "sets no value"},
    )


def _content_of(value: Any) -> Any:
    """Returns a value; for the path of a file, its folder and a digest, which are equal for a copy of the file."""
    if isinstance(value, str) and value.startswith("/") and len(value) < MAX_PATH_LENGTH and Path(value).is_file():
        return f"{Path(value).parent}: {file_digest(Path(value))}"
    return value


def _substitutions(registry: PlannerRegistry | None, planners: Iterable[ResolvedPlanner]) -> tuple[str, ...]:
    """Returns the texts of the substitutions that constrained requests cause, as in the records of plans."""
    if registry is None:
        return ()
    texts = (
        substitution_text(planner.planner, constrained)
        for planner in planners
        if (constrained := registry.constrained_planner(planner))
    )
    return tuple(dict.fromkeys(texts))


def check_planning(runner: PlanningEpisodeRunner, read: ReadSettings[PlanningSettings]) -> CheckedSettings:
    """Checks robot, group, pipeline, planner and parameters of the mode `planning`."""
    settings = read.settings
    robot, faults = _robot(runner, read)
    if robot is None:
        return CheckedSettings(tuple(faults), None)
    if settings.group:
        faults += _faults_of([(("group",), lambda: _check_group(robot, settings.group))])
    if "pipeline" in read.unreadable:
        return CheckedSettings(tuple(faults), None)
    check = _launch_check(robot, settings)
    faults += _parameter_faults(check, settings)
    if not faults:
        faults += _problem_faults(read, robot)
    planner = None
    if "planner" not in read.unreadable:
        planner = _planner(check, settings, faults, sorted({*robot.pipelines, *PLUGINS}))
    if planner is None or faults or read.unreadable:
        return CheckedSettings(tuple(faults), None)
    return CheckedSettings(
        (),
        _resolved_planning(robot, settings, planner),
        _substitutions(check.registry(), [planner]),
        _unused_configurations(settings, planner),
    )


def _resolved_planning(robot: Robot, settings: PlanningSettings, planner: ResolvedPlanner) -> Any:
    """Returns the settings of the mode `planning` with the parameters of the pipeline and of the planner that run."""
    spec = pipeline_spec(robot, settings)
    if has_framework_plugins(spec):
        parameters = {name: value for name, value in spec.settings.parameters.items() if name != PLANNER_CONFIGS}
        spec = replace(spec, settings=replace(spec.settings, planner_configs={}, parameters=parameters))
    planner = replace(planner, settings={**planner.settings, **settings.planner_parameters})
    resolved = {
        **as_json(replace(settings, planner="", planner_parameters={}, parameters={}, pipeline="")),
        "planner": as_json(planner),
        "pipeline": as_json(spec),
    }
    return _with_floats(resolved)


def _with_floats(value: Any) -> Any:
    """Returns JSON values with whole numbers as floats, which planners read alike."""
    match value:
        case Mapping():
            return {str(name): _with_floats(item) for name, item in value.items()}
        case list() | tuple():
            return [_with_floats(item) for item in value]
        case int() if not isinstance(value, bool):
            return float(value)
    return value


def _unused_configurations(settings: PlanningSettings, planner: ResolvedPlanner) -> dict[str, str]:
    """Returns the parameters of other planners, and the reason why they have no effect."""
    reasons = {}
    for name in leaves(settings.parameters):
        configuration = name.partition(f"/{PLANNER_CONFIGS}/")[2].split("/")[0]
        if configuration not in ("", settings.planner, planner.planner):
            reasons[name] = f"belongs to the planner '{configuration}', which does not run"
    return reasons


def _problem_faults(read: ReadSettings[PlanningSettings], robot: Robot) -> Iterator[SettingFault]:
    """Yields the errors in the files of the first problems with errors, and the number of further problems."""
    texts = [text for problem in read.problems if (text := _problem_fault(problem, robot.model, read.settings.group))]
    for text in texts[:MAX_PROBLEM_FAULTS]:
        yield SettingFault(("problems",), text)
    if len(texts) > MAX_PROBLEM_FAULTS:
        text = f"{len(texts) - MAX_PROBLEM_FAULTS} further problems have faults, too; correct these first"
        yield SettingFault(("problems",), text)


@lru_cache(maxsize=4096)
def _problem_fault(problem: Problem, model: RobotModel, group: str) -> str:
    """Returns the error in the files of a problem, or "". Cached, because levels share problems."""
    try:
        load_problem(problem, model, group)
    except ModeError as error:
        return str(error)
    return ""


def _launch_check(robot: Robot, settings: PlanningSettings) -> LaunchCheck:
    """Returns the check of a move_group with the robot and the pipeline of the mode `planning`."""
    pipeline = settings.pipeline
    pipelines = {**robot.pipelines}
    pipelines.setdefault(pipeline, {"planning_plugin": PLUGINS.get(pipeline, pipeline)})
    parameters = leaves(
        {f"{MOVE_GROUP_NODE.name}/planning_pipelines": pipelines, "/robot_description_planning": robot.planning}
    )
    urdf, srdf = robot.model.source[:2]
    parameters |= {"/robot_description": urdf, "/robot_description_semantic": srdf}
    parameters[f"{MOVE_GROUP_NODE.name}/default_planning_pipeline"] = pipeline
    return LaunchCheck(LaunchPreview((MOVE_GROUP_NODE,), parameters), settings.parameters)


def _parameter_faults(check: LaunchCheck, settings: PlanningSettings) -> Iterator[SettingFault]:
    """Yields the errors in the parameters of the mode `planning`, including those of its pipeline."""
    values = leaves(settings.parameters)
    pipeline, unread = settings.pipeline, set()
    for name, value in values.items():
        try:
            pipeline_parameters({name: value}, pipeline)
        except ModeError as error:
            unread.add(name)
            yield SettingFault(("parameters", name), str(error))
    plugin = f"{MOVE_GROUP_NODE.name}/planning_pipelines/{pipeline}/planning_plugin"
    for fault in check.faults():
        if fault.name not in unread and (
            fault.name != plugin or plugin in values
        ):  # otherwise the pipeline's name is wrong
            yield SettingFault(("parameters", fault.name), fault.text)


def _planner(
    check: LaunchCheck, settings: PlanningSettings, faults: list[SettingFault], pipelines: list[str]
) -> ResolvedPlanner | None:
    """Returns the planner of the mode `planning`, or None after adding faults.

    Args:
        check: Check of the launch.
        settings: Settings of a combination.
        faults: List to which faults are added.
        pipelines: Names of the available pipelines.
    """
    try:
        registry = check.registry()
        assert registry is not None
        planner = registry.resolve(settings.planner, settings.group, settings.pipeline)
    except UnknownNameError as error:
        hint = f"{listing(error.known)}{nearest(error.name, error.known)}"
        faults.append(SettingFault((error.what,), f"there is no {error.what} '{error.name}'; {hint}"))
        return None
    except (ModelError, PlanningError):
        name = settings.pipeline
        text = f"there is no pipeline '{name}'; {listing(pipelines)}, or module/Class{nearest(name, pipelines)}"
        faults.append(SettingFault(("pipeline",), text))
        return None
    faults.extend(_setting_faults(check, planner, settings))
    return planner


def _setting_faults(check: LaunchCheck, planner: ResolvedPlanner, settings: PlanningSettings) -> Iterator[SettingFault]:
    if settings.planner_parameters and not settings.planner:
        text = "planner_parameters has no effect without a planner; name the planner with the key planner"
        yield SettingFault(("planner_parameters",), text)
    for key, value in settings.planner_parameters.items():
        registry = check.registry()
        for text in registry.faults(planner, {key: value}) if registry is not None else ():
            yield SettingFault(("planner_parameters", key), text.replace("; it is ignored", ""))
