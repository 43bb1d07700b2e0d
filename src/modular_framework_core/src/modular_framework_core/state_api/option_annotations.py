# SPDX-License-Identifier: BSD-3-Clause
"""Reads the allowed values of an option from its annotation, given as source or as an evaluated type."""

from __future__ import annotations

import ast
import functools
import inspect
from collections.abc import Iterator
from collections.abc import Mapping as MappingABC
from dataclasses import replace
from typing import Any

from modular_framework_core.state_api.option_limits import Length, Limits
from modular_framework_core.state_api.option_types import (
    SCALAR_TYPES,
    AnyOf,
    Anything,
    Choice,
    ListOf,
    MappingOf,
    OptionType,
    ScalarType,
)
from modular_framework_core.state_api.option_uses import KINDS, Use

_LIST_TYPES = ("list", "List", "Sequence", "Iterable", "Collection", "tuple", "Tuple", "set", "frozenset")
_MAPPING_TYPES = ("dict", "Dict", "Mapping")


def from_annotation(annotation: ast.expr | None, aliases: MappingABC[str, ast.expr]) -> OptionType:
    """Returns the option type of an annotation.

    Args:
        annotation: Syntax tree of the annotation, or None.
        aliases: Assignments of the module, name -> value, to resolve type aliases.
    """
    return _Reader(aliases).read(annotation)


def from_hint(hint: Any) -> OptionType:
    """Returns the option type of an evaluated annotation, which is read from its ``repr``."""
    text = hint.__name__ if inspect.isclass(hint) and not hasattr(hint, "__origin__") else repr(hint)
    return _Reader({}).read(ast.Constant(text))


def uses_in(annotation: ast.expr | None, aliases: MappingABC[str, ast.expr]) -> tuple[Use, ...]:
    """Returns the uses that an annotation declares; see ``from_annotation`` for the arguments."""
    return tuple(dict.fromkeys(_uses(annotation, aliases, frozenset())))


def _uses(node: ast.expr | None, aliases: MappingABC[str, ast.expr], visited: frozenset[str]) -> Iterator[Use]:
    match node:
        case ast.Name(id=name) if name in aliases and name not in visited:
            yield from _uses(aliases[name], aliases, visited | {name})
        case ast.BinOp(left=left, right=right):
            yield from _uses(left, aliases, visited)
            yield from _uses(right, aliases, visited)
        case ast.Subscript(value=ast.Name(id="Annotated"), slice=ast.Tuple(elts=[inner, *limit])):
            yield from _uses(inner, aliases, visited)
            for item in limit:
                yield from _uses(item, aliases, visited)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=keywords) if name in KINDS:
            try:
                yield KINDS[name](
                    *(_value(item, aliases) for item in arguments),
                    **{str(item.arg): _value(item.value, aliases) for item in keywords},
                )
            except (TypeError, ValueError):
                return


def _value(node: ast.expr, aliases: MappingABC[str, ast.expr]) -> Any:
    """Returns a literal, or the literal assigned to a name in the module."""
    return ast.literal_eval(aliases.get(node.id, node) if isinstance(node, ast.Name) else node)


class _Reader:
    """Reads annotations. An unknown annotation allows any value."""

    def __init__(self, aliases: MappingABC[str, ast.expr]) -> None:
        self._aliases = aliases
        self._aliases_in_progress: set[str] = set()

    def read(self, node: ast.expr | None) -> OptionType:
        match node:
            case ast.Constant(value=None) | ast.Name(id="NoneType"):
                return ScalarType("None")
            case ast.Constant(value=str(text)):
                return self._text(text)
            case ast.Name(id=name) if name in SCALAR_TYPES:
                return ScalarType(name)
            case ast.Name(id=name) | ast.Attribute(attr=name) if name in _LIST_TYPES:
                return ListOf(Anything())
            case ast.Name(id=name) | ast.Attribute(attr=name) if name in _MAPPING_TYPES:
                return MappingOf(Anything())
            case ast.Name(id=name) if name in self._aliases and name not in self._aliases_in_progress:
                return self._alias(name)
            case ast.BinOp(left=left, op=ast.BitOr(), right=right):
                return self._any_of([left, right])
            case ast.Subscript(value=ast.Name(id=name) | ast.Attribute(attr=name), slice=inner):
                return self._subscript(name, list(inner.elts) if isinstance(inner, ast.Tuple) else [inner])
        return Anything()

    def _alias(self, name: str) -> OptionType:
        self._aliases_in_progress.add(name)
        try:
            return self.read(self._aliases[name])
        finally:
            self._aliases_in_progress.discard(name)

    def _text(self, text: str) -> OptionType:
        try:
            return self.read(ast.parse(text, mode="eval").body)
        except (SyntaxError, ValueError):
            return Anything()

    def _subscript(self, name: str, inner: list[ast.expr]) -> OptionType:
        if name == "Literal":
            values = [item.value for item in inner if isinstance(item, ast.Constant)]
            return Choice(tuple(values)) if len(values) == len(inner) else Anything()
        if name == "Annotated":
            return functools.reduce(_limited_type, map(self._limit_in, inner[1:]), self.read(inner[0]))
        if name == "Optional":
            return self._any_of([*inner, ast.Constant(value=None)])
        if name == "Union":
            return self._any_of(inner)
        if name in _LIST_TYPES:
            items = [item for item in inner if not (isinstance(item, ast.Constant) and item.value is ...)]
            read = {self.read(item) for item in items}
            return ListOf(read.pop() if len(read) == 1 else AnyOf(tuple(sorted(read, key=repr))))
        if name in _MAPPING_TYPES:
            return MappingOf(self.read(inner[-1]))
        return Anything()

    def _any_of(self, nodes: list[ast.expr]) -> OptionType:
        types: list[OptionType] = []
        for node in nodes:
            item = self.read(node)
            types += [inner for inner in (item.types if isinstance(item, AnyOf) else (item,)) if inner not in types]
        if any(isinstance(item, Anything) for item in types):
            return Anything()
        choices = tuple(value for item in types if isinstance(item, Choice) for value in item.values)
        if choices:
            other_types = [item for item in types if not isinstance(item, Choice)]
            types = [Choice(tuple(dict.fromkeys(choices))), *other_types]
        return types[0] if len(types) == 1 else AnyOf(tuple(types))

    def _limit_in(self, node: ast.expr) -> Limits | Length | None:
        """Returns the value of ``Limits(...)`` or ``Length(...)``, or None for anything else or invalid arguments."""
        match node:
            case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name), args=arguments, keywords=keywords):
                kinds: dict[str, type[Limits | Length]] = {"Limits": Limits, "Length": Length}
                try:
                    return kinds[name](
                        *[self._number(item) for item in arguments],
                        **{str(item.arg): self._number(item.value) for item in keywords},
                    )
                except (KeyError, TypeError, ValueError):
                    return None
        return None

    def _number(self, node: ast.expr) -> Any:
        return _value(node, self._aliases)


def _limited_type(kind: OptionType, limit: Limits | Length | None) -> OptionType:
    match kind, limit:
        case AnyOf(types=types), _:
            return AnyOf(tuple(_limited_type(item, limit) for item in types))
        case ScalarType(kind="float" | "int", limits=limits), Limits():
            return replace(kind, limits=Limits(**({} if limits is None else limits.bounds()) | limit.bounds()))
        case ListOf(), Length():
            return replace(kind, length=limit)
    return kind
