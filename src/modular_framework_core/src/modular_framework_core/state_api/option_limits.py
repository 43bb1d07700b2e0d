# SPDX-License-Identifier: BSD-3-Clause
"""Limits of a state's numeric and list options, declared once in the annotations of its constructor.

``--check`` reads the limits from the source before a task runs, ``--explain`` and ``--schema`` show them, and
``FrameworkState`` enforces them at construction::

    def __init__(self, offset: Vector, speed: Share = 1.0, steps: Annotated[int, Limits(at_least=1)] = 3): ...
"""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

# bound: condition, JSON Schema keyword, remedy for a violation
_BOUNDS: dict[str, tuple[Callable[[float, float], bool], str, str]] = {
    "above": (operator.gt, "exclusiveMinimum", "raise it above {:g}"),
    "at_least": (operator.ge, "minimum", "raise it to {:g} or more"),
    "below": (operator.lt, "exclusiveMaximum", "lower it below {:g}"),
    "at_most": (operator.le, "maximum", "lower it to {:g} or less"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Range of a number. Without any bound, all finite numbers are allowed.

    One-sided limits allow infinity on the open side: ``Limits(above=0.0)`` allows an infinite timeout or tolerance. NaN
    is never allowed. Bounds must be literals in the source.

    Attributes:
        above: Exclusive lower bound.
        at_least: Inclusive lower bound.
        below: Exclusive upper bound.
        at_most: Inclusive upper bound.
    """

    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None

    def __post_init__(self) -> None:
        """Checks that each bound is a number."""
        for name, bound in self.bounds().items():
            if isinstance(bound, bool) or not isinstance(bound, int | float):
                raise TypeError(f"Limits: {name} is {bound!r}; write a number")

    def bounds(self) -> dict[str, float]:
        """Returns the given bounds by name."""
        return {name: bound for name in _BOUNDS if (bound := getattr(self, name)) is not None}

    def remedy(self, number: float) -> str:
        """Returns the remedy for a number outside of the range; "" for an allowed number."""
        bounded_infinity = self.bounds() and abs(number) == math.inf
        if not bounded_infinity and not abs(number) <= sys.float_info.max:
            return "write a finite number"
        violated = (name for name, bound in self.bounds().items() if not _BOUNDS[name][0](number, bound))
        return next((_BOUNDS[name][2].format(self.bounds()[name]) for name in violated), "")

    def describe(self, noun: str) -> str:
        """Returns a description of the range; ``noun`` is "a number" or "a whole number"."""
        parts = [f"{name.replace('_', ' ')} {bound:g}" for name, bound in self.bounds().items()]
        if not parts:
            return noun.replace("a ", "a finite ", 1)
        return f"{noun} {'of ' if parts[0].startswith('at') else ''}{' and '.join(parts)}"

    def schema(self) -> dict[str, float]:
        """Returns the range as JSON Schema keywords."""
        return {_BOUNDS[name][1]: bound for name, bound in self.bounds().items()}


@dataclass(frozen=True, slots=True)
class Length:
    """Required length of a list."""

    items: int

    def __post_init__(self) -> None:
        """Checks that the length is a whole number."""
        if isinstance(self.items, bool) or not isinstance(self.items, int):
            raise TypeError(f"Length: items is {self.items!r}; write a whole number")


Finite = Annotated[float, Limits()]
Positive = Annotated[float, Limits(above=0.0)]
NotNegative = Annotated[float, Limits(at_least=0.0)]
Share = Annotated[float, Limits(above=0.0, at_most=1.0)]
Vector = Annotated[Sequence[Annotated[float, Limits()]], Length(3)]
