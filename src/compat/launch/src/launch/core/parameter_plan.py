# SPDX-License-Identifier: BSD-3-Clause
"""Parameters that a launch sets: collected while the description is visited, set before its processes start."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from launch.core.errors import LaunchError

ParameterValue = bool | int | float | str | list[Any] | dict[str, Any]
ALLOWED = "true or false, an integer, a number, a text, a list, or names with such values"


@dataclass(frozen=True, slots=True)
class PlannedParameter:
    """A value and who gave it.

    Attributes:
        value: The value; no mapping with entries.
        owner: Node or file that gave it.
        shared: Whether nodes read it that others give it to.
    """

    value: ParameterValue
    owner: str
    shared: bool = False


class ParameterPlan:
    """Values by full name; names with values below them are not in it, only those values are."""

    def __init__(self) -> None:
        self._planned: dict[str, PlannedParameter] = {}
        self._changed: dict[str, PlannedParameter] = {}
        self._cleared: list[str] = []

    def clear(self, name: str) -> None:
        """Plans that a parameter and all below it are removed, before others are set."""
        self._cleared.append(name)

    def take_cleared(self) -> list[str]:
        """Returns what is to be removed since the last call."""
        cleared, self._cleared = self._cleared, []
        return cleared

    def set(self, name: str, value: object, owner: str, *, shared: bool = False) -> None:
        """Plans a parameter; a mapping plans one for each of its entries.

        Args:
            name: Full name, from `/`.
            value: A value of the parameter server.
            owner: Node or file that gives it.
            shared: Whether nodes read it that others give it to: then all must give the same.

        Raises:
            LaunchError: The value is none of the parameter server's, or differs from another owner's shared one.
        """
        for leaf, each in _leaves(name, value, owner):
            known = self._planned.get(leaf)
            is_shared = shared or (known is not None and known.shared)
            if is_shared and known is not None and known.owner != owner and known.value != each:
                raise LaunchError(
                    f"parameter {leaf}: {known.owner} gives {_short(known.value)}, {owner} gives {_short(each)}; "
                    "allowed: one value, because all nodes of this namespace read it there; give both nodes the same, "
                    "or put them in different namespaces"
                )
            self._planned[leaf] = self._changed[leaf] = PlannedParameter(each, owner, is_shared)

    def has_changed(self) -> bool:
        """Whether anything is to be set or removed."""
        return bool(self._changed or self._cleared)

    def take_changed(self) -> dict[str, ParameterValue]:
        """Returns what was planned since the last call, by full name."""
        changed, self._changed = self._changed, {}
        return {name: entry.value for name, entry in changed.items()}

    def get(self, name: str) -> ParameterValue | None:
        """Returns a planned value, or the mapping of those below a name; None when there is none."""
        if name in self._planned:
            return self._planned[name].value
        below = {
            leaf[len(name) + 1 :]: entry.value
            for leaf, entry in self._planned.items()
            if leaf.startswith(f"{name.rstrip('/')}/")
        }
        return nested(below) if below else None

    def values(self) -> dict[str, ParameterValue]:
        """Returns everything planned, by full name."""
        return {name: entry.value for name, entry in self._planned.items()}


def nested(flat: Mapping[str, ParameterValue]) -> dict[str, Any]:
    """Returns names with slashes as mappings in each other."""
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
        yield name, _checked(name, value, owner)


def _checked(name: str, value: object, owner: str) -> ParameterValue:
    """Returns a value in the types of the parameter server."""
    match value:
        case bool() | int() | float() | str():
            return value
        case list() | tuple():
            return [_checked(name, each, owner) for each in value]
        case Mapping():
            return {str(key): _checked(f"{name}/{key}", each, owner) for key, each in value.items()}
    found = "no value" if value is None else f"{value!r} of type {type(value).__name__}"
    raise LaunchError(f"{owner}: parameter {name}: got {found}; allowed: {ALLOWED}; correct it, or leave it out")


def _short(value: ParameterValue) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


Lookup = Callable[[str], Any]
"""Returns the value of a parameter by its full name, planned or on the parameter server; None when there is none."""
