# SPDX-License-Identifier: BSD-3-Clause
"""Finds missing programs, and entries and values that the nodes of a launch would refuse or ignore at run time."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import rospkg
from catkin.find_in_workspaces import find_in_workspaces
from roslib.packages import find_node

from modular_framework_benchmark.experiments.ros_resource_lookup import models_of_world
from modular_framework_benchmark.launch_checks.ros_robot_names import RobotNames
from modular_framework_benchmark.predicates.conditions import REGIONS
from modular_framework_core.files.yaml_entries import EntryError
from modular_framework_core.launching.ros_declared_names import LaunchFault
from modular_framework_core.launching.ros_launch_preview import LaunchedNode, LaunchPreview
from modular_framework_core.managers.named_joint_states import NamedJointState, load_joint_states
from modular_framework_core.managers.named_poses import load_poses
from modular_framework_core.managers.named_trajectories import load_trajectories
from modular_framework_core.scene.sensor_frames import load_sensor_frames
from modular_framework_core.task_constructor.known_names import (
    JOINT_STATES_FILE,
    MODEL_PATH,
    POSES_FILE,
    TRAJECTORIES_FILE,
)
from modular_framework_core.task_runner.manipulator_links import manipulator_links
from modular_framework_planning.perception.sensor_settings import read_sensors
from modular_framework_ros.allowed_names import closest, listing, nearest
from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.gazebo_ros.starting_pose import parse_starting_pose

SENSOR_FRAMES, MOVE_GROUP, SIMULATION = "sensors_tf2_broadcaster", "move_group", "simulation"
ARGUMENTS = "arguments"


def program_faults(nodes: Iterable[LaunchedNode]) -> Iterator[LaunchFault]:
    """Yields a fault for each node of this machine whose package or program does not exist.

    roslaunch would start the other nodes.
    """
    packages = rospkg.RosPack.get_instance()
    for node in nodes:
        if node.machine:
            continue
        start = f"node '{node.name}':"
        try:
            program = find_node(node.package, node.executable, packages)
        except rospkg.ResourceNotFound:
            yield LaunchFault(
                "", f"{start} there is no package '{node.package}'{nearest(node.package, packages.list())}"
            )
            continue
        if not program:
            programs = _programs(node.package, packages)
            hint = f"{listing(programs)}{nearest(node.executable, programs)}"
            yield LaunchFault("", f"{start} package '{node.package}' has no program '{node.executable}'; {hint}")


def sensor_faults(launch: LaunchPreview) -> Iterator[LaunchFault]:
    """Yields the invalid sensors of the octomap and of the sensor frames, which the nodes would ignore."""
    for node in launch.nodes:
        if node.executable == MOVE_GROUP:
            name = f"{node.name}/sensors"
            sensors = launch.parameters.get(name)
            faults = read_sensors(sensors, None)[1] if sensors is not None else []
            yield from (LaunchFault(name, text) for text in faults)
        elif node.executable == SENSOR_FRAMES and node.arguments:
            path = Path(node.arguments.split()[0])
            stored = {pose.name: pose for pose in load_poses(path.parent / POSES_FILE)[0]}
            yield from (LaunchFault("", str(error)) for error in load_sensor_frames(path, stored.get)[1])


def argument_faults(launch: LaunchPreview, robot: RobotNames) -> Iterator[LaunchFault]:
    """Yields invalid regions, starting poses and manipulator prefixes."""
    yield from _region_faults(launch)
    for node in launch.nodes:
        if node.executable == SIMULATION:
            yield from _starting_pose_faults(str(launch.parameters.get(f"{node.name}/starting_pose") or ""), robot)
    name = "manipulator_prefix"
    prefix = str(launch.parameters.get(f"/{name}") or "")
    if prefix and robot.links and not manipulator_links(robot.links, prefix):
        hint = f"no link name contains it; the links are: {', '.join(robot.links)}"
        yield LaunchFault(name, f"argument '{name}' is '{prefix}', but {hint}", ARGUMENTS)


def robot_model(launch: LaunchPreview, robot: RobotNames) -> str:
    """Returns the name of the robot among the models of the simulation; empty without a simulated robot."""
    node = next((node for node in launch.nodes if node.executable == SIMULATION), None)
    return "" if node is None else str(launch.parameters.get(f"{node.name}/robot_name") or robot.robot)


def models_of_launch(launch: LaunchPreview) -> tuple[str, ...] | None:
    """Returns the models of the simulated world; None without a simulation, or if the world file is not found.

    Raises:
        UnreadableWorld: The world file is invalid.
    """
    node = next((node for node in launch.nodes if node.executable == SIMULATION), None)
    file = Path(str(launch.parameters.get(f"{node.name}/world_file") or "")) if node is not None else Path()
    if not file.is_absolute() or not file.is_file():
        return None
    return tuple(models_of_world(file, str(launch.parameters.get(MODEL_PATH) or "")))


def _region_faults(launch: LaunchPreview) -> Iterator[LaunchFault]:
    regions = launch.parameters.get(REGIONS, launch.below(REGIONS))
    named = regions if isinstance(regions, Mapping) else {"": regions}
    for region, spans in named.items():
        if not _is_region(spans):
            place = f"region '{region}'" if region else "the value"
            text = f"argument 'regions': {place} is {spans!r}; allowed: spans [LOW, HIGH] [m] with LOW < HIGH, such as"
            yield LaunchFault("regions", f"{text} {{NAME: {{x: [0.1, 0.2], y: [0.4, 0.5]}}}}", ARGUMENTS)


def _starting_pose_faults(text: str, robot: RobotNames) -> Iterator[LaunchFault]:
    name = "simulation_starting_pose"
    try:
        unknown = [joint for joint in parse_starting_pose(text) if robot.joints and joint not in robot.joints]
    except DescriptionError as error:
        yield LaunchFault(name, f"argument '{name}': {error}", ARGUMENTS)
        return
    for joint in unknown:
        hint = f"{listing(robot.movable_joints)}{nearest(joint, robot.movable_joints)}"
        yield LaunchFault(name, f"argument '{name}' names no joint: '{joint}'; {hint}", ARGUMENTS)


def named_entry_faults(folder: Path, joints: Collection[str]) -> Iterator[str]:
    """Yields a sentence for each invalid named joint state, pose and trajectory, and for each unknown joint of a state.

    A state without any joint similar to the robot's joints is for a different robot, and its joints are not checked.

    Args:
        folder: Configuration folder; a missing file has no entries.
        joints: Joint names of the robot; empty if unknown.
    """
    path = folder / JOINT_STATES_FILE
    states, faults = load_joint_states(path) if path.is_file() else ([], [])
    yield from map(str, faults)
    yield from _unknown_joints(path, states, joints)
    if (folder / POSES_FILE).is_file():
        yield from map(str, load_poses(folder / POSES_FILE)[1])
    if path.is_file() and (folder / TRAJECTORIES_FILE).is_file():
        yield from map(str, _trajectory_faults(folder / TRAJECTORIES_FILE, states))


def _unknown_joints(path: Path, states: Iterable[NamedJointState], joints: Collection[str]) -> Iterator[str]:
    for state in states:
        if any(name in joints or closest(name, joints) for name in state.joint_names):
            for name in state.joint_names:
                if name not in joints:
                    hint = f"{listing(joints)}{nearest(name, joints)}"
                    yield f"{path}: '{state.name}' names no joint: '{name}'; {hint}"


def _trajectory_faults(path: Path, states: Iterable[NamedJointState]) -> list[EntryError]:
    positions = {state.name: dict(zip(state.joint_names, state.positions, strict=True)) for state in states}
    return load_trajectories(path, positions.get, positions)[1]


def _programs(package: str, packages: rospkg.RosPack) -> list[str]:
    """Returns the names of the programs of a package, installed and in its source folders."""
    source = Path(packages.get_path(package))
    folders = [*map(Path, find_in_workspaces(["libexec"], package)), source / "nodes", source / "scripts"]
    files = (file for folder in folders if folder.is_dir() for file in folder.iterdir())
    return sorted({file.name for file in files if file.is_file() and file.stat().st_mode & 0o111})


def _is_region(spans: Any) -> bool:
    """Returns whether a value is a box: a mapping of x, y or z to [LOW, HIGH]."""
    return isinstance(spans, Mapping) and bool(spans) and {*spans} <= {*"xyz"} and all(map(_is_span, spans.values()))


def _is_span(span: Any) -> bool:
    """Returns whether a value is a list of two finite numbers in order; true and false are no numbers."""
    if not (isinstance(span, list) and len(span) == 2 and all(type(value) in (int, float) for value in span)):
        return False
    return -math.inf < span[0] < span[1] < math.inf
