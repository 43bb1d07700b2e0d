# SPDX-License-Identifier: BSD-3-Clause
"""Checks the arguments of a launch file before anything is started; roslaunch ignores an unknown one silently."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path

import roslaunch.arg_dump
import roslaunch.config
import roslaunch.core
import roslaunch.substitution_args
import roslaunch.xmlloader
import rospkg

from modular_framework_urdf import xml_text

BOOLEANS = ("true", "false", "1", "0")
"""Texts that roslaunch accepts as a bool, in upper or lower case."""
METHOD, CONFIGURATION = "method_launch_file", "config_directory"
NO_METHOD = ("", "none")
"""Values of METHOD that start no method; roslaunch passes over an argument that is given an empty value."""


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


def check_arguments(path: str, arguments: list[str]) -> None:
    """Refuses arguments that the launch file does not have, and values that name missing files.

    Args:
        path: Launch file.
        arguments: What is given, `name:=value`.

    Raises:
        roslaunch.core.RLException: It names every wrong argument and what was probably meant.
    """
    known = known_arguments(path)
    faults = []
    for argument in arguments:
        name, assignment, value = argument.partition(":=")
        if not assignment:
            faults.append(f"argument '{argument}' is not of the form name:=value")
        elif name not in known:
            faults.append(f"unknown argument '{name}'{_hint(name, known)}; allowed: {', '.join(sorted(known))}")
        elif str(known[name][1]).lower() in BOOLEANS[:2] and value.lower() not in BOOLEANS:
            faults.append(f"argument '{name}' is '{value}', allowed are true and false; correct it")
    if not faults:
        values = argument_values(path, arguments)
        faults = [fault for fault in (_method_fault(values.get(METHOD, "")), _folder_fault(values)) if fault]
    if faults:
        raise roslaunch.core.RLException(f"{path}: " + "; ".join(faults))


def _method_fault(value: str) -> str:
    """Says what is wrong with the launch file of a method; nothing if it is there."""
    if value in NO_METHOD or Path(value).is_absolute() and Path(value).is_file():
        return ""
    allowed = "PACKAGE/FILE with a file in the package's folder launch, the path of a launch file from /, or none"
    fault, package, file = f"argument '{METHOD}' is '{value}', ", *value.partition("/")[::2]
    if Path(value).is_absolute() or not file:
        reason = f"and there is no such file{_path_hint(Path(value))}" if file else "which is no launch file"
        return f"{fault}{reason}; allowed is {allowed}; correct it"
    finder = rospkg.RosPack()
    try:
        folder = Path(finder.get_path(package)) / "launch"
    except rospkg.ResourceNotFound:
        return (
            f"{fault}and there is no package '{package}'{_hint(package, finder.list())}; allowed is {allowed}; "
            "correct it, or build and source the workspace with the package"
        )
    if (folder / file).is_file():
        return ""
    files = sorted(f"{package}/{found.name}" for found in folder.glob("*.launch"))
    return (
        f"{fault}and the package has no such file{_hint(value, files)}; allowed are "
        f"{', '.join(files) or 'files in its folder launch, which is empty'}; correct it"
    )


def _folder_fault(values: dict[str, str]) -> str:
    """Says what is wrong with the folder of the configuration files; nothing if it is there."""
    value = values.get(CONFIGURATION, "")
    if not value or Path(value).is_absolute() and Path(value).is_dir():
        return ""
    return (
        f"argument '{CONFIGURATION}' is '{value}', allowed is the path of a folder from /, such as a copy of the "
        f"folder config of modular_framework_api; correct it{_path_hint(Path(value))}"
    )


def _path_hint(path: Path) -> str:
    """Returns a hint at the path beside a missing one whose name is most like it; empty when there is none."""
    beside = [str(entry) for entry in path.parent.iterdir()] if path.is_absolute() and path.parent.is_dir() else []
    return _hint(str(path), beside)


def _hint(name: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean '{near[0]}'" if near else ""
