# SPDX-License-Identifier: BSD-3-Clause
"""Checks the arguments of a launch file before anything is started; roslaunch ignores an unknown one silently."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import roslaunch.arg_dump
import roslaunch.config
import roslaunch.core
import roslaunch.substitution_args
import roslaunch.xmlloader

from modular_framework_core.files.faults import nearest
from modular_framework_core.launching.launch_values import value_faults
from modular_framework_urdf import xml_text

BOOLEANS = ("true", "false", "1", "0")
"""Texts that roslaunch accepts as a bool, in upper or lower case."""


def argument_values(path: str, arguments: list[str]) -> dict[str, str]:
    """Returns the values of the arguments of a launch file and of those it passes all of them to, defaults included.

    Args:
        path: Launch file.
        arguments: What is given, `name:=value`.
    """
    loader = roslaunch.xmlloader.XmlLoader(resolve_anon=False, args_only=True)
    roslaunch.config.load_config_default([(path, arguments)], None, loader=loader, verbose=False, assign_machines=False)
    values = {name: str(value) for name, value in loader.root_context.resolve_dict["arg"].items()}
    for included in _files_with_all_arguments(path):
        # roslaunch cannot read a value that has an assignment in it
        given = [f"{name}:={value}" for name, value in values.items() if ":=" not in value]
        values = argument_values(included, given) | values
    return values


def known_arguments(path: str) -> dict[str, tuple[str, str | None]]:
    """Returns documentation and default of every argument of a launch file, and of the files it passes all of them to.

    Args:
        path: Launch file.
    """
    known = dict(roslaunch.arg_dump.get_args([path]))
    for included in _files_with_all_arguments(path):
        known = known_arguments(included) | known
    return known


def _files_with_all_arguments(path: str) -> list[str]:
    """Returns the launch files that a launch file includes with all its arguments."""
    try:
        launch = xml_text.read(Path(path))
    except xml_text.XmlError as error:
        raise roslaunch.core.RLException(str(error)) from error
    return [
        roslaunch.substitution_args.resolve_args(include.get("file", ""))
        for include in launch.findall("include")
        if include.get("pass_all_args", "").lower() in ("true", "1")
    ]


def check_arguments(
    path: str, arguments: list[str], faults_of: Callable[[Mapping[str, str]], list[str]] = value_faults
) -> None:
    """Refuses arguments that the launch file does not have, and values that it cannot use.

    Args:
        path: Launch file.
        arguments: What is given, `name:=value`.
        faults_of: Returns what is wrong with the values of all arguments.

    Raises:
        roslaunch.core.RLException: It names every wrong argument and what was probably meant.
    """
    known = known_arguments(path)
    faults = []
    for argument in arguments:
        name, assignment, value = argument.partition(":=")
        if not assignment:
            start, sign, rest = argument.partition("=")
            meant = f"; did you mean '{start}:={rest}'" if sign and start in known else ""
            faults.append(f"argument '{argument}' is not of the form name:=value{meant}")
        elif name not in known:
            faults.append(f"unknown argument '{name}'{nearest(name, known)}; allowed: {', '.join(sorted(known))}")
        elif ":=" in value:
            faults.append(
                f"argument '{name}' is '{value}'; roslaunch takes no value with ':='; make it the default of the "
                "argument in a launch file of your own that includes this one"
            )
        elif str(known[name][1]).lower() in BOOLEANS[:2] and value.lower() not in BOOLEANS:
            faults.append(f"argument '{name}' is '{value}', allowed are true and false; correct it")
    if not faults:
        faults = faults_of(argument_values(path, arguments))
    if faults:
        raise roslaunch.core.RLException(f"{path}: " + "; ".join(faults))
