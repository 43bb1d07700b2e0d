# SPDX-License-Identifier: BSD-3-Clause
"""Reads the key `perturb` of an experiment file: axes with their levels or ranges, and the design.

The levels become those of the factor `perturbation`. One label states the values of a level, such as
`perceived_pose_error=10 mm`, so that databases and exports need no other table.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from collections.abc import Mapping as Map
from typing import TYPE_CHECKING

from modular_framework_benchmark.experiments.axis_reading import MAX_LEVELS, ReadAxis, read_axis, rounded_level
from modular_framework_benchmark.experiments.factor_reading import Level, Levels
from modular_framework_benchmark.experiments.reading import ExperimentFault, ValueReading
from modular_framework_benchmark.records.perturbation import (
    AXES,
    DESIGNS,
    NOMINAL,
    ONE_AT_A_TIME,
    PERTURBATION,
    SOBOL,
    Perturbation,
    Perturbations,
    PerturbedLevel,
)
from modular_framework_core.files.faults import FaultList
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, loads
from modular_framework_core.task_constructor.key_spelling import corrected_keys
from modular_framework_ros.allowed_names import listing

if TYPE_CHECKING:
    import numpy as np

AXES_EXAMPLE = "{perceived_pose_error: {unit: mm, levels: [0, 10, 20]}}"
EXAMPLE = f"{{axes: {AXES_EXAMPLE}}}"
KEYS = ("axes", "design", "points", "wanted_success")
TASK_MODE = "task"
DEFAULT_POINTS = 16


def read_perturbation(reading: ValueReading, node: Node, key: str) -> Perturbation | None:
    """Reads the values of axes in SI units; None if the value is no mapping.

    Args:
        reading: Reader that collects faults.
        node: Value in the file.
        key: Name of the key, for faults.
    """
    mapping = reading.mapping(node, key, "{object_mass: 2}")
    if mapping is None:
        return None
    entries_node = corrected_keys(mapping, tuple(AXES), "the axis", reading.faults)
    values = {
        name: number
        for name, value in entries_node.entries.items()
        if (number := reading.number(value, name, AXES[name].low, AXES[name].high)) is not None
    }
    return Perturbation(**values)


class PerturbReader:
    """Reads the key `perturb`.

    Args:
        reading: Reader that collects faults.
        seed: Seed of the experiment, which a space-filling design needs.
    """

    def __init__(self, reading: ValueReading, seed: int) -> None:
        self._reading, self._seed = reading, seed
        self._axes: list[ReadAxis] = []

    def read(self, node: Node) -> Perturbations | None:
        """Returns the perturbations; None after a fault."""
        reading = self._reading
        before = len(reading.faults)
        mapping = reading.mapping(node, "perturb", EXAMPLE)
        if mapping is None:
            return None
        entries = corrected_keys(mapping, KEYS, "the key of perturb", reading.faults).entries
        design = reading.choice(entries["design"], "design", DESIGNS) if "design" in entries else ONE_AT_A_TIME
        wanted_success = (
            reading.number(entries["wanted_success"], "wanted_success", 0.01, 0.99)
            if "wanted_success" in entries
            else 0.5
        )
        points = self._points(entries, design or ONE_AT_A_TIME)
        self._read_axes(node, entries.get("axes"), design or ONE_AT_A_TIME)
        if len(reading.faults) > before or design is None or wanted_success is None or points is None:
            return None
        levels = self._one_at_a_time() if design == ONE_AT_A_TIME else self._space_filling(design, points)
        distinct = {level.label: level for level in levels}
        return Perturbations(
            tuple(axis.perturbed_axis for axis in self._axes), tuple(distinct.values()), design, wanted_success
        )

    def factor_levels(self, perturbations: Perturbations) -> dict[str, Level]:
        """Returns the levels of the factor `perturbation`, whose settings have SI units."""
        levels = {}
        for level in perturbations.levels:
            changed = [axis for axis in self._axes if level.values[axis.name] != axis.nominal]
            location = (changed or self._axes)[0].node.location
            values: dict[str, Node] = {
                axis.name: Scalar(axis.in_si(level.values[axis.name]), axis.node.location) for axis in self._axes
            }
            inner = Mapping(values, dict.fromkeys(values, location), location)
            settings = Mapping({PERTURBATION: inner}, {PERTURBATION: location}, location)
            levels[level.label] = Level(Scalar(level.label, location), settings)
        return levels

    def _points(self, entries: Map[str, Node], design: str) -> int | None:
        node = entries.get("points")
        if node is None:
            return DEFAULT_POINTS
        points = self._reading.count(node, "points", 2, MAX_LEVELS)
        if design == ONE_AT_A_TIME:
            text = f"points belongs to a space-filling design; remove it, or write design: {SOBOL}"
            self._reading.faults.add(node.location, text)
        elif design == SOBOL and points is not None and not math.log2(points).is_integer():
            below = 2 ** int(math.log2(points))
            text = f"points of {SOBOL} must be a power of two, found {points}; write {below} or {2 * below}"
            self._reading.faults.add(node.location, text)
        return points

    def _read_axes(self, node: Node, axes: Node | None, design: str) -> None:
        reading = self._reading
        mapping = None if axes is None else reading.mapping(axes, "axes", AXES_EXAMPLE)
        if axes is None or mapping is not None and not mapping.entries:
            reading.faults.add(node.location, f"perturb has no axes; {listing(AXES)}; write {EXAMPLE}")
        if mapping is not None:
            axes_node = corrected_keys(mapping, tuple(AXES), "the axis", reading.faults)
            read = (read_axis(AXES[name], value, design, reading) for name, value in axes_node.entries.items())
            self._axes = [axis for axis in read if axis is not None]

    def _one_at_a_time(self) -> Iterator[PerturbedLevel]:
        nominal = {axis.name: axis.nominal for axis in self._axes}
        yield PerturbedLevel(NOMINAL, nominal)
        for axis in self._axes:
            for value in axis.levels:
                if value != axis.nominal:
                    yield PerturbedLevel(axis.text(value), {**nominal, axis.name: value})

    def _space_filling(self, design: str, points: int) -> Iterator[PerturbedLevel]:
        yield PerturbedLevel(NOMINAL, {axis.name: axis.nominal for axis in self._axes})
        for point in _design_points(design, len(self._axes), points, self._seed):
            values = {
                axis.name: rounded_level(axis.levels[0] + fraction * (axis.levels[-1] - axis.levels[0]))
                for axis, fraction in zip(self._axes, point, strict=True)
            }
            label = ", ".join(axis.text(values[axis.name]) for axis in self._axes)
            yield PerturbedLevel(label, values)


def _design_points(design: str, dimensions: int, points: int, seed: int) -> np.ndarray:
    """Returns the points of a space-filling design in the unit cube, shape (points, dimensions)."""
    from scipy.stats import qmc  # slow to import, and few experiments need it

    sampler = qmc.Sobol if design == SOBOL else qmc.LatinHypercube
    return sampler(d=dimensions, rng=seed).random(points)


def perturbation_factor(experiment: Mapping, mode: str | None, reading: ValueReading) -> Levels:
    """Returns the factor whose levels are the perturbations; empty without the key `perturb`.

    Args:
        experiment: Mapping of the experiment file.
        mode: Mode of the experiment; None if unknown.
        reading: Reader that collects faults.
    """
    own, node = experiment.entries.get("factors"), experiment.entries.get("perturb")
    if isinstance(own, Mapping) and PERTURBATION in own.keys:
        text = f"the factor '{PERTURBATION}' is reserved for the levels of perturb; rename it"
        reading.faults.add(own.keys[PERTURBATION], text)
    if node is None:
        return {}
    if mode != TASK_MODE:
        if mode is not None:
            reading.faults.add(node.location, f"perturb needs the mode {TASK_MODE}, found {mode}; remove it")
        return {}
    reader = PerturbReader(reading, seed_of(experiment))
    perturbations = reader.read(node)
    return {} if perturbations is None else {PERTURBATION: reader.factor_levels(perturbations)}


def with_perturbations(design: list[dict[str, str]], factors: Levels) -> list[dict[str, str]]:
    """Returns the combinations of levels, each with every perturbation.

    Args:
        design: Level of each factor of the user, in each combination.
        factors: Levels of all factors.
    """
    if PERTURBATION not in factors:
        return design
    return [{**combination, PERTURBATION: label} for combination in design for label in factors[PERTURBATION]]


def seed_of(experiment: Mapping) -> int:
    """Returns the seed of an experiment; 1 without a valid seed.

    Args:
        experiment: Mapping of the experiment file.
    """
    node = experiment.entries.get("seed")
    seed = None if node is None else ValueReading(FaultList()).count(node, "seed", 0)
    return 1 if seed is None else seed


def perturbations_of(text: str) -> Perturbations | None:
    """Returns the perturbations in the text of a checked experiment; None without perturbations.

    Args:
        text: Text of the experiment file.

    Raises:
        ExperimentFault: The stored text is invalid.
    """
    faults = FaultList()
    root = loads(text, "the stored experiment", faults)
    if not isinstance(root, Mapping) or "perturb" not in root.entries:
        return None
    perturbations = PerturbReader(ValueReading(faults), seed_of(root)).read(root.entries["perturb"])
    if perturbations is None:
        raise ExperimentFault(faults.sorted_faults())
    return perturbations


def with_run_labels(perturbations: Perturbations, labels: Iterable[str]) -> Perturbations:
    """Returns the perturbations with the levels that ran, read from their labels.

    Another version of SciPy may compute other points of a space-filling design.

    Args:
        perturbations: Perturbations of the experiment file.
        labels: Labels of the levels in the database.
    """
    level_of_label = {level.label: level for level in perturbations.levels}
    levels = tuple(level_of_label.get(label) or PerturbedLevel(label, _values_of(label)) for label in labels)
    return Perturbations(perturbations.axes, levels, perturbations.design, perturbations.wanted_success)


def _values_of(label: str) -> dict[str, float]:
    """Returns the values in a label such as `object_mass=2.5, perceived_pose_error=12 mm`."""
    parts = [part.partition("=") for part in label.split(", ")]
    return {name: float(value.split()[0]) for name, _, value in parts}
