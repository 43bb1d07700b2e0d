# SPDX-License-Identifier: BSD-3-Clause
"""Random numbers of a scene, drawn for each trial and reproducible by seed."""

from __future__ import annotations

import hashlib
import math
import random
from dataclasses import dataclass

from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence, kind_of

ALLOWED_DISTRIBUTIONS = "a number, [LOW, HIGH], {normal: [MEAN, DEVIATION]} or {choice: [A, B, ...]}"
DRAW_DIGITS = 6
"""Decimals of drawn numbers, so that the record shows the exact value."""


@dataclass(frozen=True, slots=True)
class Uniform:
    """A uniform distribution."""

    low: float
    high: float

    def draw(self, generator: random.Random) -> float:
        """Returns a number between `low` and `high`."""
        return round(generator.uniform(self.low, self.high), DRAW_DIGITS)


@dataclass(frozen=True, slots=True)
class Normal:
    """A normal distribution."""

    mean: float
    deviation: float

    @property
    def low(self) -> float:
        """Returns the smallest number."""
        return -math.inf

    @property
    def high(self) -> float:
        """Returns the largest number."""
        return math.inf

    def draw(self, generator: random.Random) -> float:
        """Returns a normally distributed number."""
        return round(generator.gauss(self.mean, self.deviation), DRAW_DIGITS)


@dataclass(frozen=True, slots=True)
class Choice:
    """A uniform choice among given numbers; with a single number, a constant."""

    values: tuple[float, ...]

    @property
    def low(self) -> float:
        """Returns the smallest number."""
        return min(self.values)

    @property
    def high(self) -> float:
        """Returns the largest number."""
        return max(self.values)

    def draw(self, generator: random.Random) -> float:
        """Returns one of the numbers."""
        return generator.choice(self.values)


Distribution = Uniform | Normal | Choice


def read_distribution(node: Node, what: str, reading: Reading) -> Distribution | None:
    """Reads a number or a distribution.

    Args:
        node: Value of the file.
        what: Name of the value in fault messages.
        reading: Reader that collects faults.

    Returns:
        The distribution, or None after a fault.
    """
    match node:
        case Scalar():
            value = reading.number(node, what) if isinstance(node.value, (int, float)) else None
            if value is not None:
                return Choice((value,))
            if not isinstance(node.value, (int, float)):
                reading.faults.add(node.location, f"{what} must be {ALLOWED_DISTRIBUTIONS}, found {kind_of(node)}")
            return None
        case Sequence():
            ends = _numbers(node, what, reading)
            if ends is None or len(ends) == 2 and ends[0] <= ends[1]:
                return None if ends is None else Uniform(*ends)
            problem = f"has {len(ends)} numbers" if len(ends) != 2 else f"goes down from {ends[0]:g} to {ends[1]:g}"
            reading.faults.add(node.location, f"the range of {what} {problem}; allowed: [LOW, HIGH] with LOW <= HIGH")
            return None
        case Mapping():
            return _read_named_distribution(node, what, reading)


def _read_named_distribution(node: Mapping, what: str, reading: Reading) -> Distribution | None:
    if len(node.entries) != 1 or not set(node.entries) <= {"normal", "choice"}:
        keys = ", ".join(node.entries) or "none"
        reading.faults.add(
            node.location, f"{what} must be {ALLOWED_DISTRIBUTIONS}, found a mapping with the keys: {keys}"
        )
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
    numbers = [value for value in values if value is not None]
    return numbers if items is not None and len(numbers) == len(values) else None


def generator_of(*key: object) -> random.Random:
    """Returns a random generator seeded by a key, equal on every machine."""
    digest = hashlib.sha256("/".join(str(part) for part in key).encode()).digest()
    return random.Random(int.from_bytes(digest, "big"))
