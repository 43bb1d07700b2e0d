# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of a launch, collected while the description is visited and set before its processes start."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from launch.core.errors import LaunchError

ParameterValue = bool | int | float | str | list[Any] | dict[str, Any]
ALLOWED = "a bool, an integer, a number, a text, a list, or a mapping of names to such values"


@dataclass(frozen=True, slots=True)
class PlannedParameter:
    """Value of a parameter and its origin.

    Attributes:
        value: Value of the parameter; never a mapping with entries.
        owner: Node or file that sets the parameter.
        shared: Whether several nodes read the parameter.
    """

    value: ParameterValue
    owner: str
    shared: bool = False


class ParameterPlan:
    """Planned parameters by full name; a mapping is stored as one parameter per entry."""

    def __init__(self) -> None:
        self._planned: dict[str, PlannedParameter] = {}
        self._changed: dict[str, PlannedParameter] = {}
        self._cleared: list[str] = []

    def clear(self, name: str) -> None:
        """Plans to remove a parameter and all parameters below, before others are set."""
        self._cleared.append(name)

    def pop_cleared(self) -> list[str]:
        """Returns the names that were planned for removal since the last call."""
        cleared, self._cleared = self._cleared, []
        return cleared

    def set(self, name: str, value: object, owner: str, *, shared: bool = False) -> None:
        """Plans a parameter; a mapping is planned as one parameter per entry.

        Args:
            name: Full name, starting with `/`.
            value: Value of a type of the parameter server.
            owner: Node or file that sets the parameter.
            shared: Whether several nodes read the parameter, so that all owners must set the same value.

        Raises:
            LaunchError: The type of the value is not supported, or another owner has set a different shared value.
        """
        for leaf, each in _leaves(name, value, owner):
            known = self._planned.get(leaf)
            is_shared = shared or (known is not None and known.shared)
            if is_shared and known is not None and known.owner != owner and known.value != each:
                raise LaunchError(
                    f"parameter {leaf}: {known.owner} sets {_short(known.value)}, {owner} sets {_short(each)}; "
                    "allowed: a single value, because all nodes of this namespace read it; set the same value for both "
                    "nodes, or move them to different namespaces"
                )
            self._planned[leaf] = self._changed[leaf] = PlannedParameter(each, owner, is_shared)

    def has_changed(self) -> bool:
        """Returns whether any parameter is to be set or removed."""
        return bool(self._changed or self._cleared)

    def pop_changed(self) -> dict[str, ParameterValue]:
        """Returns the parameters planned since the last call, by full name."""
        changed, self._changed = self._changed, {}
        return {name: entry.value for name, entry in changed.items()}

    def get(self, name: str) -> ParameterValue | None:
        """Returns a planned value, or the mapping of the values below a name; None if nothing is planned."""
        if name in self._planned:
            return self._planned[name].value
        below = {
            leaf[len(name) + 1 :]: entry.value
            for leaf, entry in self._planned.items()
            if leaf.startswith(f"{name.rstrip('/')}/")
        }
        return nested(below) if below else None

    def values(self) -> dict[str, ParameterValue]:
        """Returns all planned values, by full name."""
        return {name: entry.value for name, entry in self._planned.items()}


def nested(flat: Mapping[str, ParameterValue]) -> dict[str, Any]:
    """Converts names with slashes to nested mappings."""
    tree: dict[str, Any] = {}
    for name, value in flat.items():
        *folders, leaf = name.strip("/").split("/")
        inner = tree
        for folder in folders:
            inner = inner.setdefault(folder, {})
        inner[leaf] = value
    return tree


def _leaves(name: str, value: object, owner: str) -> Iterator[tuple[str, ParameterValue]]:
    if isinstance(value, Mapping) and value:
        for key, inner in value.items():
            yield from _leaves(f"{name.rstrip('/')}/{key}", inner, owner)
    else:
        yield name, _checked_value(name, value, owner)


def _checked_value(name: str, value: object, owner: str) -> ParameterValue:
    """Converts a value to the types of the parameter server."""
    match value:
        case bool() | int() | float() | str():
            return value
        case list() | tuple():
            return [_checked_value(name, each, owner) for each in value]
        case Mapping():
            return {str(key): _checked_value(f"{name}/{key}", each, owner) for key, each in value.items()}
    description = "no value" if value is None else f"{value!r} of type {type(value).__name__}"
    raise LaunchError(f"{owner}: parameter {name}: got {description}; allowed: {ALLOWED}; correct or remove it")


def _short(value: ParameterValue) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


Lookup = Callable[[str], Any]
"""Function that returns the planned or current value of a parameter by full name; None if not set."""
