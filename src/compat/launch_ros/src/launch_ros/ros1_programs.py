# SPDX-License-Identifier: BSD-3-Clause
"""Converts programs of ROS 2 with other names or arguments on ROS 1, with one table of conversion functions."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NoReturn

from launch.core.errors import LaunchError
from launch.core.parameter_plan import Lookup

from launch_ros import ros2_control
from launch_ros.node_parameters import ParameterSource
from launch_ros.ros2_control_hardware import hardware_plan
from launch_ros.rviz_config import ros1_config_file


@dataclass(frozen=True)
class LatePlan:
    """Properties of a node that depend on all parameters of the launch.

    Attributes:
        parameters: Additional parameters of the node.
        namespace_parameters: Additional parameters of the node's namespace.
        simulated_time: Whether the node provides the clock of all nodes.
        program: Package and program that replace the node's program; None to keep it.
    """

    parameters: Mapping[str, Any] = field(default_factory=dict)
    namespace_parameters: Mapping[str, Any] = field(default_factory=dict)
    simulated_time: bool = False
    program: tuple[str, str] | None = None


@dataclass(frozen=True)
class NodePlan:
    """Node to start.

    Attributes:
        package: Package of the program.
        executable: Name of the program.
        namespace: Absolute namespace of the node.
        name: Name of the node; empty if the program sets its own name.
        arguments: Arguments of the program.
        sources: Entries of the node's `parameters`.
        namespace_parameters: Additional parameters of the node's namespace.
        late_plan: Function that is called with a parameter lookup before the parameters are set.
        companions: Additional nodes to start.
    """

    package: str
    executable: str
    namespace: str
    name: str
    arguments: tuple[str, ...] = ()
    sources: tuple[ParameterSource, ...] = ()
    namespace_parameters: Mapping[str, Any] = field(default_factory=dict)
    late_plan: Callable[[Lookup], LatePlan] | None = None
    companions: tuple[NodePlan, ...] = ()


def ros1_plan(plan: NodePlan) -> NodePlan:
    """Returns the ROS 1 node that replaces a ROS 2 node; other nodes are not changed.

    Raises:
        LaunchError: The node has arguments that the ROS 1 node does not support.
    """
    translate = ROS1_PROGRAMS.get((plan.package, plan.executable))
    return plan if translate is None else translate(plan)


def _rviz(plan: NodePlan) -> NodePlan:
    """Converts RViz; with MoveIt's parameters, a node with the goal marker, which ROS 2 has in RViz, is added."""
    given = {name for source in plan.sources for name in source.content}
    patience = ParameterSource({"connection_timeout": MARKER_TIMEOUT_S})
    program = "interactive_goal"
    marker = NodePlan("modular_framework_planning", program, plan.namespace, program, sources=(patience,))
    companions = (marker,) if "robot_description_semantic" in given else ()
    return replace(_rviz_ros1(plan), package="rviz", executable="rviz", companions=companions)


def _rviz_ros1(plan: NodePlan) -> NodePlan:
    """Converts RViz's configuration to ROS 1."""
    arguments: list[str] = []
    for argument in plan.arguments:
        option, equals, value = argument.partition("=")
        if arguments and arguments[-1] in RVIZ_CONFIG:
            arguments.append(str(ros1_config_file(Path(argument))))
        elif equals and option in RVIZ_CONFIG:
            arguments.append(f"{option}={ros1_config_file(Path(value))}")
        else:
            arguments.append(argument)
    return replace(plan, arguments=tuple(arguments))


RVIZ_CONFIG = ("-d", "--display-config")
SIMULATION = ("modular_framework_simulation", "simulation")
MARKER_TIMEOUT_S = 300.0
"""Timeout of the goal marker's connection to move_group [s], whose first start compiles its kernels."""
_TRANSFORM_DEFAULTS = {"--x": "0", "--y": "0", "--z": "0", "--yaw": "0", "--pitch": "0", "--roll": "0"}
_QUATERNION = ("--qx", "--qy", "--qz", "--qw")


def _static_transform(plan: NodePlan) -> NodePlan:
    """Converts named arguments to position, angles or quaternion, parent frame and child frame."""
    if not any(argument.startswith("--") for argument in plan.arguments):
        return plan
    names = [*_TRANSFORM_DEFAULTS, *_QUATERNION, "--frame-id", "--child-frame-id"]
    parser = _Parser("static_transform_publisher")
    for name in names:
        parser.add_argument(name, required=name.endswith("frame-id"))
    given = vars(parser.parse_args(_joined_negative_numbers(plan.arguments)))
    values = {name: given[name.strip("-").replace("-", "_")] for name in names}
    position = [values[name] or "0" for name in ("--x", "--y", "--z")]
    angles = [values[name] for name in ("--yaw", "--pitch", "--roll")]
    quaternion = [values[name] for name in _QUATERNION]
    if any(quaternion) and any(angles):
        raise LaunchError("static_transform_publisher: got angles and a quaternion; allowed: angles or a quaternion")
    rotation = [value or default for value, default in zip(quaternion, "0001", strict=True)]
    rotation = rotation if any(quaternion) else [value or "0" for value in angles]
    return replace(plan, arguments=(*position, *rotation, values["--frame-id"], values["--child-frame-id"]))


def _control_node(plan: NodePlan) -> NodePlan:
    """Converts the node with hardware and controller manager; the robot description names the hardware.

    If the hardware is simulated, the simulation replaces the program, because it contains the controller manager.
    """
    name = plan.name or "controller_manager"
    private = ros2_control.manager_parameters(plan.sources, plan.namespace, name)
    controllers = ros2_control.controller_parameters(plan.sources)

    def late_plan(lookup: Lookup) -> LatePlan:
        hardware = hardware_plan(lookup, plan.namespace, private, controllers)
        program = SIMULATION if hardware.simulated else None
        return LatePlan(hardware.parameters, hardware.namespace_parameters, hardware.simulated, program)

    return replace(
        plan,
        package="modular_framework_control",
        executable="robot_hw",
        name=name,
        sources=(ParameterSource(private),),
        namespace_parameters=controllers,
        late_plan=late_plan,
    )


def _spawner(plan: NodePlan) -> NodePlan:
    """Converts the spawner, which loads and starts controllers; with --unload-on-kill, it unloads them at its exit."""
    parser = _Parser("spawner")
    parser.add_argument("controller_names", nargs="+")
    parser.add_argument("-c", "--controller-manager", default="controller_manager")
    parser.add_argument("-p", "--param-file", action="append", default=[])
    parser.add_argument("-t", "--controller-type")
    parser.add_argument("-n", "--namespace")
    for flag in ("--load-only", "--stopped", "--inactive", "--unload-on-kill", "-u", "--activate-as-group"):
        parser.add_argument(flag, action="store_true")
    for number in ("--controller-manager-timeout", "--switch-timeout", "--service-call-timeout"):
        parser.add_argument(number, type=float, default=0.0)
    given = parser.parse_args(list(plan.arguments))
    namespace = ros2_control.namespace_of_manager(given.controller_manager, given.namespace or plan.namespace)
    waiting = given.controller_manager_timeout
    options = ["--namespace", namespace, *(["--timeout", f"{waiting:g}"] if waiting > 0.0 else ["--no-timeout"])]
    files = tuple(ros2_control.source_of(path) for path in given.param_file)
    types = dict.fromkeys(given.controller_names, given.controller_type) if given.controller_type else {}
    parameters = ros2_control.controller_parameters(files, types)
    for name, type_name in types.items():
        parameters.setdefault(name, {"type": ros2_control.ros1_type(type_name, {})})
    inactive = given.load_only or given.stopped or given.inactive
    if given.unload_on_kill or given.u:
        executable, command = "spawner", [*options, *(["--stopped"] if inactive else [])]
    else:
        executable, command = "controller_manager", [*options, "load" if inactive else "spawn"]
    return replace(
        plan,
        package="controller_manager",
        executable=executable,
        namespace=namespace,
        arguments=(*command, *given.controller_names),
        namespace_parameters=parameters,
    )


def _unspawner(plan: NodePlan) -> NodePlan:
    """Converts the unspawner, which stops and unloads controllers."""
    parser = _Parser("unspawner")
    parser.add_argument("controller_names", nargs="+")
    parser.add_argument("-c", "--controller-manager", default="controller_manager")
    given = parser.parse_args(list(plan.arguments))
    namespace = ros2_control.namespace_of_manager(given.controller_manager, plan.namespace)
    arguments = ("--namespace", namespace, "kill", *given.controller_names)
    return replace(plan, executable="controller_manager", arguments=arguments)


ROS1_PROGRAMS: Mapping[tuple[str, str], Callable[[NodePlan], NodePlan]] = {
    ("rviz2", "rviz2"): _rviz,
    ("rviz", "rviz"): _rviz_ros1,
    ("tf2_ros", "static_transform_publisher"): _static_transform,
    ("controller_manager", "ros2_control_node"): _control_node,
    ("controller_manager", "spawner"): _spawner,
    ("controller_manager", "spawner.py"): _spawner,
    ("controller_manager", "unspawner"): _unspawner,
}
"""Conversion functions, by package and program of ROS 2."""


class _Parser(argparse.ArgumentParser):
    """Argument parser of a node that raises LaunchError."""

    def __init__(self, program: str) -> None:
        super().__init__(prog=program, add_help=False, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        raise LaunchError(f"{self.prog}: {message}; allowed: {' '.join(self.format_usage().split()[2:])}")


def _joined_negative_numbers(arguments: Sequence[str]) -> list[str]:
    """Joins `--x -1e-3` to `--x=-1e-3`, because argparse would parse the number as an option."""
    joined: list[str] = []
    for argument in arguments:
        if joined and joined[-1].startswith("--") and "=" not in joined[-1] and not argument.startswith("--"):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined
