# SPDX-License-Identifier: BSD-3-Clause
"""Holds a state to the annotations of its options where it is made: the rules a task is checked by, for every maker."""
from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable
from collections.abc import Mapping as MappingABC
from types import SimpleNamespace
from typing import Any, get_type_hints

import numpy as np

from modular_framework_core.files.faults import Place
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence
from modular_framework_core.state_api.option_annotations import from_hint
from modular_framework_core.state_api.option_types import Anything, OptionType, complaint

_HERE = Place("", 0, 0)


class _NoTaskValueError(Exception):
    """A value that no task can hold."""


def checks_options(constructor: Callable[..., None], without: Iterable[str] = ()) -> Callable[..., None]:
    """Return a constructor that refuses options their annotations do not allow.

    Judged are values that a task could hold: text, numbers, truth values, None, lists and mappings of these. Defaults
    are not judged, be they handed on or not, nor are annotations that cannot be evaluated.

    Args:
        constructor: ``__init__`` of a class.
        without: options to leave alone.

    Raises:
        ValueError: by the constructor returned: options do not fit; tells all of them.
    """
    signature = inspect.signature(constructor)
    variable = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    left_alone = {*without, *(item.name for item in signature.parameters.values() if item.kind in variable)}
    declared: dict[str, OptionType] = {}

    @functools.wraps(constructor)
    def checking(state: Any, /, *arguments: Any, **options: Any) -> None:
        if not declared:  # not before the first state is made: a module may define what it refers to after the class
            declared.update(declared_types(constructor))
        try:
            given = signature.bind(state, *arguments, **options).arguments
        except TypeError:
            given = {}  # the constructor itself says it best
        judged = {name: value for name, value in given.items()
                  if name not in left_alone and value is not signature.parameters[name].default}
        wrong = [f"option '{name}' {found}" for name, value in judged.items()
                 if (found := _complaint(declared.get(name, Anything()), value))]
        if wrong:
            raise ValueError(f"{type(state).__name__}: {'; '.join(wrong)}")
        constructor(state, *arguments, **options)

    return checking


def declared_types(constructor: Callable[..., None]) -> dict[str, OptionType]:
    """Return the types of a constructor's options, by name, as its annotations say once Python has evaluated them."""
    written = inspect.unwrap(constructor)
    hints = getattr(written, "__annotations__", {})
    return {name: from_hint(_evaluated(hint, getattr(written, "__globals__", {}))) for name, hint in hints.items()}


def _evaluated(hint: Any, names: dict[str, Any]) -> Any:
    holder = SimpleNamespace(__annotations__={"hint": hint})
    try:
        return get_type_hints(holder, names, include_extras=True)["hint"]
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
    """Return a value as the tree a task file with it is read into."""
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
