# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of nodes as a launch file writes them: values with a type, single parameters, YAML files."""

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
    """A value with a type.

    Args:
        value: The value, or substitutions for it.
        value_type: bool, int, float, str, or a list of one of these (`List[float]`); None for what YAML makes of it.
    """

    def __init__(self, value: Any, *, value_type: Any = None) -> None:
        self._value = value
        self._type = value_type

    @property
    def value(self) -> Any:
        """The value as it was given."""
        return self._value

    @property
    def value_type(self) -> Any:
        """Its type."""
        return self._type

    def evaluate(self, context: LaunchContext) -> Any:
        """Returns the value.

        Raises:
            LaunchError: It is not of the type.
        """
        return evaluate_value(context, self._value, self._type, "the ParameterValue")


class Parameter:
    """A parameter.

    Args:
        name: Its name.
        value: Its value, or substitutions for it.
        value_type: As of ParameterValue.
    """

    def __init__(self, name: SomeSubstitutionsType, value: Any, *, value_type: Any = None) -> None:
        self._name = normalize_to_list_of_substitutions(name)
        self._value = ParameterValue(value, value_type=value_type)

    def evaluate(self, context: LaunchContext) -> tuple[str, Any]:
        """Returns name and value."""
        return perform_text(context, self._name), self._value.evaluate(context)


class ParameterFile:
    """A YAML file with parameters.

    Args:
        param_file: Its path.
        allow_substs: Whether it holds substitutions of XML launch files, `$(var name)`; refused.
    """

    def __init__(self, param_file: Any, *, allow_substs: Any = False) -> None:
        self._file = str(param_file) if isinstance(param_file, Path) else param_file
        self._allow_substs = allow_substs

    def path(self, context: LaunchContext) -> Path:
        """Returns the path.

        Raises:
            LaunchError: Substitutions in the file are asked for.
        """
        path = Path(perform_text(context, self._file))
        if perform_boolean(context, self._allow_substs, "allow_substs of ParameterFile"):
            raise LaunchError(
                f"{path}: allow_substs=True is not offered; allowed: False; put the values that vary into a dict after "
                "the file"
            )
        return path

    def evaluate(self, context: LaunchContext) -> Mapping[str, Any]:
        """Returns what the file holds."""
        return read_yaml_mapping(self.path(context))


def read_yaml_mapping(path: Path) -> dict[str, Any]:
    """Returns the mapping that a YAML file holds.

    Raises:
        LaunchError: It cannot be read, or holds something else; names the line.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        beside = [str(each) for each in path.parent.iterdir()] if path.parent.is_dir() else []
        raise LaunchError(f"parameter file {path} cannot be read: {error}{hint(str(path), beside)}") from None
    except yaml.YAMLError as error:
        raise LaunchError(f"parameter file {path} is no YAML: {error}") from None
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise LaunchError(f"parameter file {path} holds {content!r}; allowed: names with values, 'name: value'")
    return content


def evaluate_value(context: LaunchContext, value: Any, value_type: Any, what: str) -> Any:
    """Returns a value with its substitutions performed.

    Texts that come from substitutions are read as YAML, as in ROS 2, unless `value_type` is str; a text that is XML
    stays a text. Several substitutions and texts in a list are one text; to write a list, put each into a list.

    Args:
        context: Launch context.
        value: The value as it is written.
        value_type: As of ParameterValue.
        what: What the value is, for messages.

    Raises:
        LaunchError: It is no value of a parameter, or not of the type.
    """
    if isinstance(value, ParameterValue):
        return value.evaluate(context)
    if isinstance(value, Substitution) or _is_one_text(value):
        return _typed(perform_text(context, value), value_type, what)
    if isinstance(value, Mapping):
        return {
            perform_text(context, key): evaluate_value(context, inner, None, f"{what}/{key}")
            for key, inner in value.items()
        }
    if isinstance(value, list | tuple):
        return _evenly([evaluate_value(context, inner, None, what) for inner in value])
    if value_type is not None and isinstance(value, str):
        return _typed(value, value_type, what)
    return _coerced(value, value_type, what) if value_type is not None else value


def _is_one_text(value: Any) -> bool:
    if not isinstance(value, list | tuple) or not value:
        return False
    return all(isinstance(each, str | Substitution) for each in value) and any(
        isinstance(each, Substitution) for each in value
    )


def _evenly(values: list[Any]) -> list[Any]:
    """Makes integers among other numbers numbers, so that a list has one type."""
    numbers = all(isinstance(each, int | float) and not isinstance(each, bool) for each in values)
    if numbers and any(isinstance(each, float) for each in values):
        return [float(each) for each in values]
    return values


def _typed(text: str, value_type: Any, what: str) -> Any:
    """Returns the value that a text is written for."""
    if value_type is str:
        return text
    if value_type is None and text.lstrip().startswith("<"):  # XML; as YAML it might be anything
        return text
    try:
        value = yaml.safe_load(text) if text else ""
    except yaml.YAMLError as error:
        raise LaunchError(
            f"{what} is {_short(text)}, which is no YAML: {error}; to keep it a text, write "
            "ParameterValue(..., value_type=str)"
        ) from None
    if value_type is not None:
        return _coerced(value, value_type, what)
    if value is None or isinstance(value, Mapping):
        raise LaunchError(
            f"{what} is {_short(text)}, which YAML reads as {'nothing' if value is None else 'names with values'}; to "
            "keep it a text, write ParameterValue(..., value_type=str)"
        )
    return value


def _coerced(value: Any, value_type: Any, what: str) -> Any:
    """Returns a value in a type."""
    if typing.get_origin(value_type) is list:
        inner = typing.get_args(value_type)[0]
        if isinstance(value, list | tuple):
            return [_coerced(each, inner, what) for each in value]
    elif value_type not in SCALARS:
        names = ", ".join(each.__name__ for each in SCALARS)
        raise LaunchError(f"{what}: value_type is {value_type!r}; allowed: {names}, and lists of them (List[float])")
    elif value_type is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    elif isinstance(value, value_type) and not (value_type is int and isinstance(value, bool)):
        return value
    wanted = getattr(value_type, "__name__", value_type) if value_type in SCALARS else value_type
    raise LaunchError(f"{what} is {_short(value)} of type {type(value).__name__}; allowed: {wanted}; correct it")


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
