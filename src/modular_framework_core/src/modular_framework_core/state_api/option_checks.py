# SPDX-License-Identifier: BSD-3-Clause
"""Checks the options of a state against their annotations where it is made, by the rules that tasks are checked by."""

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
from modular_framework_core.state_api.option_types import Anything, OptionType, complaint

_HERE = SourceLocation("", 0, 0)


class _NoTaskValueError(Exception):
    """A value that no task can hold."""


def checks_options(constructor: Callable[..., None], without: Iterable[str] = ()) -> Callable[..., None]:
    """Returns a constructor that refuses options their annotations do not allow.

    Only values that a task could hold are checked: text, numbers, bools, None, lists and mappings of these. Defaults
    are not checked, nor are options whose annotations cannot be evaluated.

    Args:
        constructor: ``__init__`` of a class.
        without: Options that are not checked.

    Raises:
        ValueError: By the constructor returned: options do not fit; names all of them.
    """
    signature = inspect.signature(constructor)
    variable = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    unchecked = {*without, *(item.name for item in signature.parameters.values() if item.kind in variable)}
    declared: dict[str, OptionType] = {}

    @functools.wraps(constructor)
    def checking(state: Any, /, *arguments: Any, **options: Any) -> None:
        if not declared:  # not before the first state is made: a module may define what it refers to after the class
            declared.update(declared_types(constructor))
        try:
            given = signature.bind(state, *arguments, **options).arguments
        except TypeError:
            given = {}  # the constructor's own error is clearer
        judged = {
            name: value
            for name, value in given.items()
            if name not in unchecked and value is not signature.parameters[name].default
        }
        wrong = [
            f"option '{name}' {found}"
            for name, value in judged.items()
            if (found := _complaint(declared.get(name, Anything()), value))
        ]
        if wrong:
            raise ValueError(f"{type(state).__name__}: {'; '.join(wrong)}")
        constructor(state, *arguments, **options)

    return checking


def declared_types(constructor: Callable[..., None]) -> dict[str, OptionType]:
    """Returns the types of a constructor's options, by name, as its annotations say once Python has evaluated them."""
    written = inspect.unwrap(constructor)
    hints = getattr(written, "__annotations__", {})
    types: dict[str, Any] = {}
    for name, hint in hints.items():
        evaluated = _evaluated(hint, getattr(written, "__globals__", {}))
        types |= get_type_hints(get_args(evaluated)[0]) if get_origin(evaluated) is Unpack else {name: evaluated}
    return {name: from_hint(hint) for name, hint in types.items()}


def _evaluated(hint: Any, names: dict[str, Any]) -> Any:
    annotated = SimpleNamespace(__annotations__={"hint": hint})
    try:
        return get_type_hints(annotated, names, include_extras=True)["hint"]
    except Exception:  # whatever an annotation does that refers to what is not there
        return Any


def _complaint(allowed: OptionType, value: Any) -> str:
    if isinstance(allowed, Anything):
        return ""
    try:
        wrong = complaint(allowed, _node(value))
    except (_NoTaskValueError, RecursionError):  # the latter for a list that contains itself
        return ""
    return "" if wrong is None else wrong[1]


def _node(value: Any) -> Node:
    """Returns a value as the tree a task file with it is read into."""
    match value:
        case None | bool() | str() | int() | float():
            return Scalar(value, _HERE)
        case MappingABC():
            return Mapping({str(key): _node(item) for key, item in value.items()}, {}, _HERE)
        case list() | tuple() | set() | frozenset():
            return Sequence(tuple(map(_node, value)), _HERE)
        case np.ndarray() | np.generic():
            return _node(value.tolist())
    raise _NoTaskValueError
