# SPDX-License-Identifier: BSD-3-Clause
"""Reads the factors of an experiment file and combines their levels."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable
from collections.abc import Mapping as Map
from dataclasses import dataclass

from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_benchmark.experiments.setting_trees import (
    leaves,
    level_label,
    merge_settings,
    references,
    substitute_levels,
)
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence, kind_of
from modular_framework_core.task_constructor.key_spelling import corrected_keys

MAX_REASONS = 5
"""Maximum number of settings in the fault of two levels that run the same."""
_ABSENT = object()
EXAMPLE = "{grasp_method: {above: {arguments: {...}}, aside: {...}}, object: [cube, can]}"


@dataclass(frozen=True, slots=True)
class Level:
    """A level of a factor: its label as written in the file, and its settings."""

    value: Scalar
    settings: Mapping


Levels = Map[str, Map[str, Level]]
"""Levels by label, keyed by factor name."""


def read_factors(node: Node, mode_keys: Collection[str], reading: Reading) -> Levels:
    """Returns the levels of each factor by label, and adds faults.

    Args:
        node: Value of the key `factors`.
        mode_keys: Keys of the mode.
        reading: Reader that collects faults.
    """
    mapping = reading.mapping(node, "factors", EXAMPLE)
    if mapping is None:
        return {}
    if not mapping.entries:
        reading.faults.add(node.location, f"factors is empty; name the values to compare, such as {EXAMPLE}")
    factors: dict[str, Map[str, Level]] = {}
    for name, value in mapping.entries.items():
        if not name.isidentifier():
            reading.faults.add(mapping.keys[name], f"the factor '{name}' must be letters, digits and underscores")
        factors[name] = _read_levels(name, value, mode_keys, reading)
    return factors


def _read_levels(factor: str, node: Node, mode_keys: Collection[str], reading: Reading) -> dict[str, Level]:
    levels: dict[str, Level] = {}
    if isinstance(node, Mapping):
        for label, value in node.entries.items():
            settings = reading.mapping(value, f"the level '{label}'", "{arguments: {...}}")
            if settings is not None:
                known_settings = corrected_keys(settings, mode_keys, f"what level '{label}' sets,", reading.faults)
                levels[label] = Level(Scalar(label, node.keys[label]), known_settings)
    elif isinstance(node, Sequence):
        for item in node.items:
            if not isinstance(item, Scalar) or item.value is None or item.value == "":
                reading.faults.add(item.location, f"a level in a list must be one value, found {kind_of(item)}")
            elif level_label(item) in levels:
                reading.faults.add(item.location, f"factor '{factor}' has the level '{level_label(item)}' twice")
            else:
                levels[level_label(item)] = Level(item, Mapping({}, {}, item.location))
    if not levels and (isinstance(node, Scalar) or not _items_of(node)):
        reading.faults.add(
            node.location,
            f"factor '{factor}' has no levels; allowed: a mapping of labels to settings, or a list of labels",
        )
    return levels


def _items_of(node: Node) -> Iterable[object]:
    return node.entries if isinstance(node, Mapping) else node.items if isinstance(node, Sequence) else ()


def note_conflicts(factors: Levels, reading: Reading) -> None:
    """Adds a fault for each value that two factors set, because the effective value would be undefined.

    Args:
        factors: Levels of each factor.
        reading: Reader that collects faults.
    """
    setters: dict[tuple[str, ...], str] = {}
    for name, levels in factors.items():
        for level in levels.values():
            for path, value in leaves(level.settings):
                prefixes = [path[:length] for length in range(1, len(path) + 1)]
                setter = next((setters[end] for end in prefixes if setters.get(end, name) != name), None)
                if setter is not None:
                    reading.faults.add(
                        value.location,
                        f"factor '{name}' sets {'.'.join(path)}, which factor '{setter}' sets too; remove one of them",
                    )
        for level in levels.values():
            setters |= {path: setters.get(path, name) for path, _ in leaves(level.settings)}


def note_unused(factors: Levels, base: Mapping, node: Mapping, reading: Reading) -> None:
    """Adds a fault for each factor without effect: its levels set nothing and no value refers to it.

    Args:
        factors: Levels of each factor.
        base: Settings of every combination.
        node: Value of the key `factors`.
        reading: Reader that collects faults.
    """
    effective = {name for name, _ in references(base)}
    for levels in factors.values():
        for level in levels.values():
            effective |= {name for name, _ in references(level.settings)}
    for name, levels in factors.items():
        if levels and name not in effective and not any(level.settings.entries for level in levels.values()):
            reading.faults.add(
                node.keys[name],
                f"factor '{name}' changes nothing; write ${name} in a value, or give each level its settings",
            )


@dataclass(frozen=True, slots=True)
class Execution:
    """Execution of a combination of levels.

    Attributes:
        node: Settings as written: base settings overridden by the levels.
        text: Description of the execution, equal for combinations that run the same; empty if unknown.
        without_effect: Settings without effect and the reasons, see `CheckedSettings`.
    """

    node: Mapping
    text: str
    without_effect: Map[str, str]


Executions = Map[tuple[tuple[str, str], ...], Execution]
"""Execution of each combination, keyed by its factors and labels."""


def note_equal_levels(factors: Levels, executions: Executions, reading: Reading) -> None:
    """Adds a fault for two levels of a factor that execute the same in every combination.

    Args:
        factors: Levels of each factor.
        executions: Execution of each combination.
        reading: Reader that collects faults.
    """
    for name, levels in factors.items():
        runs: dict[str, dict[tuple[tuple[str, str], ...], Execution]] = {label: {} for label in levels}
        for combination, execution in executions.items():
            other_levels = tuple(item for item in combination if item[0] != name)
            runs[dict(combination)[name]][other_levels] = execution
        for one, other in itertools.combinations(levels, 2):
            pairs = [(run, runs[other].get(where)) for where, run in runs[one].items()]
            if pairs and len(pairs) == len(runs[other]) and all(_are_equal(run, same) for run, same in pairs):
                reading.faults.add(
                    levels[other].value.location,
                    f"the levels '{one}' and '{other}' of factor '{name}' run the same: {_likeness(pairs)}; change or "
                    "remove one",
                )


def _are_equal(one: Execution, other: Execution | None) -> bool:
    return other is not None and bool(one.text) and one.text == other.text


def _likeness(pairs: Iterable[tuple[Execution, Execution | None]]) -> str:
    """Returns the reason why the differing settings of two levels execute the same."""
    reasons: dict[str, None] = {}
    for pair in pairs:
        one, other = ({path: value.plain() for path, value in leaves(run.node)} for run in pair if run is not None)
        known = {name: reason for run in pair if run is not None for name, reason in run.without_effect.items()}
        for path in dict.fromkeys([*one, *other]):
            if one.get(path, _ABSENT) != other.get(path, _ABSENT):
                name = "/".join(path[1:]) if path[0] == "parameters" else f"/{'/'.join(path)}"
                reasons[f"'{'.'.join(path)}' {known.get(name, 'resolves to the same in both')}"] = None
    more = [f"and {len(reasons) - MAX_REASONS} more"] if len(reasons) > MAX_REASONS else []
    return ", ".join([*list(reasons)[:MAX_REASONS], *more]) or "their settings are equal"


def combined_settings(
    base: Mapping, factors: Levels, configuration: Map[str, str], intended_factors: Map[str, str]
) -> Mapping:
    """Returns the base settings overridden by the settings of one level per factor.

    Args:
        base: Settings of every combination.
        factors: Levels of each factor.
        configuration: Label of a level of each factor.
        intended_factors: Intended factor of each misspelt `$NAME`, by NAME.
    """
    chosen = {name: factors[name][label] for name, label in configuration.items()}
    tree = base
    for level in chosen.values():
        tree = merge_settings(tree, level.settings)
    values = {name: level.value for name, level in chosen.items()}
    values |= {name: values[factor] for name, factor in intended_factors.items()}
    return substitute_levels(tree, values)  # type: ignore[return-value]


def read_design(node: Node | None, factors: Levels, reading: Reading) -> list[dict[str, str]]:
    """Returns the combinations of levels to run: all combinations, or those listed in the file.

    Args:
        node: Value of the key `design`; None for all combinations.
        factors: Levels of each factor.
        reading: Reader that collects faults.
    """
    full = [dict(zip(factors, labels, strict=True)) for labels in itertools.product(*factors.values())]
    if node is None or isinstance(node, Scalar) and node.value == "full":
        return full
    if not isinstance(node, Sequence):
        reading.faults.add(
            node.location, f"design must be full, or a list of combinations of levels, found {kind_of(node)}"
        )
        return full
    listed: list[dict[str, str]] = []
    for item in reading.items(node, "design", "[{grasp_method: above, object: can}]") or ():
        configuration = _listed_combination(item, factors, reading)
        if configuration is not None and configuration in listed:
            reading.faults.add(item.location, "this combination is listed twice; remove one of them")
        elif configuration is not None:
            listed.append(configuration)
    return listed


def _listed_combination(item: Node, factors: Levels, reading: Reading) -> dict[str, str] | None:
    mapping = reading.mapping(item, "each combination of design", "{grasp_method: above, object: can}")
    if mapping is None:
        return None
    node = corrected_keys(mapping, tuple(factors), "the factor", reading.faults)
    configuration: dict[str, str] = {}
    for name, levels in factors.items():
        value = node.entries.get(name)
        if value is None:
            reading.faults.add(item.location, f"this combination has no level of factor '{name}'; add it")
        elif not isinstance(value, Scalar) or level_label(value) not in levels:
            found_text = level_label(value) if isinstance(value, Scalar) else kind_of(value)
            reading.faults.add_unknown(value.location, f"the level of '{name}'", found_text, levels)
        else:
            configuration[name] = level_label(value)
    return configuration if len(configuration) == len(factors) else None
