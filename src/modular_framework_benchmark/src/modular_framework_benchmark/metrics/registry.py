# SPDX-License-Identifier: BSD-3-Clause
"""Registry of the framework's metrics, and loader of the user's metrics."""

from __future__ import annotations

import importlib.util
import inspect
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

from modular_framework_benchmark.metrics import execution, generation, grasp, kinematics, planning, policy, task
from modular_framework_benchmark.metrics.measurements import EpisodeMeasurements
from modular_framework_benchmark.records.episode_settings import MetricSpec, OwnMetric
from modular_framework_benchmark.records.experiment import Direction, Metric, MetricKind
from modular_framework_ros.allowed_names import listing, nearest
from modular_framework_ros.reported_figures import Clock, Source

ROUNDING = 1e-9
"""Relative and absolute tolerance for rounding errors at a bound."""

MetricFunction = Callable[[EpisodeMeasurements], float | None]
"""Function that returns the value of a metric for an episode, or None without a value."""


class MetricError(ValueError):
    """A metric is unknown, or a user's metric cannot be loaded; the message gives the reason and the remedy."""


@dataclass(frozen=True, slots=True)
class RegisteredMetric:
    """A metric with the function that measures it."""

    metric: Metric
    measure: MetricFunction


_RATE, _VALUE, _COUNT = MetricKind.RATE, MetricKind.VALUE, MetricKind.COUNT
_HIGHER, _LOWER = Direction.HIGHER, Direction.LOWER
_SIMULATED, _WALL = Clock.SIMULATED, Clock.WALL
_REPORTED = Source.SAID
_FRACTION = (0.0, 1.0)
_NONNEGATIVE = (0.0, None)
_Bounds = tuple[float | None, float | None]


def _make_metric(
    measure: MetricFunction,
    kind: MetricKind,
    better: Direction,
    *,
    unit: str = "",
    bounds: _Bounds = (None, None),
    source: Source = Source.MEASURED,
) -> RegisteredMetric:
    """Registers a function; the metric gets its name, its module as component, and its first docstring line.

    Args:
        measure: Function of the metric.
        kind: Kind of the metric.
        better: Direction of better values.
        unit: Unit of the metric.
        bounds: Smallest and largest possible value, or None.
        source: Origin of the values.
    """
    description = (inspect.getdoc(measure) or "").splitlines()[0]
    name, component = getattr(measure, "__name__", ""), measure.__module__.rpartition(".")[2]
    lowest, highest = bounds
    metric = Metric(
        name, component, kind, better, unit, description=description, lowest=lowest, highest=highest, source=source
    )
    return RegisteredMetric(metric, measure)


def _make_time_metric(
    measure: MetricFunction, better: Direction, clock: Clock, source: Source = Source.MEASURED
) -> RegisteredMetric:
    """Registers a function as the metric of a duration.

    Args:
        measure: Function of the metric.
        better: Direction of better values.
        clock: Clock of the duration.
        source: Origin of the values.
    """
    registered = _make_metric(measure, MetricKind.TIME, better, unit="s", source=source)
    return replace(registered, metric=replace(registered.metric, clock=clock))


_REGISTERED_METRICS = (
    _make_metric(task.success, _RATE, _HIGHER),
    _make_time_metric(task.task_time, _LOWER, _SIMULATED),
    _make_time_metric(task.task_wall_time, _LOWER, _WALL),
    _make_metric(task.failed_states, _COUNT, _LOWER),
    _make_metric(task.progress, MetricKind.PARTIAL_CREDIT, _HIGHER, bounds=_FRACTION),
    _make_time_metric(generation.generation_time, _LOWER, _WALL),
    _make_time_metric(generation.method_processor_time, _LOWER, Clock.PROCESSOR),
    _make_metric(generation.generation_success, _RATE, _HIGHER, source=_REPORTED),
    _make_metric(generation.candidates, _COUNT, _HIGHER, source=_REPORTED),
    _make_metric(generation.reachable_share, _VALUE, _HIGHER, bounds=_FRACTION, source=_REPORTED),
    _make_metric(generation.best_rank, _VALUE, _LOWER, bounds=(1.0, None), source=_REPORTED),
    _make_time_metric(planning.planning_time, _LOWER, _WALL),
    _make_time_metric(planning.planning_processor_time, _LOWER, Clock.PROCESSOR),
    _make_metric(planning.concurrent_plans, _COUNT, _LOWER),
    _make_time_metric(planning.search_time, _LOWER, _WALL),
    _make_time_metric(planning.planner_method_time, _LOWER, _WALL, source=_REPORTED),
    _make_time_metric(planning.planner_queue_time, _LOWER, _WALL, source=_REPORTED),
    _make_time_metric(planning.planner_transport_time, _LOWER, _WALL),
    _make_metric(planning.planning_success, _VALUE, _HIGHER, bounds=_FRACTION),
    _make_metric(planning.path_length, _VALUE, _LOWER, unit="rad", bounds=_NONNEGATIVE),
    _make_time_metric(planning.motion_duration, _LOWER, _SIMULATED),
    _make_metric(planning.smoothness, _VALUE, _HIGHER),
    _make_metric(planning.clearance, _VALUE, _HIGHER, unit="m"),
    _make_metric(planning.attempts, _COUNT, _LOWER),
    _make_metric(kinematics.solved_share, _VALUE, _HIGHER, bounds=_FRACTION),
    _make_time_metric(kinematics.solving_time, _LOWER, _WALL),
    _make_metric(kinematics.solutions, _COUNT, _HIGHER),
    _make_metric(kinematics.position_error, _VALUE, _LOWER, unit="m", bounds=_NONNEGATIVE),
    _make_metric(kinematics.rotation_error, _VALUE, _LOWER, unit="rad", bounds=_NONNEGATIVE),
    _make_time_metric(execution.execution_time, _LOWER, _SIMULATED),
    _make_metric(execution.execution_success, _VALUE, _HIGHER, bounds=_FRACTION),
    _make_metric(execution.tracking_error, _VALUE, _LOWER, unit="rad", bounds=_NONNEGATIVE),
    _make_metric(execution.greatest_tracking_error, _VALUE, _LOWER, unit="rad", bounds=_NONNEGATIVE),
    _make_metric(execution.executed_length, _VALUE, _LOWER, unit="rad", bounds=_NONNEGATIVE),
    _make_metric(execution.executed_smoothness, _VALUE, _HIGHER),
    _make_metric(execution.greatest_effort, _VALUE, _LOWER, unit="Nm", bounds=_NONNEGATIVE),
    _make_metric(grasp.lift, _VALUE, _HIGHER, unit="m"),
    _make_metric(grasp.slip, _VALUE, _LOWER, unit="m", bounds=_NONNEGATIVE),
    _make_time_metric(grasp.grasp_time, _LOWER, _SIMULATED),
    _make_time_metric(grasp.hold_time, _HIGHER, _SIMULATED),
    _make_time_metric(policy.policy_method_time, _LOWER, _WALL, source=_REPORTED),
    _make_time_metric(policy.policy_queue_time, _LOWER, _WALL, source=_REPORTED),
    _make_time_metric(policy.policy_transport_time, _LOWER, _WALL),
    _make_metric(policy.policy_late_answers, _COUNT, _LOWER),
    _make_metric(policy.policy_chunks, _COUNT, _LOWER),
    _make_metric(policy.policy_actions, _COUNT, _LOWER),
    _make_metric(policy.policy_clipped_actions, _COUNT, _LOWER),
)

METRICS: Mapping[str, RegisteredMetric] = {entry.metric.name: entry for entry in _REGISTERED_METRICS}
"""Metrics of the framework, keyed by name."""


def find_metric(name: str) -> RegisteredMetric:
    """Returns a metric of the framework.

    Raises:
        MetricError: The metric does not exist; the message suggests similar names.
    """
    if name in METRICS:
        return METRICS[name]
    raise MetricError(
        f"there is no metric '{name}'; {listing(METRICS)}, or FILE.py:FUNCTION for a user's function"
        f"{nearest(name, METRICS)}"
    )


def load_metric(reference: str) -> MetricFunction:
    """Returns a user's function.

    Args:
        reference: `FILE.py:FUNCTION`, a file and the name of a function that takes `EpisodeMeasurements` and returns a
            number or None.

    Raises:
        MetricError: The file or function does not exist, or the file cannot be imported.
    """
    file, _, name = reference.rpartition(":")
    path = Path(file)
    if not file.endswith(".py") or not name.isidentifier():
        raise MetricError(f"metric '{reference}' does not have the form FILE.py:FUNCTION; correct it")
    if not path.is_file():
        raise MetricError(f"metric '{reference}': there is no file {path.resolve()}; correct the path")
    function = getattr(_module(path), name, None)
    if not callable(function):
        defined = [key for key, value in vars(_module(path)).items() if inspect.isfunction(value)]
        raise MetricError(
            f"metric '{reference}': {path} has no function '{name}'; it has {', '.join(defined) or 'none'}"
        )
    return function  # type: ignore[no-any-return]  # the result is checked when the metric is measured


def _module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"metrics_of_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise MetricError(f"{path} cannot be imported as a Python module")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # user code may raise anything
        raise MetricError(f"{path} cannot be imported: {type(error).__name__}: {error}") from error
    return module


@dataclass(frozen=True, slots=True)
class MeasuredMetrics:
    """Values of metrics, and the errors of metrics that raised.

    Attributes:
        values: Value of each metric, keyed by name; None without a value or after an error.
        faults: Text of the exception, keyed by metric name.
    """

    values: Mapping[str, float | None]
    faults: Mapping[str, str]


def _allowed_value(value: float, metric: OwnMetric) -> float:
    """Returns a value of a user's metric, corrected for rounding at a bound.

    Raises:
        ValueError: The value is not an allowed value of the metric.
    """
    if metric.is_rate and value in (0.0, 1.0) or math.isnan(value):
        return value
    if metric.is_rate:
        raise ValueError(
            f"the value of the rate is {value:g}; allowed: 0 or 1; correct the function, or use kind: value"
        )
    low = -math.inf if metric.lowest is None else metric.lowest
    high = math.inf if metric.highest is None else metric.highest
    allowed = min(max(value, low), high)
    if not math.isclose(value, allowed, rel_tol=ROUNDING, abs_tol=ROUNDING):
        raise ValueError(f"the value is {value:g}; allowed: {low:g} to {high:g}; correct the function or the bounds")
    return allowed


def measure(specs: Iterable[MetricSpec], episode: EpisodeMeasurements) -> MeasuredMetrics:
    """Returns the metrics of an episode.

    Args:
        specs: Metrics to measure.
        episode: Measurements of the episode.

    Raises:
        MetricError: A metric is unknown or cannot be loaded.
    """
    values: dict[str, float | None] = {}
    faults: dict[str, str] = {}
    for entry in specs:
        if isinstance(entry, str):
            name, function = entry, find_metric(entry).measure
        else:
            name, function = entry.name, load_metric(entry.function)
        try:
            value = function(episode)
            number = None if value is None else float(value)
            values[name] = number if number is None or isinstance(entry, str) else _allowed_value(number, entry)
        except Exception as error:  # user code may raise anything, which must not break the episode
            values[name], faults[name] = None, f"{type(error).__name__}: {error}"
    return MeasuredMetrics(values, faults)
