# SPDX-License-Identifier: BSD-3-Clause
"""Loads parameters from YAML, xacro and text files. The module has the same name as in ROS 2."""

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

MAX_LISTED_FILES = 20  # maximum number of files listed in an error message
ParameterValueType = str | int | float | bool | list[Any] | dict[str, Any]


class ParameterBuilderFileNotFoundError(KeyError):
    """A file to load does not exist."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class ParameterFileError(RuntimeError):
    """A file or package cannot be used; the message contains the name and, if known, the line."""


def package_folder(package: str) -> Path:
    """Returns the folder of a ROS package.

    Raises:
        ParameterFileError: The package is not on ROS_PACKAGE_PATH; the message contains similar names.
    """
    try:
        return Path(find_package(package))
    except PackageNotFoundError as error:
        hint = f"did you mean {' or '.join(error.similar)}?" if error.similar else "no package has a similar name."
        raise ParameterFileError(
            f"no ROS package '{package}' on ROS_PACKAGE_PATH; {hint} "
            "If the name is right, source the setup.bash of the workspace that has the package."
        ) from error


def raise_if_file_not_found(file_path: Path | str) -> None:
    """Raises ParameterBuilderFileNotFoundError for a missing file; the message lists files of the same folder."""
    path = Path(file_path)
    if path.is_file():
        return
    if path.is_dir():
        raise ParameterBuilderFileNotFoundError(f"{path} is a folder; give a file")
    folder = next((parent for parent in path.parents if parent.is_dir()), Path("/"))
    names = sorted(each.name for each in folder.iterdir())
    if folder != path.parent or len(names) > MAX_LISTED_FILES:
        names = difflib.get_close_matches(
            path.name if folder == path.parent else path.parent.name, names, MAX_LISTED_FILES
        )
    hint = f"{folder} has {', '.join(names)}" if names else f"{folder} has no file with a similar name"
    raise ParameterBuilderFileNotFoundError(f"File {path} doesn't exist; {hint}")


def load_file(file_path: Path | str) -> str:
    """Returns the text of a file.

    Raises:
        ParameterBuilderFileNotFoundError: The file does not exist.
        ParameterFileError: The file is not readable as UTF-8.
    """
    raise_if_file_not_found(file_path)
    try:
        return Path(file_path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterFileError(f"{file_path}: cannot be read as text ({error})") from error


def load_yaml(file_path: Path | str) -> dict[str, Any]:
    """Returns the parameters of a YAML file; an empty file has no parameters.

    Raises:
        ParameterBuilderFileNotFoundError: The file does not exist.
        ParameterFileError: The file is not valid YAML or not a mapping.
    """
    return parse_parameters(load_file(file_path), file_path)


def parse_parameters(text: str, file_path: Path | str) -> dict[str, Any]:
    """Returns the parameters in the text of a YAML file; an empty text has no parameters.

    Entries without a value are omitted and keys become strings, as the parameter server of ROS 1 requires.

    Args:
        text: Text of the file.
        file_path: Path of the file, for messages.

    Raises:
        ParameterFileError: The text is not valid YAML or not a mapping.
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
            f"{file_path}:1: contains a {type(content).__name__}; it must be a mapping of parameter names to values"
        )
    parameters: dict[str, Any] = _parameter_value(content)
    return parameters


def _parameter_value(value: Any) -> Any:
    """Returns a YAML value converted to the types of the parameter server."""
    match value:
        case dict():
            return {str(key): _parameter_value(item) for key, item in value.items() if item is not None}
        case list():
            return [_parameter_value(item) for item in value if item is not None]
        case str() | bool() | int() | float():
            return value
    return str(value)  # a date


def load_xacro(file_path: Path | str, mappings: Mapping[str, Any] | None = None) -> str:
    """Returns the XML of an expanded xacro file.

    Args:
        file_path: Path of a xacro or XML file.
        mappings: Values of the xacro arguments.

    Raises:
        ParameterBuilderFileNotFoundError: The file does not exist.
        ParameterFileError: The file is not valid xacro, or refers to a missing package.
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
