# SPDX-License-Identifier: BSD-3-Clause
"""What values an option of a state may have, read from the annotation in the state's source without running it."""
from __future__ import annotations

import ast
from collections.abc import Mapping as MappingABC
from dataclasses import dataclass
from typing import Any, Union

from modular_framework_core.task_constructor.located_yaml import Mapping, Node, Scalar, Sequence

_LISTS = ("list", "List", "Sequence", "Iterable", "Collection", "tuple", "Tuple", "set", "frozenset")
_MAPPINGS = ("dict", "Dict", "Mapping")


@dataclass(frozen=True, slots=True)
class Anything:
    """Every value: the source does not say more."""

    def describe(self) -> str:
        """Say what is allowed."""
        return "any value"

    def mismatch(self, node: Node) -> tuple[Node, OptionType] | None:
        """Return the innermost value that does not fit, with what was allowed there; None when all fits."""
        return None

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema of the values."""
        return {}


@dataclass(frozen=True, slots=True)
class Plain:
    """Text, number, whole number, truth value or nothing."""

    kind: str

    def describe(self) -> str:
        """Say what is allowed."""
        return _PLAIN[self.kind][0]

    def mismatch(self, node: Node) -> tuple[Node, OptionType] | None:
        """See ``Anything.mismatch``."""
        if not isinstance(node, Scalar):
            return node, self
        value = node.value
        fits = self.kind == "bool" if isinstance(value, bool) else isinstance(value, _PLAIN[self.kind][1])
        return None if fits else (node, self)

    def schema(self) -> dict[str, Any]:
        """See ``Anything.schema``."""
        return {"type": _PLAIN[self.kind][2]}


_PLAIN: dict[str, tuple[str, Any, str]] = {
    "str": ("a text", str, "string"),
    "float": ("a number", (int, float), "number"),
    "int": ("a whole number", int, "integer"),
    "bool": ("true or false", bool, "boolean"),
    "None": ("nothing (null)", type(None), "null"),
}


@dataclass(frozen=True, slots=True)
class Choice:
    """One of some values."""

    values: tuple[Any, ...]

    def describe(self) -> str:
        """Say what is allowed."""
        return "one of " + ", ".join(repr(value) for value in self.values)

    def mismatch(self, node: Node) -> tuple[Node, OptionType] | None:
        """See ``Anything.mismatch``."""
        fits = isinstance(node, Scalar) and any(
            node.value == value and isinstance(node.value, bool) == isinstance(value, bool) for value in self.values)
        return None if fits else (node, self)

    def schema(self) -> dict[str, Any]:
        """See ``Anything.schema``."""
        return {"enum": list(self.values)}


@dataclass(frozen=True, slots=True)
class ListOf:
    """A list whose items are of one type."""

    item: OptionType

    def describe(self) -> str:
        """Say what is allowed."""
        return "a list" if isinstance(self.item, Anything) else f"a list, each item {self.item.describe()}"

    def mismatch(self, node: Node) -> tuple[Node, OptionType] | None:
        """See ``Anything.mismatch``."""
        if not isinstance(node, Sequence):
            return node, self
        return next((found for item in node.items if (found := self.item.mismatch(item)) is not None), None)

    def schema(self) -> dict[str, Any]:
        """See ``Anything.schema``."""
        return {"type": "array", "items": or_reference(self.item.schema())}


@dataclass(frozen=True, slots=True)
class MappingOf:
    """A mapping from text to values of one type."""

    value: OptionType

    def describe(self) -> str:
        """Say what is allowed."""
        return "a mapping" if isinstance(self.value, Anything) else f"a mapping to {self.value.describe()}"

    def mismatch(self, node: Node) -> tuple[Node, OptionType] | None:
        """See ``Anything.mismatch``."""
        if not isinstance(node, Mapping):
            return node, self
        found = (self.value.mismatch(item) for item in node.entries.values())
        return next((item for item in found if item is not None), None)

    def schema(self) -> dict[str, Any]:
        """See ``Anything.schema``."""
        return {"type": "object", "additionalProperties": or_reference(self.value.schema())}


@dataclass(frozen=True, slots=True)
class AnyOf:
    """A value of one of several types."""

    types: tuple[OptionType, ...]

    def describe(self) -> str:
        """Say what is allowed."""
        joint = ", or " if any(isinstance(item, ListOf | MappingOf) for item in self.types) else " or "
        return joint.join(item.describe() for item in self.types)

    def mismatch(self, node: Node) -> tuple[Node, OptionType] | None:
        """See ``Anything.mismatch``."""
        found = [item.mismatch(node) for item in self.types]
        if None in found:
            return None
        deeper = [item for item in found if item is not None and item[0] is not node]
        return deeper[0] if deeper else (node, self)

    def schema(self) -> dict[str, Any]:
        """See ``Anything.schema``."""
        return {"anyOf": [item.schema() for item in self.types]}


OptionType = Union[Anything, Plain, Choice, ListOf, MappingOf, AnyOf]  # noqa: UP007 - the classes refer to it by name


def or_reference(schema: dict[str, Any]) -> dict[str, Any]:
    """Return a JSON Schema that also takes a reference ``params.<key>``, which may stand wherever a value may."""
    return {"anyOf": [schema, {"type": "string", "pattern": r"^params\."}]} if schema else {}


def from_annotation(annotation: ast.expr | None, aliases: MappingABC[str, ast.expr]) -> OptionType:
    """Return the type an annotation stands for.

    Args:
        annotation: the annotation of an argument, or None.
        aliases: assignments of the module, name -> value, for types that have a name of their own.
    """
    return _Reader(aliases).read(annotation)


class _Reader:
    """Reads annotations; what it does not know it takes as any value."""

    def __init__(self, aliases: MappingABC[str, ast.expr]) -> None:
        self._aliases = aliases
        self._open: set[str] = set()

    def read(self, node: ast.expr | None) -> OptionType:
        match node:
            case ast.Constant(value=None):
                return Plain("None")
            case ast.Constant(value=str(text)):
                return self._text(text)
            case ast.Name(id=name) if name in _PLAIN:
                return Plain(name)
            case ast.Name(id=name) | ast.Attribute(attr=name) if name in _LISTS:
                return ListOf(Anything())
            case ast.Name(id=name) | ast.Attribute(attr=name) if name in _MAPPINGS:
                return MappingOf(Anything())
            case ast.Name(id=name) if name in self._aliases and name not in self._open:
                return self._alias(name)
            case ast.BinOp(left=left, op=ast.BitOr(), right=right):
                return self._any_of([left, right])
            case ast.Subscript(value=ast.Name(id=name) | ast.Attribute(attr=name), slice=inner):
                return self._subscript(name, list(inner.elts) if isinstance(inner, ast.Tuple) else [inner])
        return Anything()

    def _alias(self, name: str) -> OptionType:
        self._open.add(name)
        try:
            return self.read(self._aliases[name])
        finally:
            self._open.discard(name)

    def _text(self, text: str) -> OptionType:
        try:
            return self.read(ast.parse(text, mode="eval").body)
        except (SyntaxError, ValueError):
            return Anything()

    def _subscript(self, name: str, inner: list[ast.expr]) -> OptionType:
        if name == "Literal":
            values = [item.value for item in inner if isinstance(item, ast.Constant)]
            return Choice(tuple(values)) if len(values) == len(inner) else Anything()
        if name == "Optional":
            return self._any_of([*inner, ast.Constant(value=None)])
        if name == "Union":
            return self._any_of(inner)
        if name in _LISTS:
            items = [item for item in inner if not (isinstance(item, ast.Constant) and item.value is ...)]
            read = {self.read(item) for item in items}
            return ListOf(read.pop() if len(read) == 1 else AnyOf(tuple(sorted(read, key=repr))))
        if name in _MAPPINGS:
            return MappingOf(self.read(inner[-1]))
        return Anything()

    def _any_of(self, nodes: list[ast.expr]) -> OptionType:
        found: list[OptionType] = []
        for node in nodes:
            item = self.read(node)
            found += [inner for inner in (item.types if isinstance(item, AnyOf) else (item,)) if inner not in found]
        if any(isinstance(item, Anything) for item in found):
            return Anything()
        choices = tuple(value for item in found if isinstance(item, Choice) for value in item.values)
        if choices:
            others = [item for item in found if not isinstance(item, Choice)]
            found = [Choice(tuple(dict.fromkeys(choices))), *others]
        return found[0] if len(found) == 1 else AnyOf(tuple(found))
