# SPDX-License-Identifier: BSD-3-Clause
"""The record of an episode that is the work of one component alone."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

from modular_framework_benchmark.episodes.snapshot import MachineLoad, machine, reference_s, versions
from modular_framework_benchmark.metrics.measurements import ComponentReport, EpisodeMeasurements
from modular_framework_benchmark.metrics.registry import MetricError, measure
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus, Span


@dataclass(frozen=True, slots=True)
class Stopwatch:
    """When an episode began.

    Attributes:
        begun: [s since 1970].
        start: By the monotonic clock [s].
        load: Load of the machine.
    """

    begun: float = field(default_factory=time.time)
    start: float = field(default_factory=time.monotonic)
    load: MachineLoad = field(default_factory=MachineLoad.now)

    def elapsed_s(self) -> float:
        """Returns the time since then [s]."""
        return time.monotonic() - self.start


def broken_record(spec: EpisodeSpec, cause: str, watch: Stopwatch) -> EpisodeRecord:
    """Returns the record of an episode that could not be run, which says nothing of the method."""
    return EpisodeRecord(spec, EpisodeStatus.BROKEN, "", cause, watch.begun, watch.elapsed_s(), None, {})


def measured_record(
    spec: EpisodeSpec, status: EpisodeStatus, outcome: str, report: ComponentReport, folder: Path, watch: Stopwatch
) -> EpisodeRecord:
    """Measures what a component did.

    Args:
        spec: What was run.
        status: How it ended.
        outcome: In the component's words.
        report: What it did; its times count from the start of the episode [s].
        folder: Folder of the episode.
        watch: Started with the episode.
    """
    generation_s = report.wall_s if report.component == "generation" else None
    measurements = EpisodeMeasurements(
        spec.settings, status, outcome, report.reason, generation_s=generation_s, reports=(report,), folder=folder
    )
    try:
        measured = measure(spec.settings.get("metrics", ()), measurements)
    except MetricError as error:
        return broken_record(spec, str(error), watch)
    span = Span(
        "component", report.component, report.started_s, report.ended_s, outcome, not report.succeeded, report.reason
    )
    return EpisodeRecord(
        spec=spec,
        status=status,
        outcome=outcome,
        cause=report.reason,
        begun=watch.begun,
        wall_s=watch.elapsed_s(),
        simulated_s=None,
        metrics=measured.values,
        spans=(span,),
        snapshot={
            **versions(),
            "machine": machine(),
            "reference_s": reference_s(),
            **MachineLoad.now().since(watch.load),
            **report.ran.as_json(),
            **({"metric_faults": dict(measured.faults)} if measured.faults else {}),
        },
        folder=str(folder),
    )
