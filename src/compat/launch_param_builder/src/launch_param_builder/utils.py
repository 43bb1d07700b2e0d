# SPDX-License-Identifier: BSD-3-Clause
"""Loads files into parameters: YAML, xacro and plain text. The module has the name it has in ROS 2."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import xacro
import yaml
from xacro_rospkg import PackageNotFoundError, expand
from xacro_rospkg.expansion import find_package

from launch_param_builder.angle_yaml import parse_yaml

MOST_NAMES = 20  # of files that an error lists
ParameterValueType = str | int | float | bool | list[Any] | dict[str, Any]


class ParameterBuilderFileNotFoundError(KeyError):
    """A file that was to be loaded does not exist."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class ParameterFileError(RuntimeError):
    """A file, or the package it is in, cannot be used; the message names it, and the line where there is one."""


def package_folder(package: str) -> Path:
    """Returns the folder of a ROS package.

    Raises:
        ParameterFileError: it is not on ROS_PACKAGE_PATH; names packages with a similar name.
    """
    try:
        return Path(find_package(package))
    except PackageNotFoundError as error:
        hint = f"did you mean {' or '.join(error.similar)}?" if error.similar else "nothing there has a similar name."
        raise ParameterFileError(
            f"no ROS package '{package}' on ROS_PACKAGE_PATH; {hint} "
            "If the name is right, source the setup.bash of the workspace that has the package."
        ) from error


def raise_if_file_not_found(file_path: Path | str) -> None:
    """Raises ParameterBuilderFileNotFoundError for a file that does not exist; it names files beside it."""
    path = Path(file_path)
    if path.is_file():
        return
    if path.is_dir():
        raise ParameterBuilderFileNotFoundError(f"{path} is a folder; a file is needed")
    folder = next((parent for parent in path.parents if parent.is_dir()), Path("/"))
    names = sorted(each.name for each in folder.iterdir())
    if folder != path.parent or len(names) > MOST_NAMES:
        names = difflib.get_close_matches(path.name if folder == path.parent else path.parent.name, names, MOST_NAMES)
    hint = f"{folder} has {', '.join(names)}" if names else f"{folder} has nothing of a similar name"
    raise ParameterBuilderFileNotFoundError(f"File {path} doesn't exist; {hint}")


def load_file(file_path: Path | str) -> str:
    """Returns the text of a file.

    Raises:
        ParameterBuilderFileNotFoundError: there is none.
        ParameterFileError: it cannot be read as UTF-8.
    """
    raise_if_file_not_found(file_path)
    try:
        return Path(file_path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterFileError(f"{file_path}: cannot be read as text ({error})") from error


def load_yaml(file_path: Path | str) -> dict[str, Any]:
    """Returns the parameters in a YAML file; none for an empty one.

    Raises:
        ParameterBuilderFileNotFoundError: there is no such file.
        ParameterFileError: it is not valid YAML, or no mapping.
    """
    return parse_parameters(load_file(file_path), file_path)


def parse_parameters(text: str, file_path: Path | str) -> dict[str, Any]:
    """Returns the parameters in the text of a YAML file; none for an empty one.

    Entries without a value are left out and names are texts, since ROS 1's parameter server takes nothing else.

    Args:
        text: of the file.
        file_path: the file, for messages.

    Raises:
        ParameterFileError: it is not valid YAML, or no mapping.
    """
    try:
        content = parse_yaml(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        reason = getattr(error, "problem", None) or str(error)
        raise ParameterFileError(f"{file_path}{where}: is not valid YAML: {reason}") from error
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise ParameterFileError(
            f"{file_path}:1: holds a {type(content).__name__}; a mapping of parameter names to values is needed"
        )
    parameters: dict[str, Any] = _settable(content)
    return parameters


def _settable(value: Any) -> Any:
    """Returns a value of YAML as the parameter server can hold it."""
    match value:
        case dict():
            return {str(key): _settable(item) for key, item in value.items() if item is not None}
        case list():
            return [_settable(item) for item in value if item is not None]
        case str() | bool() | int() | float():
            return value
    return str(value)  # a date


def load_xacro(file_path: Path | str, mappings: Mapping[str, Any] | None = None) -> str:
    """Returns the XML that a xacro file expands to.

    Args:
        file_path: xacro file, or plain XML.
        mappings: values of its arguments.

    Raises:
        ParameterBuilderFileNotFoundError: there is no such file.
        ParameterFileError: xacro refuses it, or a package it names is not found.
    """
    raise_if_file_not_found(file_path)
    try:
        return expand(file_path, mappings)
    except (PackageNotFoundError, xacro.XacroException, OSError, ValueError) as error:
        raise ParameterFileError(f"{file_path}: xacro cannot expand it: {error}") from error
    except xacro.xml.parsers.expat.ExpatError as error:
        raise ParameterFileError(f"{file_path}: is not valid XML: {error}") from error


def get_path(package_name: str, file_path: str) -> str:
    """Returns the path of a file of a package, which need not exist."""
    return str(package_folder(package_name) / file_path)
