# SPDX-License-Identifier: BSD-3-Clause
"""Reads the metrics of an experiment: names of known metrics, or functions in the user's files."""

from __future__ import annotations

import ast
import dataclasses
import math
from collections.abc import Iterator
from collections.abc import Mapping as Map
from pathlib import Path

from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_benchmark.records.episode_settings import MetricSpec, OwnMetric
from modular_framework_benchmark.records.experiment import Direction, Metric, MetricKind
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar
from modular_framework_core.task_constructor.key_spelling import corrected_keys
from modular_framework_ros.allowed_names import listing, nearest
from modular_framework_ros.reported_figures import Clock

OWN_KEYS = (
    "function", "name", "unit", "better", "kind", "clock", "limit", "component", "description", "lowest", "highest",
)  # fmt: skip
KNOWN_KEYS = ("metric", "limit")
EXAMPLE = "{function: my_metric.py:smoothness, better: lower, unit: rad}"


def read_metrics(
    node: Node | None, known_metrics: Map[str, Metric], budget_s: float | None, reading: Reading
) -> tuple[tuple[Metric, ...], tuple[MetricSpec, ...]]:
    """Returns the metrics, and their form in the episodes' settings.

    Args:
        node: List of the file; None for all known metrics.
        known_metrics: Metrics of the mode, keyed by name.
        budget_s: Time budget of a planner or solver, the limit of its times [s]; None without a budget.
        reading: Reader that collects faults.
    """
    if node is None:
        return tuple(_limited_metric(metric, budget_s) for metric in known_metrics.values()), tuple(known_metrics)
    metrics: dict[str, Metric] = {}
    metric_specs: list[MetricSpec] = []
    for item in reading.items(node, "metrics", "[success, task_time]") or ():
        metric_and_spec = _read_metric(item, known_metrics, reading)
        if metric_and_spec is None:
            continue
        metric, metric_spec = metric_and_spec
        if metric.name.lower() in (name.lower() for name in metrics):
            reading.faults.add(item.location, f"metrics has '{metric.name}' twice; remove one, or give it another name")
        metrics[metric.name] = _limited_metric(metric, budget_s)
        metric_specs.append(metric_spec)
    return tuple(metrics.values()), tuple(metric_specs)


def _limited_metric(metric: Metric, budget_s: float | None) -> Metric:
    """Returns a duration with its limit; the time limit of an episode is not used, because its clock differs."""
    if metric.kind is not MetricKind.TIME or metric.limit is not None:
        return metric
    if metric.better is Direction.HIGHER:
        return dataclasses.replace(metric, limit=0.0)  # a failure has held the object for 0 s
    within_budget = metric.component in ("planning", "kinematics") and metric.clock is Clock.WALL
    return dataclasses.replace(metric, limit=budget_s if within_budget else None)


def _read_metric(item: Node, known_metrics: Map[str, Metric], reading: Reading) -> tuple[Metric, MetricSpec] | None:
    if isinstance(item, Mapping) and "function" in item.entries:
        return _own_metric(item, reading)
    if isinstance(item, Mapping):
        return _known_with_limit(item, known_metrics, reading)
    name = reading.text(item, "each of metrics")
    if name is None:
        return None
    if ".py:" in name:
        return _own_metric(Mapping({"function": item}, {"function": item.location}, item.location), reading)
    if name not in known_metrics:
        reading.faults.add(
            item.location,
            f"the metric '{name}' is unknown; {listing(known_metrics)}, or a user's function: FILE.py:NAME"
            f"{nearest(name, known_metrics)}",
        )
        return None
    return known_metrics[name], name


def _known_with_limit(
    item: Mapping, known_metrics: Map[str, Metric], reading: Reading
) -> tuple[Metric, MetricSpec] | None:
    node = corrected_keys(item, KNOWN_KEYS, "the key of a metric", reading.faults)
    if "metric" not in node.entries:
        reading.faults.add(item.location, f"a metric needs the key metric or function, such as {EXAMPLE}")
        return None
    metric_and_spec = _read_metric(node.entries["metric"], known_metrics, reading)
    limit = reading.number(node.entries["limit"], "limit", 0.0) if "limit" in node.entries else None
    if metric_and_spec is None or limit is None:
        return metric_and_spec
    metric = dataclasses.replace(metric_and_spec[0], limit=limit)
    if fault := _limit_fault(metric):
        reading.faults.add(node.entries["limit"].location, fault)
    return metric, metric_and_spec[1]


def _limit_fault(metric: Metric) -> str:
    """Returns the fault in the limit of a metric, or ""."""
    if metric.limit is None:
        return ""
    if metric.is_fraction:
        return f"'{metric.name}' is a {_kind_words(metric.kind)}, which has no limit; remove limit"
    low, high = dataclasses.replace(metric, limit=None).bounds
    if low <= metric.limit <= high:
        return ""
    return f"limit must be in the range of '{metric.name}', {low:g} to {high:g}, found {metric.limit:g}"


def _kind_words(kind: MetricKind) -> str:
    """Returns the kind of a metric in words."""
    return kind.value.replace("_", " ")


def _own_metric(item: Mapping, reading: Reading) -> tuple[Metric, MetricSpec] | None:
    node = corrected_keys(item, OWN_KEYS, "the key of a metric", reading.faults)
    target = reading.text(node.entries["function"], "function")
    located = None if target is None else _located_function(target, node.entries["function"], reading)
    if located is None:
        return None
    path, function = located

    def text(key: str, default: str) -> str:
        value = node.entries.get(key)
        if value is None or isinstance(value, Scalar) and value.value == "":
            return default
        return reading.text(value, key) or default

    better = _choice(node, "better", [item.value for item in Direction], "higher", reading)
    kind = _choice(node, "kind", [item.value for item in MetricKind], "value", reading)
    clock = _choice(node, "clock", [item.value for item in Clock], "", reading)
    if kind == MetricKind.TIME.value and "clock" not in node.entries:
        clocks = ", ".join(item.value for item in Clock)
        reading.faults.add(item.location, f"a metric of the kind time needs the key clock; allowed: {clocks}")
    limit, lowest, highest = (
        reading.number(node.entries[key], key) if key in node.entries else None
        for key in ("limit", "lowest", "highest")
    )
    name = text("name", function)
    if not name.isidentifier():
        reading.faults.add(node.entries["name"].location, f"the name '{name}' must be letters, digits and underscores")
        return None
    metric = Metric(
        name, text("component", "own"), MetricKind(kind), Direction(better), text("unit", ""), limit=limit,
        description=text("description", ""), lowest=lowest, highest=highest,
        clock=Clock(clock) if clock else None,
    )  # fmt: skip
    for key, fault in _own_faults(metric):
        reading.faults.add(node.entries.get(key, item).location, fault)
    low, high = dataclasses.replace(metric, limit=None).bounds
    spec = OwnMetric(
        name,
        f"{path}:{function}",
        is_rate=metric.kind is MetricKind.RATE,
        lowest=low if math.isfinite(low) else None,
        highest=high if math.isfinite(high) else None,
    )
    return metric, spec


def _own_faults(metric: Metric) -> Iterator[tuple[str, str]]:
    """Yields the key and the fault of each inconsistent setting of a user's metric."""
    if fault := _limit_fault(metric):
        yield "limit", fault
    if metric.kind is MetricKind.PARTIAL_CREDIT and metric.better is Direction.LOWER:
        yield "better", "better must be higher for partial credit: an episode without a value counts as 0, the worst"
    low, high = dataclasses.replace(metric, limit=None).bounds
    if low >= high:
        yield "highest", f"highest must be a number above the smallest value, {low:g}, found {high:g}"


def _choice(node: Mapping, key: str, allowed: list[str], default: str, reading: Reading) -> str:
    if key not in node.entries:
        return default
    return reading.choice(node.entries[key], key, allowed) or default


def _located_function(target: str, node: Node, reading: Reading) -> tuple[Path, str] | None:
    """Returns the file and name of an existing function; the file is parsed but not executed."""
    file, _, function = target.rpartition(":")
    if not file.endswith(".py") or not function.isidentifier():
        reading.faults.add(node.location, f"'{target}' is not a function of a file; allowed: FILE.py:NAME")
        return None
    path = reading.path(file)
    try:
        tree = ast.parse(path.read_bytes(), str(path))
    except FileNotFoundError:
        python_files = sorted(found.name for found in path.parent.glob("*.py")) if path.parent.is_dir() else []
        hint = nearest(path.name, python_files)
        reading.faults.add(node.location, f"there is no file {path}; name a Python file with the function{hint}")
        return None
    except (OSError, SyntaxError, ValueError) as error:
        reading.faults.add(node.location, f"{path} is not a readable Python file: {error}")
        return None
    functions = {item.name: item for item in tree.body if isinstance(item, ast.FunctionDef)}
    if function not in functions:
        reading.faults.add_unknown(node.location, f"the function of {path.name}", function, functions)
        return None
    arguments = functions[function].args
    if len(arguments.posonlyargs) + len(arguments.args) - len(arguments.defaults) > 1 or not (
        arguments.posonlyargs or arguments.args or arguments.vararg
    ):
        reading.faults.add(
            node.location, f"the function '{function}' must take one argument, the measurements of an episode"
        )
        return None
    return path, function


def metric_files(metric_specs: tuple[MetricSpec, ...]) -> list[Path]:
    """Returns the files of the user's functions."""
    return [Path(spec.function.rpartition(":")[0]) for spec in metric_specs if not isinstance(spec, str)]
