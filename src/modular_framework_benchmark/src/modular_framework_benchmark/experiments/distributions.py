# SPDX-License-Identifier: BSD-3-Clause
"""Numbers of a scene that are drawn anew in each trial, always the same for the same seed."""

from __future__ import annotations

import hashlib
import random
from dataclasses import dataclass

from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence, kind_of

ALLOWED = "a number, [LOW, HIGH], {normal: [MEAN, DEVIATION]} or {choice: [A, B, ...]}"
DIGITS = 6
"""Drawn numbers are rounded to this many decimals, so that the record shows what was used."""


@dataclass(frozen=True, slots=True)
class Fixed:
    """Always the same number."""

    value: float

    def draw(self, generator: random.Random) -> float:
        """Returns the number."""
        return self.value


@dataclass(frozen=True, slots=True)
class Uniform:
    """Any number between two, all as likely."""

    low: float
    high: float

    def draw(self, generator: random.Random) -> float:
        """Returns a number between them."""
        return round(generator.uniform(self.low, self.high), DIGITS)


@dataclass(frozen=True, slots=True)
class Normal:
    """Normally distributed."""

    mean: float
    deviation: float

    def draw(self, generator: random.Random) -> float:
        """Returns a number around the mean."""
        return round(generator.gauss(self.mean, self.deviation), DIGITS)


@dataclass(frozen=True, slots=True)
class Choice:
    """One of some numbers, all as likely."""

    values: tuple[float, ...]

    def draw(self, generator: random.Random) -> float:
        """Returns one of them."""
        return generator.choice(self.values)


Distribution = Fixed | Uniform | Normal | Choice


def read_distribution(node: Node, what: str, reading: Reading) -> Distribution | None:
    """Reads a number or a distribution; notes a fault and returns None when it is neither."""
    match node:
        case Scalar():
            value = reading.number(node, what) if isinstance(node.value, (int, float)) else None
            if value is not None:
                return Fixed(value)
            if not isinstance(node.value, (int, float)):
                reading.faults.add(node.location, f"{what} must be {ALLOWED}, found {kind_of(node)}")
            return None
        case Sequence():
            ends = _numbers(node, what, reading)
            if ends is None or len(ends) == 2 and ends[0] <= ends[1]:
                return None if ends is None else Uniform(*ends)
            problem = f"has {len(ends)} numbers" if len(ends) != 2 else f"goes down from {ends[0]:g} to {ends[1]:g}"
            reading.faults.add(node.location, f"the range of {what} {problem}; allowed: [LOW, HIGH] with LOW <= HIGH")
            return None
        case Mapping():
            return _named(node, what, reading)


def _named(node: Mapping, what: str, reading: Reading) -> Distribution | None:
    if len(node.entries) != 1 or not set(node.entries) <= {"normal", "choice"}:
        keys = ", ".join(node.entries) or "none"
        reading.faults.add(node.location, f"{what} must be {ALLOWED}, found a mapping with the keys: {keys}")
        return None
    (name, value), *_ = node.entries.items()
    numbers = _numbers(value, what, reading)
    if numbers is None:
        return None
    if name == "choice":
        return Choice(tuple(numbers))
    if len(numbers) == 2 and numbers[1] >= 0:
        return Normal(*numbers)
    reading.faults.add(value.location, f"normal of {what} must be [MEAN, DEVIATION] with DEVIATION >= 0")
    return None


def _numbers(node: Node, what: str, reading: Reading) -> list[float] | None:
    items = reading.items(node, what, "[-0.2, 0.2]")
    values = [reading.number(item, f"each number of {what}") for item in items or ()]
    known = [value for value in values if value is not None]
    return known if items is not None and len(known) == len(values) else None


def generator_of(*key: object) -> random.Random:
    """Returns a generator of random numbers that depends on a key alone, on every machine."""
    digest = hashlib.sha256("/".join(str(part) for part in key).encode()).digest()
    return random.Random(int.from_bytes(digest, "big"))
