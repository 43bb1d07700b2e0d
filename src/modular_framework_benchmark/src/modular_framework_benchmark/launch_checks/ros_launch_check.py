# SPDX-License-Identifier: BSD-3-Clause
"""Resolves the names in a launch before it starts: parameters, planners, pipelines, adapters, groups, joints."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from modular_framework_benchmark.experiments.resource_lookup import UnreadableWorld
from modular_framework_benchmark.launch_checks.ros_controller_names import (
    controller_faults,
    hardware_faults,
    vendor_controller_faults,
)
from modular_framework_benchmark.launch_checks.ros_launch_files import (
    ARGUMENTS,
    MOVE_GROUP,
    argument_faults,
    models_of_launch,
    named_entry_faults,
    program_faults,
    robot_model,
    sensor_faults,
)
from modular_framework_benchmark.launch_checks.ros_pipeline_names import (
    DETECTOR,
    MANAGER,
    PipelineNames,
    move_group_faults,
    named_detector,
    resolved_names,
    unknown_name,
)
from modular_framework_benchmark.launch_checks.ros_robot_names import RobotNames, robot_names
from modular_framework_benchmark.launch_checks.ros_task_check import (
    CacheableNames,
    CheckedTask,
    UnusedNames,
    checked_task,
)
from modular_framework_benchmark.predicates.conditions import REGIONS
from modular_framework_core.launching.launch_values import CONFIGURATION
from modular_framework_core.launching.ros_declared_names import DeclaredNames, LaunchFault
from modular_framework_core.launching.ros_launch_preview import LaunchPreview, leaves, preview_launch
from modular_framework_core.task_constructor import generator, pipeline
from modular_framework_core.task_constructor.known_names import (
    MODEL_PATH,
    KnownNames,
    PlannerNames,
    model_of,
    names_of_config,
)
from modular_framework_planning.errors import ModelError, PlanningError
from modular_framework_planning.kinematics.kinematics_settings import KEYS, NUMERIC, PLUGINS, is_known_solver
from modular_framework_planning.planning_pipeline.planner_registry import (
    PlannerRegistry,
    ResolvedPlanner,
    UnknownNameError,
)
from modular_framework_ros.allowed_names import closest, listing, nearest

DESCRIPTION = "robot_description"
PIPELINES = "planning_pipelines"
RUN_TASK = "run_task"


class LaunchCheck:
    """Checks a launch together with the parameters that override those of its files.

    Args:
        launch: Preview of the launch file.
        given: Overriding parameters, keyed by full name.
        extra: Names of overriding parameters that the user's own nodes read.
        objects: Names of the objects that an experiment adds to the world; None if unknown: then no model is checked.
    """

    def __init__(
        self,
        launch: LaunchPreview,
        given: Mapping[str, Any] | None = None,
        extra: Container[str] = (),
        objects: Collection[str] | None = (),
    ) -> None:
        self._given, self._extra = dict(given or {}), extra
        self._objects = objects
        self.launch = launch.with_parameters(self._given)
        self._names = DeclaredNames(self.launch)
        self._pipelines: tuple[str, ...] = ()
        self._node = next((node for node in launch.nodes if node.executable == MOVE_GROUP), None)
        if self._node is not None:
            self._pipelines = tuple(launch.below(f"{self._node.name}/{PIPELINES}"))

    def faults(self) -> list[LaunchFault]:
        """Returns all faults of the launch."""
        try:
            return [
                *self._names.unread(self._given, self._extra),
                *self._names.misspelt(leaves(self._given)),
                *self._names.wrong_values(),
                *self._robot_faults(),
                *self._kinematics_faults(),
                *move_group_faults(self._names, self._given),
                *(self._planner_faults() if self._node is not None else ()),
                *controller_faults(self.launch, self._robot.movable_joints),
                *vendor_controller_faults(self.launch, self._robot.movable_joints),
                *hardware_faults(self._names, self.launch, self._robot),
                *program_faults(self.launch.nodes),
                *sensor_faults(self.launch),
                *argument_faults(self.launch, self._robot),
                *self._model_faults(),
                *self._task_faults(),
            ]
        except (PlanningError, ModelError) as error:
            return [LaunchFault("", str(error))]

    def faults_of_values(self) -> list[LaunchFault]:
        """Returns the faults in parameter values, for a partly known launch."""
        return list(self._names.wrong_values())

    def registry(self) -> PlannerRegistry | None:
        """Returns the planners of the launch, or None without a move_group node."""
        if self._node is None:
            return None
        limits = self.launch.below(f"{self._node.namespace}{DESCRIPTION}_planning")
        return PlannerRegistry(self.launch.below(self._node.name), limits)

    def _planner_faults(self) -> Iterator[LaunchFault]:
        registry = self.registry()
        assert registry is not None and self._node is not None
        parent = f"{self._node.name}/{PIPELINES}/"
        pipelines = [name.removeprefix(parent).split("/")[0] for name in leaves(self._given) if name.startswith(parent)]
        broken = registry.adapter_faults([registry.default, *pipelines])
        yield from (LaunchFault(f"{parent}{name}", text) for name, text in broken.items())
        for name, value in self._names.naming("pipeline"):
            if value not in registry.specs:
                yield unknown_name(name, "pipeline", value, tuple(registry.specs))
        group = str(self.launch.parameters.get("/arm_group_name", ""))
        for name, value in self._names.naming("planner"):
            try:
                planner = registry.resolve(value, group)
            except UnknownNameError as error:
                yield unknown_name(name, error.what, error.name, error.known)
                continue
            except ModelError:
                continue  # adapter_faults reported it
            for parameter, text in registry.adapter_faults([planner.pipeline]).items():
                if parameter not in broken:
                    yield LaunchFault(name, text)
            for text in registry.faults(planner):
                yield LaunchFault(name, f"planner '{value}': {text.replace('; it is ignored', '')}")
        configured = {name for name in registry.specs if f"{parent}{name}/planning_plugin" in self.launch.parameters}
        names = PipelineNames(
            parent, (*self._pipelines, *sorted(configured - {*self._pipelines})), self._robot.groups, registry
        )
        settings = leaves(self._given)
        for name, value in settings.items():
            yield from names.faults(name, value)
        for name in self.launch.parameters:
            yield from names.misspelt(name) if name not in settings else ()

    @property
    def _robot(self) -> RobotNames:
        urdf, srdf = (str(self.launch.parameters.get(f"/{DESCRIPTION}{end}") or "") for end in ("", "_semantic"))
        return robot_names(urdf, srdf)

    def _robot_faults(self) -> Iterator[LaunchFault]:
        """Yields planning groups, joints and links that the robot lacks."""
        robot = self._robot
        for name, value in self._names.naming("group") if robot.groups else ():
            if value not in robot.groups:
                yield unknown_name(name, "planning group", value, robot.groups)
        if robot.fault:
            value = self.launch.arguments.get("robot_urdf_file", "")
            named = f"argument 'robot_urdf_file' is '{value}'" if value else "argument 'robot_urdf_file'"
            yield LaunchFault("robot_urdf_file", f"{named}: {robot.fault}", ARGUMENTS)
            return
        for text in robot.misspelt:
            yield LaunchFault("robot_urdf_file", f"argument 'robot_urdf_file': {text}", ARGUMENTS)
        for name, value in self._names.naming("joint") if robot.joints else ():
            if value not in robot.joints:
                yield unknown_name(name, "joint", value, robot.joints)
        yield from self._names.below_trees(self._given, robot.by_kind())

    def _model_faults(self) -> Iterator[LaunchFault]:
        """Yields an unreadable world, objects with the name of the robot, and named models that are missing."""
        try:
            models = self._models
        except UnreadableWorld as error:
            yield LaunchFault("world_file", str(error), ARGUMENTS)
            return
        robot, task = robot_model(self.launch, self._robot), self._task
        spawned: Collection[str] = () if task is None else task.models
        for name, key in (*((name, "objects") for name in self._objects or ()), *((name, "task") for name in spawned)):
            if name == robot:
                text = f"the object '{name}' has the name of the robot in the simulation; give the object another name"
                yield LaunchFault("", text, key)
        known = (*(models or ()), *spawned)
        for name, value in self._names.naming("model") if models is not None else ():
            if model_of(value) not in known and (task is None or value not in task.texts):
                fault = unknown_name(name, "model or object", value, known)
                hint = "name it in external_names of the task if another node adds it"
                yield replace(fault, text=f"{fault.text}; {hint}")

    @property
    def _models(self) -> tuple[str, ...] | None:
        """Returns the models of the world and the objects; None if they are unknown, such as on a real robot.

        Raises:
            UnreadableWorld: The world file is invalid.
        """
        world = models_of_launch(self.launch)
        return None if world is None or self._objects is None else (*world, *self._objects)

    def _kinematics_faults(self) -> Iterator[LaunchFault]:
        """Yields unknown groups, solvers and keys of kinematics.yaml."""
        groups = self._robot.groups
        for name, value in self.launch.parameters.items():
            _, parent, path = name.partition(f"/{DESCRIPTION}_kinematics/")
            group, _, key = path.partition("/")
            if not parent:
                continue
            if groups and group not in groups:
                yield unknown_name(name, "planning group", group, groups)
            elif key not in KEYS and (key.startswith("kinematics_") or closest(key, KEYS)):
                yield unknown_name(name, "key of kinematics.yaml", key, KEYS)  # plugins have further keys
            elif key == "kinematics_solver" and not is_known_solver(str(value)):
                yield unknown_name(name, key, str(value), (NUMERIC, *PLUGINS))

    def resolved_parameters(self) -> dict[str, Any]:
        """Returns the parameters with defaults for those that are not set; equal for equivalent launches."""
        parameters = self._unused_names.effective(self._names.effective_values())
        if self._node is None:
            return parameters
        named = (DETECTOR, MANAGER)
        unnamed = {name: value for name, value in parameters.items() if name.rpartition("/")[2] not in named}
        return unnamed | resolved_names(self.launch, self._node)

    def collision_detector(self) -> str:
        """Returns the named collision detector; "" for the default, and without a move_group node."""
        return "" if self._node is None else named_detector(self.launch, self._node)

    def without_effect(self) -> dict[str, str]:
        """Returns the parameters that change nothing in an episode, and the reason as the end of a sentence."""
        return self._unused_names.reasons()

    @cached_property
    def _unused_names(self) -> UnusedNames:
        pipelines = f"{self._node.name}/{PIPELINES}/" if self._node is not None else ""
        return UnusedNames(self.launch, self._names, self.registry(), pipelines, self._task, self._extra)

    @cached_property
    def _task(self) -> CheckedTask | None:
        """Returns the checked task of the launch; None without a task or with a state machine in a file."""
        node = next((node for node in self.launch.nodes if node.executable == RUN_TASK), None)
        parameters = self.launch.below(node.name) if node is not None else {}
        is_task = node is not None and not str(parameters.get("state_machine_to_load", "")).strip()
        return self._checked_script(parameters) if is_task else None

    def kinematics(self) -> dict[str, Any]:
        """Returns the contents of kinematics.yaml; empty without a move_group node."""
        return {} if self._node is None else self.launch.below(f"{self._node.namespace}{DESCRIPTION}_kinematics")

    def planner(self) -> ResolvedPlanner | None:
        """Returns the planner of the task, or None if the launch has no planner of that name."""
        registry, group = self.registry(), str(self.launch.parameters.get("/arm_group_name", ""))
        try:
            return registry.resolve(str(self.launch.parameters.get("/planner_name", "")), group) if registry else None
        except (UnknownNameError, ModelError):
            return None

    def planners(self) -> tuple[ResolvedPlanner, ...]:
        """Returns the existing planners that the launch and its task name; the planner of the task is the first."""
        registry, group = self.registry(), str(self.launch.parameters.get("/arm_group_name", ""))
        if registry is None:
            return ()
        named = [value for _, value in self._names.naming("planner")]
        if self._task is not None:
            named += self._task.planners
        planners = [self.planner()]
        for name in dict.fromkeys(named):
            with contextlib.suppress(UnknownNameError, ModelError):
                planners.append(registry.resolve(name, group))
        return tuple(planner for planner in planners if planner is not None)

    def _task_faults(self) -> Iterator[LaunchFault]:
        """Yields the faults of the task, its states and templates, or of the state machine to load."""
        for node in self.launch.nodes:
            if node.executable == RUN_TASK:
                parameters = self.launch.below(node.name)
                machine = str(parameters.get("state_machine_to_load", "")).strip()
                yield from self._machine_faults(machine) if machine else self._script_faults(parameters)
                yield from self._named_state_faults(str(parameters.get("config_directory", "")))

    def _machine_faults(self, machine: str) -> Iterator[LaunchFault]:
        folder, name = generator.default_output_directory(), "state_machine_to_load"
        if not (Path(machine).is_file() or (folder / machine).is_file()):
            machines = sorted(path.name for path in folder.glob("*.py"))
            text = f"argument '{name}': there is no file {machine}, nor in {folder}; {listing(machines, 'it is empty')}"
            yield LaunchFault(name, f"{text}{nearest(machine, machines)}", ARGUMENTS)

    def _named_state_faults(self, config: str) -> Iterator[LaunchFault]:
        """Yields the invalid entries in the files of named states, poses and trajectories."""
        faults = named_entry_faults(Path(config), self._robot.movable_joints) if config else ()
        yield from (LaunchFault(CONFIGURATION, text, ARGUMENTS) for text in faults)

    def _script_faults(self, parameters: Mapping[str, Any]) -> Iterator[LaunchFault]:
        for kind in ("states", "templates"):
            for folder in _folders_of(parameters, kind):
                if not folder.is_dir():
                    name = f"{kind}_directory"
                    yield LaunchFault(name, f"argument '{name}': there is no folder {folder}", ARGUMENTS)
                    return
        checked = self._task or CheckedTask()
        yield from checked.faults
        yield from self._task_planner_faults(checked.planners)

    def _checked_script(self, parameters: Mapping[str, Any]) -> CheckedTask:
        """Returns the checked task in the parameters of run_task."""
        script = str(parameters.get("task_constructor_script", ""))
        states, templates = (_folders_of(parameters, kind) for kind in ("states", "templates"))
        names = self._known_names(str(parameters.get("config_directory", "")))
        return checked_task(script, states, templates, CacheableNames(names))

    def _task_planner_faults(self, planners: Iterable[str]) -> Iterator[LaunchFault]:
        """Yields the invalid settings of the planners that only the task names."""
        registry, group = self.registry(), str(self.launch.parameters.get("/arm_group_name", ""))
        if registry is None:
            return
        for planner in sorted({*planners} - {value for _, value in self._names.naming("planner")}):
            for text in registry.faults(registry.resolve(planner, group)):
                fault = f"planner '{planner}', which the task names: {text.replace('; it is ignored', '')}"
                yield LaunchFault("", fault, "task")

    def _known_names(self, config: str) -> KnownNames:
        names = names_of_config(Path(config)) if config else KnownNames()
        srdf = str(self.launch.parameters.get(f"/{DESCRIPTION}_semantic") or "")
        names = names.with_robot(srdf, f"the parameter /{DESCRIPTION}_semantic") if srdf else names
        names = names.with_object_types(str(self.launch.parameters.get(MODEL_PATH) or ""))
        names = names.with_regions(
            self.launch.below(REGIONS), "the launch argument 'regions', or to 'regions' of the experiment"
        )
        try:
            models = self._models
        except UnreadableWorld:  # reported with the models
            models = None
        if models is not None:
            names = names.with_models(models, "the world, or to 'objects' of an experiment")
        registry = self.registry()
        return names if registry is None else names.with_planners(lambda: PlannerNames(registry.by_pipeline()))


def _folders_of(parameters: Mapping[str, Any], kind: str) -> tuple[Path, ...]:
    """Returns the folders of the user with states or templates, in the parameters of run_task."""
    return tuple(pipeline.directories_from(str(parameters.get(f"{kind}_directory", ""))))


def launch_faults(path: str, arguments: Sequence[str], later_files: Sequence[str] = ()) -> list[str]:
    """Returns all faults in the names of launch files, their arguments and their configuration files.

    Args:
        path: Launch file.
        arguments: Launch arguments, `name:=value`.
        later_files: Launch files loaded afterwards with the same arguments.

    Raises:
        roslaunch.core.RLException: A launch file is invalid.
    """
    return [fault.text for fault in LaunchCheck(preview_launch(path, arguments, later_files)).faults()]
