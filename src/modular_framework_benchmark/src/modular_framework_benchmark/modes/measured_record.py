# SPDX-License-Identifier: BSD-3-Clause
"""Creates the record of an episode that runs a single component."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

from modular_framework_benchmark.episodes.snapshot import MachineLoad, common_parts
from modular_framework_benchmark.metrics.failure_classes import failure_class
from modular_framework_benchmark.metrics.measurements import ComponentReport, EpisodeMeasurements
from modular_framework_benchmark.metrics.registry import MetricError, measure
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus, Span
from modular_framework_benchmark.records.results import FAILURE_CLASS

CLASSIFIED_COMPONENTS = ("generation", "planning")
"""Components whose failures have a class."""


@dataclass(frozen=True, slots=True)
class Stopwatch:
    """Start of an episode.

    Attributes:
        begun: Start time [s since 1970].
        start: Start time by the monotonic clock [s].
        load: Load of the machine at the start.
    """

    begun: float = field(default_factory=time.time)
    start: float = field(default_factory=time.monotonic)
    load: MachineLoad = field(default_factory=MachineLoad.now)

    def elapsed_s(self) -> float:
        """Returns the time since the start [s]."""
        return time.monotonic() - self.start


def broken_record(spec: EpisodeSpec, cause: str, watch: Stopwatch) -> EpisodeRecord:
    """Returns the record of an episode that could not run; it does not count against the method.

    Args:
        spec: Specification of the episode.
        cause: Reason for the failure.
        watch: Stopwatch of the episode.
    """
    return EpisodeRecord(
        spec,
        EpisodeStatus.BROKEN,
        outcome="",
        cause=cause,
        begun=watch.begun,
        wall_s=watch.elapsed_s(),
        simulated_s=None,
        metrics={},
    )


def measured_record(
    spec: EpisodeSpec, status: EpisodeStatus, outcome: str, *, report: ComponentReport, folder: Path, watch: Stopwatch
) -> EpisodeRecord:
    """Returns the record of an episode with its measured metrics.

    Args:
        spec: Specification of the episode.
        status: Final status.
        outcome: Outcome as named by the component.
        report: Report of the component, with times since the start of the episode [s].
        folder: Folder of the episode.
        watch: Stopwatch of the episode.
    """
    generation_s = report.wall_s if report.component == "generation" else None
    invalid_cause = report.ran.invalid_cause
    status, cause = (EpisodeStatus.INVALID, invalid_cause) if invalid_cause else (status, report.reason)
    measurements = EpisodeMeasurements(
        spec.settings,
        status,
        outcome,
        cause,
        generation_s=generation_s,
        method_processor_s=report.processor_s,
        reports=(report,),
        folder=folder,
    )
    try:
        measured = measure(spec.settings.metrics, measurements)
    except MetricError as error:
        return broken_record(spec, str(error), watch)
    failure = None
    if report.component in CLASSIFIED_COMPONENTS:
        failure = failure_class(measurements, task_succeeded=False)
    span = Span(
        "component",
        report.component,
        report.started_s,
        report.ended_s,
        outcome,
        failed=not report.succeeded,
        reason=report.reason,
    )
    return EpisodeRecord(
        spec=spec,
        status=status,
        outcome=outcome,
        cause=cause,
        begun=watch.begun,
        wall_s=watch.elapsed_s(),
        simulated_s=None,
        metrics={name: None if invalid_cause else value for name, value in measured.values.items()},
        spans=(span,),
        snapshot={
            **common_parts(spec, watch.load),
            **report.ran.as_json(),
            **({"metric_faults": dict(measured.faults)} if measured.faults else {}),
            **({FAILURE_CLASS: failure.value} if failure is not None else {}),
        },
        folder=str(folder),
    )
