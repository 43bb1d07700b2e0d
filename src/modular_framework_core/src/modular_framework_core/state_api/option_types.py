# SPDX-License-Identifier: BSD-3-Clause
"""Types of state options, and checks that explain why a value is invalid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Union

from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence, kind_of
from modular_framework_core.state_api.option_limits import Length, Limits
from modular_framework_ros.allowed_names import nearest


@dataclass(frozen=True, slots=True)
class Anything:
    """Any value, for options without a known type."""

    def describe(self) -> str:
        """Returns a description of the allowed values."""
        return "any value"

    def mismatch(self, node: Node) -> tuple[Node, OptionType] | None:
        """Returns the innermost value that is not allowed and its required type, or None if all values are allowed."""
        return None

    def schema(self) -> dict[str, Any]:
        """Returns the JSON Schema of the allowed values."""
        return {}


@dataclass(frozen=True, slots=True)
class ScalarType:
    """Text, number, integer, bool or null; numbers may have limits."""

    kind: str
    limits: Limits | None = None

    def describe(self) -> str:
        """See ``Anything.describe``."""
        what = SCALAR_TYPES[self.kind][0]
        return what if self.limits is None else self.limits.describe(what)

    def mismatch(self, node: Node) -> tuple[Node, OptionType] | None:
        """See ``Anything.mismatch``."""
        if not isinstance(node, Scalar):
            return node, self
        value = node.value
        fits = self.kind == "bool" if isinstance(value, bool) else isinstance(value, SCALAR_TYPES[self.kind][1])
        return None if fits and not self.remedy(value) else (node, self)

    def remedy(self, value: Any) -> str:
        """Returns the remedy for a number outside of the limits; "" for other values."""
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        return self.limits.remedy(value) if self.limits is not None and is_number else ""

    def schema(self) -> dict[str, Any]:
        """See ``Anything.schema``."""
        return {"type": SCALAR_TYPES[self.kind][2]} | ({} if self.limits is None else self.limits.schema())


SCALAR_TYPES: dict[str, tuple[str, Any, str]] = {
    "str": ("a text", str, "string"),
    "float": ("a number", (int, float), "number"),
    "int": ("a whole number", int, "integer"),
    "bool": ("true or false", bool, "boolean"),
    "None": ("nothing (null)", type(None), "null"),
}


@dataclass(frozen=True, slots=True)
class Choice:
    """One of the given values."""

    values: tuple[Any, ...]

    def describe(self) -> str:
        """See ``Anything.describe``."""
        return "one of " + ", ".join(repr(value) for value in self.values)

    def mismatch(self, node: Node) -> tuple[Node, OptionType] | None:
        """See ``Anything.mismatch``."""
        fits = isinstance(node, Scalar) and any(
            node.value == value and isinstance(node.value, bool) == isinstance(value, bool) for value in self.values
        )
        return None if fits else (node, self)

    def schema(self) -> dict[str, Any]:
        """See ``Anything.schema``."""
        return {"enum": list(self.values)}


@dataclass(frozen=True, slots=True)
class ListOf:
    """A list with items of one type and optionally a required length."""

    item: OptionType
    length: Length | None = None

    def describe(self) -> str:
        """See ``Anything.describe``."""
        what = "a list" if self.length is None else f"a list of {self.length.items} items"
        return what if isinstance(self.item, Anything) else f"{what}, each item {self.item.describe()}"

    def mismatch(self, node: Node) -> tuple[Node, OptionType] | None:
        """See ``Anything.mismatch``."""
        if not isinstance(node, Sequence) or (self.length is not None and len(node.items) != self.length.items):
            return node, self
        return next((found for item in node.items if (found := self.item.mismatch(item)) is not None), None)

    def schema(self) -> dict[str, Any]:
        """See ``Anything.schema``."""
        length = {} if self.length is None else {"minItems": self.length.items, "maxItems": self.length.items}
        return {"type": "array", "items": or_reference(self.item.schema()), **length}


@dataclass(frozen=True, slots=True)
class MappingOf:
    """A mapping from text to values of one type."""

    value: OptionType

    def describe(self) -> str:
        """See ``Anything.describe``."""
        return "a mapping" if isinstance(self.value, Anything) else f"a mapping to {self.value.describe()}"

    def mismatch(self, node: Node) -> tuple[Node, OptionType] | None:
        """See ``Anything.mismatch``."""
        if not isinstance(node, Mapping):
            return node, self
        mismatches = (self.value.mismatch(item) for item in node.entries.values())
        return next((item for item in mismatches if item is not None), None)

    def schema(self) -> dict[str, Any]:
        """See ``Anything.schema``."""
        return {"type": "object", "additionalProperties": or_reference(self.value.schema())}


@dataclass(frozen=True, slots=True)
class AnyOf:
    """A value of one of several types."""

    types: tuple[OptionType, ...]

    def describe(self) -> str:
        """See ``Anything.describe``."""
        separator = ", or " if any(isinstance(item, ListOf | MappingOf) for item in self.types) else " or "
        return separator.join(item.describe() for item in self.types)

    def mismatch(self, node: Node) -> tuple[Node, OptionType] | None:
        """See ``Anything.mismatch``."""
        mismatches = [item.mismatch(node) for item in self.types]
        if None in mismatches:
            return None
        deeper = [item for item in mismatches if item is not None and item[0] is not node]
        return deeper[0] if deeper else (node, self)

    def schema(self) -> dict[str, Any]:
        """See ``Anything.schema``."""
        return {"anyOf": [item.schema() for item in self.types]}


OptionType = Union[Anything, ScalarType, Choice, ListOf, MappingOf, AnyOf]  # noqa: UP007 - the classes refer to it by name


def or_reference(schema: dict[str, Any]) -> dict[str, Any]:
    """Returns a JSON Schema that also allows a reference ``params.<key>``."""
    return {"anyOf": [schema, {"type": "string", "pattern": r"^params\."}]} if schema else {}


def option_fault(allowed: OptionType, node: Node) -> tuple[Node, str] | None:
    """Returns the fault of a value, or None if the value is allowed.

    Args:
        allowed: Type of the option.
        node: Value of the option.

    Returns:
        The innermost value that is not allowed, and the message ``must be ..., found ...`` with a remedy if known.
    """
    mismatch = allowed.mismatch(node)
    if mismatch is None:
        return None
    node, required = mismatch
    parts = required.types if isinstance(required, AnyOf) else (required,)
    found_text = kind_of(node)
    if isinstance(node, Sequence) and any(isinstance(part, ListOf) and part.length for part in parts):
        found_text = f"a list of {len(node.items)}"
    hint = _remedy(node, parts) if isinstance(node, Scalar) else ""
    return node, f"must be {required.describe()}, found {found_text}{hint}"


def _remedy(node: Scalar, parts: tuple[OptionType, ...]) -> str:
    value = node.value
    for part in parts:
        if isinstance(part, ScalarType) and (remedy := part.remedy(value)):
            return f"; {remedy}"
    if isinstance(value, str):
        if len(parts) == 1 and isinstance(parts[0], ScalarType) and parts[0].kind in ("float", "int"):
            return "; remove the quotes to make it a number" if _is_quoted_number(value) else ""
        names = [item for part in parts if isinstance(part, Choice) for item in part.values if isinstance(item, str)]
        return nearest(value, names)
    return "; put it in quotes to make it text" if parts == (ScalarType("str"),) and value is not None else ""


def _is_quoted_number(value: str) -> bool:
    return value.removeprefix("-").replace(".", "", 1).isdecimal()
