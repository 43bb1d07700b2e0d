# SPDX-License-Identifier: BSD-3-Clause
"""Keys of predicates in experiment files: kinds of values and their limits."""

from __future__ import annotations

from dataclasses import Field, dataclass, field, fields
from enum import Enum
from typing import Any

_KEY = "predicate_key"


class KeyKind(Enum):
    """Kind of a value."""

    OBJECT = "object"  # name of a model; by default the first object of the experiment
    OBJECTS = "objects"  # list of names of models; by default all objects of the experiment
    MODEL = "model"  # name of a model
    REGION = "region"  # name of a region
    NUMBER = "number"
    COUNT = "count"  # whole number
    VECTOR = "vector"  # three numbers
    JOINT = "joint"  # name of a movable joint of the model


@dataclass(frozen=True, slots=True)
class PredicateKey:
    """Value that a key of a predicate takes.

    Attributes:
        kind: Kind of the value.
        low: Smallest number.
        high: Largest number.
        extra: Allowed names that are not models.
    """

    kind: KeyKind
    low: float = 0.0
    high: float = 1000.0
    extra: tuple[str, ...] = ()


def number(default: float | None, *, low: float = 0.0, high: float = 1000.0, required: bool = False) -> Any:
    """Declares a number.

    Args:
        default: Value of an absent key.
        low: Smallest number.
        high: Largest number.
        required: Whether the key must be present; the default is then ignored.
    """
    key = {_KEY: PredicateKey(KeyKind.NUMBER, low, high)}
    return field(metadata=key) if required else field(default=default, metadata=key)


def whole_number(low: int) -> Any:
    """Declares a whole number; None without the key.

    Args:
        low: Smallest number.
    """
    return field(default=None, metadata={_KEY: PredicateKey(KeyKind.COUNT, low)})


def vector(*, low: float, high: float) -> Any:
    """Declares three numbers, zeros by default."""
    return field(default=(0.0, 0.0, 0.0), metadata={_KEY: PredicateKey(KeyKind.VECTOR, low, high)})


def name(kind: KeyKind, *extra: str, default: str = "") -> Any:
    """Declares a name or names.

    Args:
        kind: Kind of the name.
        *extra: Allowed names that are not models.
        default: Name of an absent key; "" if the key must be present or has the default of its kind.
    """
    metadata = {_KEY: PredicateKey(kind, extra=extra)}
    return field(default=default, metadata=metadata) if default else field(metadata=metadata)


def keys_of(kind: type[Any]) -> dict[str, tuple[PredicateKey, Field[Any]]]:
    """Returns the keys of a class of conditions with their fields, keyed by name."""
    return {item.name: (item.metadata[_KEY], item) for item in fields(kind) if _KEY in item.metadata}


def model_names(condition: Any) -> tuple[str, ...]:
    """Returns the model names in a condition, without keywords such as `robot` that do not name a model."""
    found: list[str] = []
    for key, (declared, _) in keys_of(type(condition)).items():
        if declared.kind in (KeyKind.OBJECT, KeyKind.OBJECTS, KeyKind.MODEL):
            value = getattr(condition, key)
            found += [each for each in ([value] if isinstance(value, str) else value) if each not in declared.extra]
    return tuple(found)
