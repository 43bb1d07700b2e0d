# SPDX-License-Identifier: BSD-3-Clause
"""Reads and checks an experiment file before any episode runs; reports all faults with line and column."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from collections.abc import Mapping as Map
from dataclasses import fields
from pathlib import Path
from typing import Any

from modular_framework_benchmark.experiments.experiment import (
    Combination,
    Experiment,
    RunSettings,
    Stopping,
    StoppingKind,
)
from modular_framework_benchmark.experiments.factor_reading import (
    Execution,
    Levels,
    combined_settings,
    note_conflicts,
    note_equal_levels,
    note_unused,
    read_design,
    read_factors,
)
from modular_framework_benchmark.experiments.metric_choices import metric_files, read_metrics
from modular_framework_benchmark.experiments.mode import CheckedSettings, ReadSettings, SettingsCheck
from modular_framework_benchmark.experiments.modes import MODES
from modular_framework_benchmark.experiments.perturb_reading import perturbation_factor, with_perturbations
from modular_framework_benchmark.experiments.reading import ExperimentFault, Reading, ValueReading
from modular_framework_benchmark.experiments.resource_lookup import ResourceLookup
from modular_framework_benchmark.experiments.setting_trees import check_references, location_below
from modular_framework_benchmark.records.column_names import (
    allowed_names_text,
    factor_name_faults,
    metric_name_faults,
)
from modular_framework_benchmark.records.episode_settings import EpisodeSettings, MetricSpec, RecordedFiles, as_json
from modular_framework_benchmark.records.experiment import ExperimentDescription, Factor, Metric
from modular_framework_benchmark.records.perturbation import PERTURBATION
from modular_framework_core.files.atomic_files import read_text
from modular_framework_core.files.faults import Fault, FaultList, SourceLocation, TaskFault
from modular_framework_core.files.located_yaml import Mapping, Scalar, loads
from modular_framework_core.task_constructor.key_spelling import corrected_keys, value_of
from modular_framework_ros.allowed_names import closest

REQUIRED = ("experiment", "mode", "factors", "compare")
OPTIONAL = (
    "description", "design", "perturb", "trials", "seed", "block", "metrics", "stopping", "confidence", "time_limit",
    "workers", "record",
)  # fmt: skip
KEYS = (*REQUIRED, *OPTIONAL)
CONDITIONAL_METRICS: Map[str, tuple[Callable[[EpisodeSettings], bool], str]] = {
    "progress": (lambda settings: settings.has_milestones, "milestones; list them in the key progress"),
    "hold_time": (lambda settings: settings.is_shaken, "a shake; add shake: SECONDS to the key success"),
}
"""Metrics that only some episodes can have: whether an episode has the metric, and what the metric needs."""
MAX_EPISODES = 10_000_000

SettingChecks = Map[str, SettingsCheck]
KnownMetrics = Map[str, Map[str, Metric]]
"""Available metrics by name, keyed by mode."""


def load_experiment(
    path: Path,
    resources: ResourceLookup,
    known_metrics: KnownMetrics,
    checks: SettingChecks | None = None,
    launch: str = "",
) -> Experiment:
    """Reads and checks an experiment file.

    Args:
        path: Experiment file.
        resources: Lookup of launch files, tasks, models and packages.
        known_metrics: Metrics of each mode.
        checks: Checks of each mode that resolve the names in its settings; None to skip these checks.
        launch: Launch file that replaces the key `launch`; "" to keep the key.

    Raises:
        ExperimentFault: The file is invalid; the error contains every fault.
    """
    start = SourceLocation(str(path), 1, 1)
    try:
        text = read_text(path)
    except FileNotFoundError as error:
        raise ExperimentFault([Fault(start, "there is no such file; name an experiment file (.yaml)")]) from error
    except (OSError, UnicodeDecodeError) as error:
        raise ExperimentFault([Fault(start, f"the file cannot be read: {error}")]) from error
    return read_experiment(text, path, resources, known_metrics, checks, launch=launch)


def read_experiment(
    text: str,
    path: Path,
    resources: ResourceLookup,
    known_metrics: KnownMetrics,
    checks: SettingChecks | None = None,
    *,
    launch: str = "",
) -> Experiment:
    """Reads and checks the text of an experiment file, as `load_experiment` does.

    Args:
        text: Text of the file.
        path: Path of the file, for messages and relative paths.
        resources: Lookup of the references.
        known_metrics: Metrics that need no definition.
        checks: Checks of the settings, keyed by mode.
        launch: Launch file that replaces the key `launch`; "" to keep the key.
    """
    faults = FaultList()
    start = SourceLocation(str(path), 1, 1)
    if not any(line.strip() and not line.lstrip().startswith("#") for line in text.splitlines()):
        raise ExperimentFault([Fault(start, f"the file is empty; an experiment needs {', '.join(REQUIRED)}")])
    try:
        root = loads(text, str(path), faults)
    except TaskFault as error:
        raise ExperimentFault.of(error) from error
    if not isinstance(root, Mapping):
        raise ExperimentFault([Fault(root.location, "the file must be a mapping, from keys such as experiment")])
    if launch:
        root.entries["launch"], root.keys["launch"] = Scalar(launch, root.location), root.location
    reading = Reading(faults, path.resolve().parent, resources)
    experiment = _Reader(root, text, path, reading=reading, known_metrics=known_metrics, checks=checks or {}).read()
    if experiment is None:
        raise ExperimentFault(faults.sorted_faults())
    return experiment


class _Reader:
    """Reader of the parts of an experiment file."""

    def __init__(
        self,
        root: Mapping,
        text: str,
        path: Path,
        *,
        reading: Reading,
        known_metrics: KnownMetrics,
        checks: SettingChecks,
    ) -> None:
        self._checks = checks
        self._substitutions: dict[str, None] = {}
        self._text, self._path, self._reading, self._known = text, path, reading, known_metrics
        mode = value_of(root, "mode")
        self._mode = str(mode.value) if isinstance(mode, Scalar) and mode.value in MODES else None
        mode_keys = tuple(MODES[str(self._mode)].keys) if self._mode is not None else _keys_of_all_modes()
        self._root = corrected_keys(root, (*KEYS, *mode_keys), "the key", reading.faults)
        self._mode_keys = mode_keys
        self._refers_to_factors = True
        self._meant_factors: dict[str, str] = {}
        self._base = Mapping(
            {key: value for key, value in self._root.entries.items() if key in mode_keys},
            {key: value for key, value in self._root.keys.items() if key in mode_keys},
            root.location,
        )

    def read(self) -> Experiment | None:
        """Returns the experiment, or None after faults."""
        entries, reading = self._root.entries, self._reading
        for key in REQUIRED:
            if key not in entries:
                reading.faults.add(self._root.location, f"the experiment has no '{key}'; add it")
        if "mode" in entries:
            reading.choice(entries["mode"], "mode", tuple(MODES))
        name = reading.name(entries["experiment"], "experiment") if "experiment" in entries else ""
        factors = self._factors()
        own = {factor: levels for factor, levels in factors.items() if factor != PERTURBATION}
        compared = self._compared_factor(own)
        design = read_design(entries.get("design"), own, reading) if own else []
        self._note_unpaired(design, compared)
        design = with_perturbations(design, factors)
        numbers = self._numbers(len(design))
        combinations = self._combinations(factors, design)
        metrics, metric_specs = self._metrics(combinations)
        self._note_names(metrics, factors)
        stopping = self._stopping(metrics)
        if "description" in entries:
            reading.text(entries["description"], "description")
        record = self._record()
        self._note_repeated_problems(stopping, combinations, int(numbers["trials"] or 0))
        if len(reading.faults):
            return None
        description = ExperimentDescription(
            name=str(name),
            mode=str(self._mode),
            text=self._text,
            digest="",
            factors=tuple(Factor(factor, tuple(levels)) for factor, levels in factors.items()),
            compared=compared,
            metrics=metrics,
            time_limit_s=float(numbers["time_limit"] or 0.0),
            confidence=float(numbers["confidence"] or 0.0),
            sequential=stopping.kind is StoppingKind.SEQUENTIAL,
            source=str(self._path.resolve()),
        )
        return Experiment(
            description=description,
            combinations=combinations,
            trials=int(numbers["trials"] or 0),
            seed=int(numbers["seed"] or 0),
            block=int(numbers["block"] or 1),
            metric_specs=metric_specs,
            stopping=stopping,
            workers=int(numbers["workers"] or 1),
            record=record,
            files=_digests(
                metric_files(metric_specs) + [file for combination in combinations for file in combination.files]
            ),
            substitutions=tuple(self._substitutions),
        )

    def _factors(self) -> Levels:
        node = self._root.entries.get("factors")
        if node is None:
            return {}
        factors = read_factors(node, self._mode_keys, self._reading)
        factors = {**factors, **perturbation_factor(self._root, self._mode, self._reading)}
        note_conflicts(factors, self._reading)
        trees = [self._base, *(level.settings for levels in factors.values() for level in levels.values())]
        unknown = [name for tree in trees for name in check_references(tree, factors, self._reading.faults)]
        self._meant_factors = {name: meant for name in unknown if (meant := closest(name, factors)) is not None}
        self._refers_to_factors = len(self._meant_factors) == len(set(unknown))
        if isinstance(node, Mapping) and not unknown:
            note_unused(factors, self._base, node, self._reading)
        return factors

    def _compared_factor(self, factors: Levels) -> str:
        node = self._root.entries.get("compare")
        name = self._reading.choice(node, "compare", tuple(factors)) if node is not None and factors else None
        if node is not None and name is not None and len(factors[name]) < 2:
            self._reading.faults.add(node.location, f"factor '{name}' has one level; comparing needs at least two")
        return name or ""

    def _note_unpaired(self, design: list[dict[str, str]], compared: str) -> None:
        """Adds a fault for each combination of a listed design that only one method has: its pairs lack a partner."""
        node = self._root.entries.get("design")
        if node is None or not design or not compared:
            return
        partners: dict[tuple[tuple[str, str], ...], set[str]] = {}
        for item in design:
            other_levels = tuple(sorted((name, label) for name, label in item.items() if name != compared))
            partners.setdefault(other_levels, set()).add(item[compared])
        for other_levels, methods in partners.items():
            if len(methods) < 2:
                where = ", ".join(f"{name} {label}" for name, label in other_levels) or "the experiment"
                self._reading.faults.add(
                    node.location, f"{where} has only {compared} '{min(methods)}'; add another one to compare it with"
                )

    def _numbers(self, combinations: int) -> dict[str, float | int | None]:
        reading, entries = self._reading, self._root.entries

        def count(key: str, default: int, low: int = 1, high: int = 2**31 - 1) -> int | None:
            return reading.count(entries[key], key, low, high) if key in entries else default

        def number(key: str, default: float, low: float, high: float) -> float | None:
            return reading.number(entries[key], key, low, high) if key in entries else default

        max_trials = MAX_EPISODES // max(combinations, 1)
        return {
            "trials": count("trials", 20, 1, max_trials),
            "seed": count("seed", 1, 0),
            "block": count("block", 1),
            "workers": count("workers", 1, 1, 1024),
            "confidence": number("confidence", 0.95, 0.5, 0.9999),
            "time_limit": number("time_limit", 300.0, 0.1, 86400.0),
        }

    def _stopping(self, metrics: tuple[Metric, ...]) -> Stopping:
        node = self._root.entries.get("stopping")
        mapping = self._reading.mapping(node, "stopping", "{rule: sequential}") if node is not None else None
        if mapping is None:
            return Stopping()
        return read_stopping(mapping, metrics, self._reading)

    def _note_repeated_problems(self, stopping: Stopping, items: tuple[Combination, ...], trials: int) -> None:
        """Adds a fault for repeated problems under a sequential rule, which would change units already analysed."""
        counts = {len(item.problems) for item in items}
        min_problems = min((count for count in counts if count > 1), default=trials)
        if stopping.kind is StoppingKind.SEQUENTIAL and min_problems < trials:
            self._reading.faults.add(
                self._root.entries["stopping"].location,
                f"a sequential rule needs a problem for each trial: {min_problems} problems, {trials} trials; make "
                "more problems, set fewer trials, or use {rule: fixed}",
            )

    def _metrics(self, combinations: tuple[Combination, ...]) -> tuple[tuple[Metric, ...], tuple[MetricSpec, ...]]:
        if self._mode is None:  # the available metrics depend on the mode
            return (), ()
        budgets = {combination.settings.budget_s for combination in combinations}
        budget_s = budgets.pop() if len(budgets) == 1 else None
        node, known_metrics = self._root.entries.get("metrics"), dict(self._known.get(self._mode, {}))
        missing = {
            name: needs
            for name, (is_available, needs) in CONDITIONAL_METRICS.items()
            if combinations and not any(is_available(combination.settings) for combination in combinations)
        }
        if node is None:
            known_metrics = {name: metric for name, metric in known_metrics.items() if name not in missing}
        metrics, metric_specs = read_metrics(node, known_metrics, budget_s, self._reading)
        for name, needs in missing.items():
            if node is not None and name in metric_specs:
                self._reading.faults.add(node.location, f"the metric '{name}' needs {needs}")
        return metrics, metric_specs

    def _note_names(self, metrics: tuple[Metric, ...], factors: Levels) -> None:
        """Adds a fault for each metric or factor with the name of a column of the result tables."""
        entries = self._root.entries
        named = [Factor(factor, tuple(levels)) for factor, levels in factors.items() if factor != PERTURBATION]
        if "metrics" in entries:
            for fault in metric_name_faults(metrics):
                self._reading.faults.add(entries["metrics"].location, f"{fault}; rename it; {allowed_names_text()}")
        if "factors" in entries:
            for fault in factor_name_faults(named, metrics):
                self._reading.faults.add(entries["factors"].location, f"{fault}; rename it; {allowed_names_text()}")

    def _record(self) -> RecordedFiles:
        node = self._root.entries.get("record")
        mapping = self._reading.mapping(node, "record", "{video: true}") if node is not None else None
        if mapping is None:
            return RecordedFiles()
        kinds = tuple(item.name for item in fields(RecordedFiles))
        kinds_node = corrected_keys(mapping, kinds, "the key of record", self._reading.faults)
        return RecordedFiles(
            **{key: bool(self._reading.truth(value, key)) for key, value in kinds_node.entries.items()}
        )

    def _combinations(self, factors: Levels, design: list[dict[str, str]]) -> tuple[Combination, ...]:
        if self._mode is None or not self._refers_to_factors or not all(factors.values()):
            return ()
        combinations, executions = [], {}
        for item in design:
            node = combined_settings(self._base, factors, item, self._meant_factors)
            read = MODES[self._mode].read(node, self._reading)
            executions[tuple(item.items())] = self._resolve_settings(read)
            combinations.append(Combination(item, read.settings, read.objects, read.problems))
        if not len(self._reading.faults):
            note_equal_levels(factors, executions, self._reading)
        return tuple(combinations)

    def _resolve_settings(self, read: ReadSettings[Any]) -> Execution:
        """Resolves the names in a combination's settings."""
        check = self._checks.get(str(self._mode))
        checked = CheckedSettings((), as_json(read.settings)) if check is None else check(read)
        for fault in checked.faults:
            self._reading.faults.add(location_below(read.node, fault.keys), fault.text)
        self._substitutions.update(dict.fromkeys(checked.substitutions))
        content = [checked.resolved, read.objects, read.problems]
        text = "" if checked.resolved is None else json.dumps(content, sort_keys=True, default=repr)
        return Execution(read.node, text, checked.without_effect)


def read_stopping(node: Mapping, metrics: tuple[Metric, ...], reading: ValueReading) -> Stopping:
    """Reads the stopping rule.

    Args:
        node: Mapping of the file.
        metrics: Metrics of the experiment, as allowed values of the rule's metric.
        reading: Reader that collects faults.
    """
    keys = ("rule", "metric", "smallest_difference")
    entries_node = corrected_keys(node, keys, "the key of stopping", reading.faults)
    kinds = [kind.value for kind in StoppingKind]
    if "rule" not in entries_node.entries:
        reading.faults.add(node.location, f"stopping has no rule; allowed: {', '.join(kinds)}")
        return Stopping()
    kind = StoppingKind(reading.choice(entries_node.entries["rule"], "rule", kinds) or "fixed")
    values: dict[str, Any] = {}
    if "smallest_difference" in entries_node.entries:
        values["smallest_difference"] = reading.number(
            entries_node.entries["smallest_difference"], "smallest_difference", 1e-9, 1.0
        )
    if "metric" in entries_node.entries:
        names = dict.fromkeys(["success", *(metric.name for metric in metrics)])
        values["metric"] = reading.choice(entries_node.entries["metric"], "the metric of stopping", names)
    if kind is StoppingKind.FIXED and values:
        reading.faults.add(node.location, "the rule fixed has no other keys; remove them, or write sequential")
    return Stopping(kind, **{key: value for key, value in values.items() if value is not None})


def read_run_settings(text: str, metrics: tuple[Metric, ...]) -> RunSettings:
    """Reads the execution settings, which do not determine the episodes, from the text of a checked experiment.

    Args:
        text: Text of the experiment file.
        metrics: Metrics of the experiment.

    Raises:
        ExperimentFault: The stored text is invalid.
    """
    faults = FaultList()
    root = loads(text, "the stored experiment", faults)
    reading = ValueReading(faults)
    entries = root.entries if isinstance(root, Mapping) else {}
    workers = reading.count(entries["workers"], "workers") if "workers" in entries else 1
    node = entries.get("stopping")
    stopping = read_stopping(node, metrics, reading) if isinstance(node, Mapping) else Stopping()
    if len(faults):
        raise ExperimentFault(faults.sorted_faults())
    return RunSettings(workers or 1, stopping)


def _keys_of_all_modes() -> tuple[str, ...]:
    return tuple({key: None for mode in MODES.values() for key in mode.keys})


def _digests(paths: list[Path]) -> dict[str, str]:
    """Returns the SHA-256 digest of each file, keyed by the last two parts of its path for portability."""
    return {
        f"{path.parent.name}/{path.name}": hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(set(paths))
    }
