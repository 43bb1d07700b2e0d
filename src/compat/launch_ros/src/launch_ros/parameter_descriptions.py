# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of nodes in launch files: typed values, single parameters, and YAML files."""

from __future__ import annotations

import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from launch.core.errors import LaunchError, hint
from launch.core.launch_context import LaunchContext
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.substitution import Substitution
from launch.core.utilities import normalize_to_list_of_substitutions, perform_boolean, perform_text

__all__ = ["Parameter", "ParameterFile", "ParameterValue"]

SCALARS = (bool, int, float, str)


class ParameterValue:
    """Value with a type.

    Args:
        value: The value, or its substitutions.
        value_type: bool, int, float, str, or a list of one of these (`List[float]`); None for the type given by YAML.
    """

    def __init__(self, value: Any, *, value_type: Any = None) -> None:
        self._value = value
        self._type = value_type

    @property
    def value(self) -> Any:
        """Returns the value, or its substitutions."""
        return self._value

    @property
    def value_type(self) -> Any:
        """Returns the type."""
        return self._type

    def evaluate(self, context: LaunchContext) -> Any:
        """Returns the value.

        Raises:
            LaunchError: The value does not have the type.
        """
        return evaluate_value(context, self._value, self._type, "the ParameterValue")


class Parameter:
    """Single parameter.

    Args:
        name: Name of the parameter.
        value: Value of the parameter, or its substitutions.
        value_type: Type of the value, see `ParameterValue`.
    """

    def __init__(self, name: SomeSubstitutionsType, value: Any, *, value_type: Any = None) -> None:
        self._name = normalize_to_list_of_substitutions(name)
        self._value = ParameterValue(value, value_type=value_type)

    def evaluate(self, context: LaunchContext) -> tuple[str, Any]:
        """Returns the name and the value."""
        return perform_text(context, self._name), self._value.evaluate(context)


class ParameterFile:
    """YAML file with parameters.

    Args:
        param_file: Path of the file.
        allow_substs: Whether the file contains substitutions of XML launch files, `$(var name)`; not supported.
    """

    def __init__(self, param_file: Any, *, allow_substs: Any = False) -> None:
        self._file = str(param_file) if isinstance(param_file, Path) else param_file
        self._allow_substs = allow_substs

    def path(self, context: LaunchContext) -> Path:
        """Returns the path.

        Raises:
            LaunchError: Substitutions in the file are requested.
        """
        path = Path(perform_text(context, self._file))
        if perform_boolean(context, self._allow_substs, "allow_substs of ParameterFile"):
            raise LaunchError(
                f"{path}: allow_substs=True is not supported; allowed: False; move the varying values to a dict after "
                "the file"
            )
        return path

    def evaluate(self, context: LaunchContext) -> Mapping[str, Any]:
        """Returns the parameters in the file."""
        return read_yaml_mapping(self.path(context))


def read_yaml_mapping(path: Path) -> dict[str, Any]:
    """Returns the mapping in a YAML file.

    Raises:
        LaunchError: The file cannot be read or is not a mapping; the message contains the line.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        beside = [str(each) for each in path.parent.iterdir()] if path.parent.is_dir() else []
        raise LaunchError(f"parameter file {path} cannot be read: {error}{hint(str(path), beside)}") from None
    except yaml.YAMLError as error:
        raise LaunchError(f"parameter file {path} is not valid YAML: {error}") from None
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise LaunchError(f"parameter file {path} contains {content!r}; allowed: names with values, 'name: value'")
    return content


def evaluate_value(context: LaunchContext, value: Any, value_type: Any, label: str) -> Any:
    """Returns a value with its substitutions performed.

    Texts from substitutions are parsed as YAML, as in ROS 2, unless `value_type` is str; XML remains a text. A list of
    texts and substitutions is a single text; a list value needs a nested list per element.

    Args:
        context: Launch context.
        value: Value in the launch file.
        value_type: Type of the value, see `ParameterValue`.
        label: Name of the value for messages.

    Raises:
        LaunchError: The value is not a valid parameter value, or does not have the type.
    """
    if isinstance(value, ParameterValue):
        return value.evaluate(context)
    if isinstance(value, Substitution) or _is_single_text(value):
        return _parsed_value(perform_text(context, value), value_type, label)
    if isinstance(value, Mapping):
        return {
            perform_text(context, key): evaluate_value(context, inner, None, f"{label}/{key}")
            for key, inner in value.items()
        }
    if isinstance(value, list | tuple):
        return _with_uniform_type([evaluate_value(context, inner, None, label) for inner in value])
    if value_type is not None and isinstance(value, str):
        return _parsed_value(value, value_type, label)
    return _converted_value(value, value_type, label) if value_type is not None else value


def _is_single_text(value: Any) -> bool:
    if not isinstance(value, list | tuple) or not value:
        return False
    return all(isinstance(each, str | Substitution) for each in value) and any(
        isinstance(each, Substitution) for each in value
    )


def _with_uniform_type(values: list[Any]) -> list[Any]:
    """Converts integers in a list with floating-point numbers, so that the list has one type."""
    numbers = all(isinstance(each, int | float) and not isinstance(each, bool) for each in values)
    if numbers and any(isinstance(each, float) for each in values):
        return [float(each) for each in values]
    return values


def _parsed_value(text: str, value_type: Any, label: str) -> Any:
    """Parses a text as a value."""
    if value_type is str:
        return text
    if value_type is None and text.lstrip().startswith("<"):  # YAML could misinterpret XML
        return text
    try:
        value = yaml.safe_load(text) if text else ""
    except yaml.YAMLError as error:
        raise LaunchError(
            f"{label} is {_short(text)}, which is not valid YAML: {error}; to keep the text, write "
            "ParameterValue(..., value_type=str)"
        ) from None
    if value_type is not None:
        return _converted_value(value, value_type, label)
    if value is None or isinstance(value, Mapping):
        raise LaunchError(
            f"{label} is {_short(text)}, which YAML parses as {'nothing' if value is None else 'a mapping'}; to keep "
            "the text, write ParameterValue(..., value_type=str)"
        )
    return value


def _converted_value(value: Any, value_type: Any, label: str) -> Any:
    """Converts a value to a type."""
    if typing.get_origin(value_type) is list:
        inner = typing.get_args(value_type)[0]
        if isinstance(value, list | tuple):
            return [_converted_value(each, inner, label) for each in value]
    elif value_type not in SCALARS:
        names = ", ".join(each.__name__ for each in SCALARS)
        raise LaunchError(f"{label}: value_type is {value_type!r}; allowed: {names}, and lists of these (List[float])")
    elif value_type is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    elif isinstance(value, value_type) and not (value_type is int and isinstance(value, bool)):
        return value
    type_name = getattr(value_type, "__name__", value_type) if value_type in SCALARS else value_type
    raise LaunchError(f"{label} is {_short(value)} of type {type(value).__name__}; allowed: {type_name}; correct it")


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
