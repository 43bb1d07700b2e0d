# SPDX-License-Identifier: BSD-3-Clause
"""Checks the options of a state at construction, by the same rules as the check of a task."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable
from collections.abc import Mapping as MappingABC
from types import SimpleNamespace
from typing import Any, Unpack, get_args, get_origin, get_type_hints

import numpy as np

from modular_framework_core.files.faults import SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence
from modular_framework_core.state_api.option_annotations import from_hint
from modular_framework_core.state_api.option_types import Anything, OptionType, option_fault

_NO_LOCATION = SourceLocation("", 0, 0)


class _NoTaskValueError(Exception):
    """A value that cannot be written in a task."""


def checks_options(constructor: Callable[..., None], without: Iterable[str] = ()) -> Callable[..., None]:
    """Returns a constructor that checks options against their annotations and raises ValueError with all faults.

    Only values that can be written in a task are checked: text, numbers, bools, None, and lists and mappings of these.
    Defaults and options whose annotations cannot be evaluated are not checked.

    Args:
        constructor: ``__init__`` of a class.
        without: Options without check.
    """
    signature = inspect.signature(constructor)
    variable = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    unchecked = {*without, *(item.name for item in signature.parameters.values() if item.kind in variable)}
    declared: dict[str, OptionType] = {}

    @functools.wraps(constructor)
    def checking(state: Any, /, *arguments: Any, **options: Any) -> None:
        if not declared:  # evaluated on first use: an annotation may refer to names defined after the class
            declared.update(declared_types(constructor))
        try:
            bound_arguments = signature.bind(state, *arguments, **options).arguments
        except TypeError:
            bound_arguments = {}  # the constructor's own error is clearer
        checked = {
            name: value
            for name, value in bound_arguments.items()
            if name not in unchecked and value is not signature.parameters[name].default
        }
        messages = [
            f"option '{name}' {fault}"
            for name, value in checked.items()
            if (fault := _fault(declared.get(name, Anything()), value))
        ]
        if messages:
            raise ValueError(f"{type(state).__name__}: {'; '.join(messages)}")
        constructor(state, *arguments, **options)

    return checking


def declared_types(constructor: Callable[..., None]) -> dict[str, OptionType]:
    """Returns the types of a constructor's options by name, from its evaluated annotations."""
    original = inspect.unwrap(constructor)
    hints = getattr(original, "__annotations__", {})
    types: dict[str, Any] = {}
    for name, hint in hints.items():
        evaluated = _evaluate_hint(hint, getattr(original, "__globals__", {}))
        types |= get_type_hints(get_args(evaluated)[0]) if get_origin(evaluated) is Unpack else {name: evaluated}
    return {name: from_hint(hint) for name, hint in types.items()}


def _evaluate_hint(hint: Any, names: dict[str, Any]) -> Any:
    annotated = SimpleNamespace(__annotations__={"hint": hint})
    try:
        return get_type_hints(annotated, names, include_extras=True)["hint"]
    except Exception:  # an unresolved name can raise anything
        return Any


def _fault(allowed: OptionType, value: Any) -> str:
    if isinstance(allowed, Anything):
        return ""
    try:
        fault = option_fault(allowed, _node(value))
    except (_NoTaskValueError, RecursionError):  # RecursionError for a list that contains itself
        return ""
    return "" if fault is None else fault[1]


def _node(value: Any) -> Node:
    """Returns a value as the YAML tree of a task file."""
    match value:
        case None | bool() | str() | int() | float():
            return Scalar(value, _NO_LOCATION)
        case MappingABC():
            return Mapping({str(key): _node(item) for key, item in value.items()}, {}, _NO_LOCATION)
        case list() | tuple() | set() | frozenset():
            return Sequence(tuple(map(_node, value)), _NO_LOCATION)
        case np.ndarray() | np.generic():
            return _node(value.tolist())
    raise _NoTaskValueError
