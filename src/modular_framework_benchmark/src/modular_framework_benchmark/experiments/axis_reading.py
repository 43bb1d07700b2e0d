# SPDX-License-Identifier: BSD-3-Clause
"""Reads a perturbed axis of an experiment file: its unit, its nominal value, and its levels or its range."""

from __future__ import annotations

import math
from collections.abc import Mapping as Map
from dataclasses import dataclass

from modular_framework_benchmark.experiments.reading import ValueReading
from modular_framework_benchmark.records.perturbation import FACTOR, ONE_AT_A_TIME, PerturbationAxis, PerturbedAxis
from modular_framework_core.files.located_yaml import Node
from modular_framework_core.task_constructor.key_spelling import corrected_keys
from modular_framework_ros.allowed_names import listing

AXIS_KEYS = ("unit", "levels", "range", "steps", "nominal")
DEFAULT_STEPS, MAX_LEVELS = 5, 1024
LEVEL_DIGITS = 4
"""Significant digits of computed levels, so that the label states the exact value."""


@dataclass(frozen=True, slots=True)
class ReadAxis:
    """An axis of the file with its values in the unit of the file.

    Attributes:
        axis: Property of the world.
        unit: Unit of the values.
        nominal: Nominal value.
        levels: Ascending levels, or the ends of the range for a space-filling design.
        node: Mapping of the axis, for faults.
    """

    axis: PerturbationAxis
    unit: str
    nominal: float
    levels: tuple[float, ...]
    node: Node

    @property
    def name(self) -> str:
        """Returns the name of the axis."""
        return self.axis.name

    @property
    def perturbed_axis(self) -> PerturbedAxis:
        """Returns the axis for reports."""
        return PerturbedAxis(self.name, self.unit, self.nominal)

    def in_si(self, value: float) -> float:
        """Returns a value of the file in SI units, without the error of the conversion's floating point."""
        return float(f"{value * self.axis.units[self.unit]:.12g}")

    def text(self, value: float) -> str:
        """Returns the name of the axis with a value and its unit."""
        return f"{self.name}={value:.12g}" + ("" if self.unit == FACTOR else f" {self.unit}")


def read_axis(axis: PerturbationAxis, node: Node, design: str, reading: ValueReading) -> ReadAxis | None:
    """Reads a perturbed axis; None if it has no unit.

    Args:
        axis: Property of the world.
        node: Value in the file.
        design: Name of the design.
        reading: Reader that collects faults.
    """
    mapping = reading.mapping(node, axis.name, f"{{unit: {next(iter(axis.units))}, levels: [{axis.nominal:g}, ...]}}")
    if mapping is None:
        return None
    entries = corrected_keys(mapping, AXIS_KEYS, f"the key of {axis.name}", reading.faults).entries
    if "unit" not in entries:
        text = (
            f"the axis {axis.name} has no unit; {listing(axis.units)}; add it, such as unit: {next(iter(axis.units))}"
        )
        reading.faults.add(node.location, text)
        return None
    unit = reading.choice(entries["unit"], f"the unit of {axis.name}", axis.units)
    if unit is None:
        return None
    values = _AxisValues(reading, axis, unit)
    nominal = values.number(entries["nominal"], "nominal") if "nominal" in entries else axis.nominal / axis.units[unit]
    levels = values.levels(node, entries, design)
    if levels and set(levels) == {nominal}:
        text = f"the axis {axis.name} has only its nominal level {nominal:g}; add a level"
        reading.faults.add(node.location, text)
    return ReadAxis(axis, unit, nominal, levels, node)


@dataclass(frozen=True, slots=True)
class _AxisValues:
    """Reader of the values of an axis, in the unit of the file."""

    reading: ValueReading
    axis: PerturbationAxis
    unit: str

    def number(self, node: Node, what: str) -> float:
        """Returns a number within the allowed range of the axis; NaN after a fault."""
        scale = self.axis.units[self.unit]
        low, high = (float(f"{end / scale:.12g}") for end in (self.axis.low, self.axis.high))
        value = self.reading.number(node, f"{what} of {self.axis.name} [{self.unit}]", low, high)
        return math.nan if value is None else value

    def levels(self, node: Node, entries: Map[str, Node], design: str) -> tuple[float, ...]:
        """Returns the ascending levels of the axis, or the ends of its range for a space-filling design.

        Args:
            node: Mapping of the axis.
            entries: Values of the mapping by key.
            design: Name of the design.
        """
        faults, name = self.reading.faults, self.axis.name
        if ("levels" in entries) == ("range" in entries):
            found_keys = "both levels and range" if "levels" in entries else "neither levels nor range"
            faults.add(node.location, f"the axis {name} has {found_keys}; give one of them")
            return ()
        if "levels" in entries and design != ONE_AT_A_TIME:
            text = f"the design {design} needs a range of {name}: write range: [LOW, HIGH]"
            faults.add(entries["levels"].location, text)
            return ()
        if "steps" in entries and ("levels" in entries or design != ONE_AT_A_TIME):
            faults.add(entries["steps"].location, f"steps of {name} belongs to range and {ONE_AT_A_TIME}; remove it")
        if "levels" in entries:
            return self._listed_levels(entries["levels"])
        ends = self._ends(entries["range"])
        if not ends or design != ONE_AT_A_TIME:
            return ends
        steps = self.reading.count(entries["steps"], "steps", 2, MAX_LEVELS) if "steps" in entries else None
        last = (steps or DEFAULT_STEPS) - 1
        levels = (ends[0] + index / last * (ends[1] - ends[0]) for index in range(last + 1))
        return tuple(dict.fromkeys(rounded_level(level) for level in levels))

    def _listed_levels(self, node: Node) -> tuple[float, ...]:
        items = self.reading.items(node, f"levels of {self.axis.name}", "[0, 10, 20]") or ()
        levels: list[float] = []
        for item in items:
            value = self.number(item, "each level")
            if value in levels:
                self.reading.faults.add(item.location, f"the axis {self.axis.name} has the level {value:g} twice")
            levels.append(value)
        return tuple(sorted(levels))

    def _ends(self, node: Node) -> tuple[float, ...]:
        items = self.reading.items(node, f"range of {self.axis.name}", "[0, 20]") or ()
        ends = tuple(self.number(item, "each end of the range") for item in items)
        if items and (len(ends) != 2 or ends[0] >= ends[1]):
            text = f"the range of {self.axis.name} must be [LOW, HIGH] with LOW < HIGH, found {list(ends)}"
            self.reading.faults.add(node.location, text)
            return ()
        return ends


def rounded_level(value: float) -> float:
    """Returns a computed level with `LEVEL_DIGITS` significant digits."""
    return float(f"{value:.{LEVEL_DIGITS}g}")
