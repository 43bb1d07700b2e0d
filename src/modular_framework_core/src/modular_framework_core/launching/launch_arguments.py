# SPDX-License-Identifier: BSD-3-Clause
"""Checks the arguments of a launch file before anything starts, because roslaunch ignores unknown arguments."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

import roslaunch.arg_dump
import roslaunch.config
import roslaunch.core
import roslaunch.substitution_args
import roslaunch.xmlloader

from modular_framework_core.launching.launch_values import value_faults
from modular_framework_ros.allowed_names import nearest
from modular_framework_urdf import xml_text

BOOLEAN_TEXTS = ("true", "false", "1", "0")
"""Texts that roslaunch accepts as a bool, case-insensitive."""


class ArgumentError(roslaunch.core.RLException):  # type: ignore[misc]
    """Arguments of a launch file are invalid.

    Attributes:
        faults: One sentence per fault.
    """

    def __init__(self, path: str, faults: Sequence[str]) -> None:
        super().__init__(f"{path}: {'; '.join(faults)}")
        self.faults = tuple(faults)


def argument_values(path: str, arguments: list[str]) -> dict[str, str]:
    """Returns the argument values of a launch file and of files included with `pass_all_args`, including defaults.

    Args:
        path: Launch file.
        arguments: Given arguments, `name:=value`.
    """
    loader = roslaunch.xmlloader.XmlLoader(resolve_anon=False, args_only=True)
    roslaunch.config.load_config_default([(path, arguments)], None, loader=loader, verbose=False, assign_machines=False)
    values = {name: str(value) for name, value in loader.root_context.resolve_dict["arg"].items()}
    for included in _files_with_all_arguments(path):
        # roslaunch cannot read a value that contains ":="
        passed_arguments = [f"{name}:={value}" for name, value in values.items() if ":=" not in value]
        values = argument_values(included, passed_arguments) | values
    return values


def known_arguments(path: str) -> dict[str, tuple[str, str | None]]:
    """Returns (documentation, default) of the arguments of a launch file and of files included with `pass_all_args`."""
    arguments = dict(roslaunch.arg_dump.get_args([path]))
    for included in _files_with_all_arguments(path):
        arguments = known_arguments(included) | arguments
    return arguments


def _files_with_all_arguments(path: str) -> list[str]:
    """Returns the launch files that a launch file includes with `pass_all_args`."""
    try:
        launch = xml_text.read(Path(path))
    except xml_text.XmlError as error:
        raise roslaunch.core.RLException(str(error)) from error
    return [
        roslaunch.substitution_args.resolve_args(include.get("file", ""))
        for include in launch.findall("include")
        if include.get("pass_all_args", "").lower() in ("true", "1")
    ]


def unknown_argument(name: str, known_names: Collection[str]) -> str:
    """Returns the fault of an argument that the launch file does not have.

    Args:
        name: Name of the argument.
        known_names: Names of the launch file's arguments.
    """
    return f"unknown argument '{name}'{nearest(name, known_names)}; allowed: {', '.join(sorted(known_names))}"


def check_arguments(
    path: str, arguments: list[str], faults_of: Callable[[Mapping[str, str]], list[str]] = value_faults
) -> None:
    """Checks that the launch file has the given arguments and that their values are allowed.

    Args:
        path: Launch file.
        arguments: Given arguments, `name:=value`.
        faults_of: Function that returns the faults in the values of all arguments.

    Raises:
        ArgumentError: Arguments are unknown or invalid; the message names all of them.
    """
    arguments_of_file = known_arguments(path)
    faults = []
    for argument in arguments:
        name, assignment, value = argument.partition(":=")
        if not assignment:
            start, sign, end = argument.partition("=")
            hint = f"; did you mean '{start}:={end}'" if sign and start in arguments_of_file else ""
            faults.append(f"argument '{argument}' is not of the form name:=value{hint}")
        elif name not in arguments_of_file:
            faults.append(unknown_argument(name, arguments_of_file))
        elif ":=" in value:
            faults.append(
                f"argument '{name}' is '{value}'; roslaunch does not support values with ':='; make it the default of "
                "the argument in a launch file of your own that includes this file"
            )
        elif str(arguments_of_file[name][1]).lower() in BOOLEAN_TEXTS[:2] and value.lower() not in BOOLEAN_TEXTS:
            faults.append(f"argument '{name}' is '{value}'; it must be true or false")
    if not faults:
        faults = faults_of(argument_values(path, arguments))
    if faults:
        raise ArgumentError(path, faults)


def load_error_text(error: Exception, path: str, arguments: list[str]) -> str:
    """Returns why a launch file cannot be loaded. For the robot description, roslaunch names only the command.

    Args:
        error: Error of roslaunch.
        path: Launch file.
        arguments: Given arguments, `name:=value`.
    """
    values = argument_values(path, arguments) if "command parameter [robot_description]" in str(error) else {}
    if "robot_urdf_file" not in values:
        return str(error)
    return (
        f"argument 'robot_urdf_file' is '{values['robot_urdf_file']}', which xacro cannot expand with urdf_args "
        f"'{values.get('urdf_args')}'; its error is above"
    )
