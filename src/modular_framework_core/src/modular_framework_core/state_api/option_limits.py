# SPDX-License-Identifier: BSD-3-Clause
"""Limits of the numbers and lengths of an option of a state, declared once in the annotation of its constructor.

``--check`` reads it from the source before a task runs, ``--explain`` and ``--schema`` show it, and ``FrameworkState``
holds to it where the state is made::

    def __init__(self, offset: Vector, speed: Share = 1.0, steps: Annotated[int, Limits(at_least=1)] = 3): ...
"""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

# bound: what must hold, word of JSON Schema, what to do about a number for which it does not hold
_BOUNDS: dict[str, tuple[Callable[[float, float], bool], str, str]] = {
    "above": (operator.gt, "exclusiveMinimum", "raise it above {:g}"),
    "at_least": (operator.ge, "minimum", "raise it to {:g} or more"),
    "below": (operator.lt, "exclusiveMaximum", "lower it below {:g}"),
    "at_most": (operator.le, "maximum", "lower it to {:g} or less"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The numbers between some bounds, which are written as plain numbers; finite ones where there is no bound at all.

    Infinity counts as the greatest number: ``Limits(above=0.0)`` takes it, as a timeout without end or a tolerance of
    everything; ``Limits(above=0.0, at_most=1.0)`` does not. NaN is never among them.

    Attributes:
        above: Lower bound, itself not allowed.
        at_least: Lower bound, itself allowed.
        below: Upper bound, itself not allowed.
        at_most: Upper bound, itself allowed.
    """

    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None

    def __post_init__(self) -> None:
        """Refuses a bound that is no number."""
        for name, bound in self.bounds().items():
            if isinstance(bound, bool) or not isinstance(bound, int | float):
                raise TypeError(f"Limits: {name} is {bound!r}; write a number")

    def bounds(self) -> dict[str, float]:
        """Returns the bounds that are set, by name."""
        return {name: bound for name in _BOUNDS if (bound := getattr(self, name)) is not None}

    def remedy(self, number: float) -> str:
        """Returns what to do about a number that is not allowed; "" when it is allowed."""
        bounded_infinity = self.bounds() and abs(number) == math.inf
        if not bounded_infinity and not abs(number) <= sys.float_info.max:
            return "write a finite number"
        broken = (name for name, bound in self.bounds().items() if not _BOUNDS[name][0](number, bound))
        return next((_BOUNDS[name][2].format(self.bounds()[name]) for name in broken), "")

    def describe(self, what: str) -> str:
        """Describes the allowed numbers; ``what`` is "a number" or "a whole number"."""
        parts = [f"{name.replace('_', ' ')} {bound:g}" for name, bound in self.bounds().items()]
        if not parts:
            return what.replace("a ", "a finite ", 1)
        return f"{what} {'of ' if parts[0].startswith('at') else ''}{' and '.join(parts)}"

    def schema(self) -> dict[str, float]:
        """Returns the words of JSON Schema that say the same."""
        return {_BOUNDS[name][1]: bound for name, bound in self.bounds().items()}


@dataclass(frozen=True, slots=True)
class Length:
    """The required number of items of a list."""

    items: int

    def __post_init__(self) -> None:
        """Refuses a length that is no whole number."""
        if isinstance(self.items, bool) or not isinstance(self.items, int):
            raise TypeError(f"Length: items is {self.items!r}; write a whole number")


Finite = Annotated[float, Limits()]
Positive = Annotated[float, Limits(above=0.0)]
NotNegative = Annotated[float, Limits(at_least=0.0)]
Share = Annotated[float, Limits(above=0.0, at_most=1.0)]
Vector = Annotated[Sequence[Annotated[float, Limits()]], Length(3)]
