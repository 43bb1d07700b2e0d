# SPDX-License-Identifier: BSD-3-Clause
"""Identifies the software of a running stack from its nodes, parameters and planning reports."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import rospkg

from modular_framework_benchmark.episodes.ros_external_methods import command_files, method_name
from modular_framework_benchmark.episodes.ros_file_digests import (
    file_digest,
    files_with_named,
    joint_digest,
    model_resources,
    portable_name,
    robot_digests,
    world_files,
)
from modular_framework_benchmark.episodes.ros_package_sources import package_source
from modular_framework_benchmark.records.used_software import (
    UsedMethod,
    UsedSoftware,
    detector_substitutions,
    named_solvers,
    solver_substitutions,
)
from modular_framework_core.files.model_files import model_file
from modular_framework_core.task_constructor.known_names import MODEL_PATH
from modular_framework_core.task_constructor.machine_files import machine_files
from modular_framework_planning.plan_statistics import PlannerRun
from modular_framework_ros.component_report import ReportedMethod
from modular_framework_ros.connections.ros_node_calls import NodeCallError, node_address, process_id
from modular_framework_ros.reported_figures import SOURCES_PARAMETER

FILE_PARAMETERS = {
    "task": "/task/task_constructor_script",
    "state machine": "/task/state_machine_to_load",
}
"""Parameters of nodes that name files, keyed by kind of file."""
EXTERNAL_PARAMETERS = ("command", "address", SOURCES_PARAMETER)
NODE_TIMEOUT_S = 5.0
KINEMATICS_PARAMETER = "/robot_description_kinematics"
DETECTORS = ("/move_group/collision_detector", "/collision_detector")
WORLD = "/gazebo/world_file"
DESCRIPTION_PARAMETERS = ("/robot_description", "/robot_description_semantic")


def running_stack(
    parameters: Mapping[str, Any],
    controllers: Mapping[str, str],
    generators: Iterable[str],
    plans: Iterable[Mapping[str, Any]],
    models: Iterable[str] = (),
    *,
    process_methods: Iterable[ReportedMethod] = (),
) -> UsedSoftware:
    """Returns the software of a stack, including the planners that ran.

    Args:
        parameters: All parameters of the parameter server.
        controllers: Types of the running controllers, keyed by name.
        generators: Names of the nodes that generate grasps.
        plans: Planning reports of move_group.
        models: Models of the placed objects: names, or absolute paths of their files.
        process_methods: Methods in their own process that components report, such as policies.
    """
    generators, controllers, process_methods = list(generators), dict(controllers), list(process_methods)
    commands = [
        *(_value(parameters, f"{node}/command") for node in generators),
        *(method.command for method in process_methods),
    ]
    methods = {package: package_source(package) for package in sorted({package_of(node) for node in generators} - {""})}
    software = UsedSoftware(
        methods={name: UsedMethod(version, digest) for name, (version, digest) in methods.items()},
        controllers=controllers,
        physics_engine=str(_value(parameters, "/gazebo/physics_engine")),
        renderer=str(_value(parameters, "/gazebo_cameras/renderer")),
        digests=_digests(parameters, controllers, models) | _command_digests(commands),
        substitutions=(
            *solver_substitutions(named_solvers(_value(parameters, KINEMATICS_PARAMETER))),
            *detector_substitutions(next(filter(None, (str(_value(parameters, name)) for name in DETECTORS)), "")),
        ),
    )
    for node in generators:
        command, address, sources = (_value(parameters, f"{node}/{name}") for name in EXTERNAL_PARAMETERS)
        if name := method_name(command, address):
            software = software.with_external_method(name, UsedMethod("", str(sources)))
    for method in process_methods:
        said = UsedMethod("", method.sources, method.said_name, method.said_version)
        software = software.with_external_method(method_name(method.command, method.address), said)
    # A sequence has a run for each of its motions.
    runs = [run for plan in plans for run in (plan.get("run"), *plan.get("runs", ())) if run]
    return software.with_plans(PlannerRun(**run) for run in runs)


def _digests(parameters: Mapping[str, Any], controllers: Iterable[str], models: Iterable[str]) -> dict[str, str]:
    """Returns the SHA-256 of what determines the episodes of a stack, keyed by description."""
    urdf, srdf = (str(_value(parameters, name)) for name in DESCRIPTION_PARAMETERS)
    named = {what: Path(str(_value(parameters, name))) for what, name in FILE_PARAMETERS.items()}
    named |= {f"machine {file.name}": file for file in machine_files(named["task"])}
    digests = {what: file_digest(path) for what, path in named.items() if path.is_file()}
    folder = str(_value(parameters, MODEL_PATH))
    resources = model_resources(folder)
    files = {"world": world_files(str(_value(parameters, WORLD)), resources)}
    for model in models:
        path = model_file(model, folder)
        if path.is_file():
            files[f"object {portable_name(path)}"] = files_with_named(path, resources)
    for name in controllers:
        settings = json.dumps(_value(parameters, name), sort_keys=True, default=str)
        digests[f"controller {name}"] = hashlib.sha256(settings.encode()).hexdigest()
    joint = {what: joint_digest(paths) for what, paths in files.items() if paths}
    return {**robot_digests(urdf, srdf), **joint, **digests}


def _command_digests(commands: Iterable[object]) -> dict[str, str]:
    """Returns the SHA-256 of each file in the commands of external methods, keyed by a description of the file."""
    paths = [path for command in commands for path in command_files(command)]
    return {f"method file {portable_name(path)}": file_digest(path) for path in paths}


def _value(parameters: Mapping[str, Any], name: str) -> Any:
    software: Any = parameters
    for part in name.strip("/").split("/"):
        software = software.get(part, "") if isinstance(software, Mapping) else ""
    return software


def package_of(node: str) -> str:
    """Returns the ROS package of a running node's program; "" if unknown."""
    try:
        process = process_id(node_address(node), NODE_TIMEOUT_S)
        arguments = Path(f"/proc/{process}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except (OSError, NodeCallError):
        return ""
    program = next((Path(word) for word in arguments if word.startswith("/") and Path(word).parent.name != "bin"), None)
    if program is None:
        return ""
    # Devel and install spaces keep programs in lib/PACKAGE.
    return rospkg.get_package_name(str(program)) or program.parent.name
