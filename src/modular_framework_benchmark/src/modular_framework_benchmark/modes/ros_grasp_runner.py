# SPDX-License-Identifier: BSD-3-Clause
"""Runs grasp generation methods on scenes with objects, without simulation and without a ROS master.

A method returns ranked candidates. The best candidates are then checked as in a grasp generator: collision-free inverse
kinematics at the pregrasp, grasp and postgrasp pose.
"""

from __future__ import annotations

import heapq
import importlib
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from modular_framework_benchmark.episodes.process_times import tree_time_s
from modular_framework_benchmark.episodes.ros_external_methods import method_name
from modular_framework_benchmark.episodes.ros_package_sources import package_source
from modular_framework_benchmark.experiments.grasps_mode import GraspSettings
from modular_framework_benchmark.metrics.measurements import ComponentReport
from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_benchmark.modes.grasp_reach import GraspReach
from modular_framework_benchmark.modes.measured_record import Stopwatch, measured_record
from modular_framework_benchmark.modes.robots import Robot
from modular_framework_benchmark.modes.ros_grasp_scenes import GraspScene, grasp_scene
from modular_framework_benchmark.modes.ros_model_runner import ModelEpisodeRunner
from modular_framework_benchmark.modes.ros_robots import digests_of
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.records.used_software import (
    UsedMethod,
    UsedSoftware,
    solver_substitutions,
)
from modular_framework_core.grasp_generation.grasp_candidates import (
    GraspCandidate,
    GraspMethod,
    GraspQuery,
    MeasuredMethod,
    NoCandidatesError,
    ProcessMethod,
)
from modular_framework_core.grasp_generation.gripper_geometry import (
    GripperGeometry,
    GripperGeometryError,
    measure_gripper,
)
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics
from modular_framework_ros.allowed_names import listing, nearest
from modular_framework_ros.parameter_declarations import NodeDeclaration, existing_declaration, node_declaration
from modular_framework_ros.reported_figures import BEST_RANK, CANDIDATES, CHECKED, REACHABLE, Figure

GENERATOR_NODE = ("modular_framework_core", "grasp_generator")
"""Declaration of the parameters that the node of a method reads, not the method itself."""
ALLOWED_METHOD = "allowed: MODULE:CLASS of a grasp method, such as top_down_grasps.ros_top_down_node:TopDownMethod"


@dataclass(frozen=True, slots=True)
class _GraspSetup:
    """Data shared by episodes with the same robot, hand and method."""

    robot: Robot
    solver: InverseKinematics
    gripper: GripperGeometry
    method: GraspMethod


class GraspEpisodeRunner(ModelEpisodeRunner[GraspSettings, _GraspSetup]):
    """Runs episodes of the mode `grasps`.

    A method is kept between episodes, and answers one query that is not measured before its first episode.
    """

    def __init__(self) -> None:
        """Creates empty caches."""
        super().__init__()
        self._warm: set[int] = set()

    def measure(self, spec: EpisodeSpec, folder: Path, watch: Stopwatch) -> EpisodeRecord:
        """Generates and checks the grasps of one scene; writes no files."""
        settings = spec.settings_of(GraspSettings)
        prepared = self.cached_setup(settings)
        scene = grasp_scene(prepared.robot.model, settings.objects, settings.target)
        method = prepared.method
        if id(method) not in self._warm:
            self._warm.add(id(method))
            _candidates(method, scene, prepared.gripper, spec.seed)
            _take_figures(method)
        if isinstance(method, ProcessMethod):
            method.start()
        processor_start_s = tree_time_s()
        started_s, start = watch.elapsed_s(), time.perf_counter()
        candidates, cause = _candidates(method, scene, prepared.gripper, spec.seed)
        search_s = time.perf_counter() - start
        processor_s = tree_time_s() - processor_start_s
        travels = _joint_travels(prepared, scene, candidates[: settings.max_checks])
        reachable = [rank for rank, travel in enumerate(travels, start=1) if travel is not None]
        outcome = "reachable" if reachable else ("out_of_reach" if candidates else "no_grasp")
        report = ComponentReport(
            component="generation",
            name=settings.target,
            succeeded=bool(reachable),
            reason=_failure_reason(method, candidates, travels, outcome) + cause,
            started_s=started_s,
            ended_s=watch.elapsed_s(),
            wall_s=search_s,
            processor_s=processor_s,
            figures=_figures(candidates, travels, reachable) | _take_figures(method),
            ran=_used_software(settings, prepared),
        )
        status = EpisodeStatus.SUCCEEDED if reachable else EpisodeStatus.FAILED
        return measured_record(spec, status, outcome, report=report, folder=folder, watch=watch)

    def setup_key(self, settings: GraspSettings) -> tuple[Any, ...]:
        """Returns robot, group, gripper joint and method."""
        return settings.robot, settings.group, settings.gripper_joint, settings.method, settings.method_parameters

    def prepare(self, settings: GraspSettings) -> _GraspSetup:
        """Returns the robot with its inverse kinematics and hand, and the method."""
        robot = self.robot(settings.robot)
        group = robot.chain(settings.group)
        try:
            gripper = measure_gripper(robot.urdf, group.tip_link, settings.gripper_joint)
        except GripperGeometryError as error:
            raise ModeError(f"gripper_joint '{settings.gripper_joint}': {error}") from error
        method = load_method(settings.method, settings.method_parameters)
        return _GraspSetup(robot, robot.solvers().solver(group.name), gripper, method)

    def end(self, prepared: _GraspSetup) -> None:
        """Ends the method's own process."""
        self._warm.discard(id(prepared.method))
        if isinstance(prepared.method, ProcessMethod):
            prepared.method.close()


def _take_figures(method: GraspMethod) -> dict[Figure, float]:
    return method.take_figures() if isinstance(method, MeasuredMethod) else {}


def _used_software(settings: GraspSettings, prepared: _GraspSetup) -> UsedSoftware:
    package, parameters = settings.method_package, settings.method_parameters
    version, sources = package_source(package)
    software = UsedSoftware(
        methods={package: UsedMethod(version, sources)},
        solver=prepared.solver.method,
        substitutions=solver_substitutions([prepared.solver.settings.solver]),
        digests=digests_of(prepared.robot),
    )
    if isinstance(prepared.method, ProcessMethod):
        name = method_name(parameters.get("command"), parameters.get("address"))
        return software.with_external_method(name, UsedMethod("", prepared.method.sources))
    return software


def load_method(reference: str, parameters: Mapping[str, Any]) -> GraspMethod:
    """Returns an instance of a grasp method.

    Args:
        reference: MODULE:CLASS, such as `top_down_grasps.ros_top_down_node:TopDownMethod`. The constructor takes
            a parameter reader; `declared_in` names the file that declares its parameters.
        parameters: Values that differ from the defaults, by name without ~.

    Raises:
        ModeError: The class cannot be imported, or a parameter is not allowed.
    """
    kind = method_class(reference)
    try:
        method: GraspMethod = kind(method_parameters(reference, parameters))
    except TypeError as error:
        raise ModeError(f"method '{reference}' cannot be constructed ({error}); {ALLOWED_METHOD}") from error
    return method


def method_parameters(reference: str, parameters: Mapping[str, Any]) -> GivenParameters:
    """Returns the parameters of a method, with the arguments and errors of `load_method`."""
    declared_in = getattr(method_class(reference), "declared_in", ("", ""))
    return GivenParameters(parameters, node_declaration(*declared_in) or NodeDeclaration())


def method_class(reference: str) -> Any:
    """Returns the class of a method, with the argument and the errors of `load_method`."""
    module, _, name = reference.partition(":")
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError, TypeError) as error:
        raise ModeError(f"method '{reference}' cannot be imported ({error}); {ALLOWED_METHOD}") from error


def _candidates(
    method: GraspMethod, scene: GraspScene, gripper: GripperGeometry, seed: int
) -> tuple[list[GraspCandidate], str]:
    """Returns the candidates of all parts of the target, best first, and the known causes if there are none."""
    per_target, causes = [], []
    for target in scene.targets:
        beside = tuple(part for part in (*scene.targets, *scene.others) if part.name != target.name)
        try:
            per_target.append(method.candidates(GraspQuery(target, beside, target.bottom, gripper, seed)))
        except NoCandidatesError as error:
            causes.append(f": {error}")
    merged = list(heapq.merge(*per_target, key=lambda candidate: -candidate.quality))
    return merged, "" if merged else "".join(causes)


def _joint_travels(prepared: _GraspSetup, scene: GraspScene, candidates: list[GraspCandidate]) -> list[float | None]:
    """Returns the joint travel of each candidate; None if unreachable."""
    if not candidates:
        return []
    reach = GraspReach(prepared.robot, prepared.solver, prepared.gripper, scene.planning_scene)
    return [reach.joint_travel(candidate) for candidate in candidates]


def _figures(
    candidates: list[GraspCandidate], travels: list[float | None], reachable: list[int]
) -> dict[Figure, float]:
    """Returns the figures of `metrics.generation`."""
    figures = {CANDIDATES: float(len(candidates)), CHECKED: float(len(travels)), REACHABLE: float(len(reachable))}
    return figures | ({BEST_RANK: float(reachable[0])} if reachable else {})


def _failure_reason(
    method: GraspMethod, candidates: list[GraspCandidate], travels: list[float | None], outcome: str
) -> str:
    match outcome:
        case "reachable":
            return ""
        case "out_of_reach":
            return f"none of {len(travels)} checked grasps (of {len(candidates)} candidates) is reachable"
        case _:
            return f"no part of it can be grasped {method.manner}"


class GivenParameters:
    """Reads given or default parameters; implements `ReadNumber` of the grasp methods.

    Args:
        values: Values by name, without the ~ of private parameters.
        declared: Parameters that the method declares.

    Attributes:
        values: Value or default of each parameter; a whole number of type float is a float.

    Raises:
        ModeError: The method does not declare a parameter, only its node reads the parameter, or a value is not
            allowed.
    """

    def __init__(self, values: Mapping[str, Any], declared: NodeDeclaration) -> None:
        own = {name[1:]: item for name, item in declared.parameters.items() if name.startswith("~")}
        of_node = existing_declaration(*GENERATOR_NODE).parameters
        settable = [name for name in sorted(own) if f"~{name}" not in of_node]
        faults = []
        for name, value in values.items():
            if name in own and name not in settable:
                text = f"'{name}' has no effect in this mode, because only the node of the method reads it"
                faults.append(f"{text}; {listing(settable)}")
            elif name not in own:
                faults.append(f"the method has no '{name}'; {listing(settable)}{nearest(name, settable)}")
            elif own[name].fault(value):
                faults.append(f"'{name}' {own[name].fault(value)}")
        if faults:
            raise ModeError(f"method_parameters: {'; '.join(faults)}")
        self.values = {
            name: float(value) if item.type == "float" and value is not None else value
            for name, item in own.items()
            for value in [values.get(name, item.default)]
        }

    def __call__(self, name: str) -> Any:
        """Returns the given value of a parameter, or its default."""
        return self.values[name.removeprefix("~")]
