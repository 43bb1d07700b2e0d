# SPDX-License-Identifier: BSD-3-Clause
"""Creates the record of an episode from its end and its files."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from modular_framework_benchmark.episodes.hand_track import hand_link, hand_track
from modular_framework_benchmark.episodes.snapshot import MachineLoad, common_parts
from modular_framework_benchmark.experiments.success_criteria import NO_CRITERIA
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.metrics.failure_classes import failure_class
from modular_framework_benchmark.metrics.measurements import EpisodeMeasurements, JointSamples, ObjectTrack, Shake
from modular_framework_benchmark.metrics.recording_files import (
    EPISODE,
    TASK_RECORDS,
    objects_of,
    read_descriptions,
    read_joints,
    read_recording,
    read_stage,
    read_tracking,
    reports_of,
)
from modular_framework_benchmark.metrics.registry import measure
from modular_framework_benchmark.predicates.predicate import Condition
from modular_framework_benchmark.predicates.progress import Progress, progress_of
from modular_framework_benchmark.predicates.stages import SimulatedStage
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus, Span
from modular_framework_benchmark.records.episode_settings import EpisodeSettings, from_json
from modular_framework_benchmark.records.results import COLD_START, FAILURE_CLASS
from modular_framework_benchmark.records.used_software import UsedSoftware
from modular_framework_benchmark.results.json_records import record_to_json
from modular_framework_core.files.atomic_files import write_atomically

EPISODE_PARTS = (("start", "up"), ("begin", "ready"), ("task", "task"), ("check", "checked"), ("record", "recorded"))
"""Parts of an episode in their order, with the moment that ends each."""
SNAPSHOT_KEYS = ("shake_fault", "video_fault", "recording_fault", "world_digest")


@dataclass(frozen=True, slots=True)
class EpisodeEnd:
    """End of an episode.

    Attributes:
        spec: Specification of the episode.
        folder: Folder of the episode's files.
        begun: Start time [s since 1970].
        begun_monotonic: Start time by the machine's monotonic clock [s].
        load: Load of the machine at the start.
        status: Final status.
        cause: Cause of a failure.
        answer: Answer of the recorder.
        stop_s: Duration of the shutdown of the stack [s].
        target: Name of the object in the success criteria; "" for none.
        is_cold: Whether the episode is the first of its stack.
    """

    spec: EpisodeSpec
    folder: Path
    begun: float
    begun_monotonic: float
    load: MachineLoad
    status: EpisodeStatus = EpisodeStatus.BROKEN
    cause: str = ""
    answer: Mapping[str, Any] = field(default_factory=dict)
    stop_s: float = 0.0
    target: str = ""
    is_cold: bool = False

    def broken(self, cause: str) -> EpisodeEnd:
        """Returns the end of an episode that could not run."""
        return replace(self, status=EpisodeStatus.BROKEN, cause=cause)

    def with_status(self, status: EpisodeStatus, cause: str, answer: Mapping[str, Any]) -> EpisodeEnd:
        """Returns the end of an episode that ran.

        Args:
            status: Final status.
            cause: Cause of a failure.
            answer: Answer of the recorder.
        """
        return replace(self, status=status, cause=cause, answer=answer)


def make_record(end: EpisodeEnd) -> EpisodeRecord:
    """Returns the record of an episode whose processes have all ended."""
    wall_s = time.monotonic() - end.begun_monotonic
    software = from_json(UsedSoftware, end.answer.get("ran", {}))
    if software.invalid_cause:
        end = end.with_status(EpisodeStatus.INVALID, software.invalid_cause, end.answer)
    recording = read_recording(end.folder)
    states = _state_spans(end)
    answer = end.answer
    joints = read_joints(end.folder)
    stage = read_stage(end.folder, end.answer)
    end = _with_known_names(end, stage)
    progress = _progress(end, stage)
    measurements = EpisodeMeasurements(
        settings=end.spec.settings,
        status=end.status,
        outcome=str(answer.get("outcome", "")),
        cause=end.cause,
        states=states,
        task_started_s=float(answer.get("task_started_s", 0.0)),
        task_s=answer.get("task_s"),
        task_wall_s=answer.get("task_wall_s"),
        generation_s=answer.get("generation_s"),
        method_processor_s=answer.get("method_processor_s"),
        reports=reports_of(recording),
        joints=joints,
        hand=_read_hand_track(end.folder, joints) if answer.get("held") else None,
        tracking=read_tracking(end.folder),
        objects=objects_of(recording),
        target=end.target,
        held=bool(answer.get("held", False)),
        shake=Shake(**answer["shake"]) if answer.get("shake") else None,
        world=stage.world if stage is not None else None,
        progress=progress,
        folder=end.folder,
    )
    measured = measure(end.spec.settings.metrics, measurements)
    failure = failure_class(measurements, bool(answer.get("task_succeeded")), _success_conditions(end.spec.settings))
    invalid = end.status is EpisodeStatus.INVALID
    spans = (*_part_spans(end, wall_s), *states, *_component_spans(end, recording), *_milestone_spans(progress))
    return EpisodeRecord(
        spec=end.spec,
        status=end.status,
        outcome=measurements.outcome,
        cause=end.cause,
        begun=end.begun,
        wall_s=wall_s,
        simulated_s=answer.get("simulated_s"),
        metrics={name: None if invalid else value for name, value in measured.values.items()},
        spans=tuple(sorted(spans, key=lambda span: span.started_s)),
        snapshot=_snapshot(end, measured.faults)
        | software.as_json()
        | ({FAILURE_CLASS: failure.value} if failure is not None else {}),
        folder=str(end.folder),
    )


def write_episode(folder: Path, record: EpisodeRecord) -> None:
    """Writes the record of an episode beside its files; prints a failure, which must not lose the episode."""
    try:
        write_atomically(folder / EPISODE, record_to_json(record))
    except OSError as error:
        print(f"{folder / EPISODE} is not written: {error}", file=sys.stderr, flush=True)


def _with_known_names(end: EpisodeEnd, stage: SimulatedStage | None) -> EpisodeEnd:
    """Returns the end of an episode; invalid if a predicate names a model or joint that never existed in the world."""
    settings = end.spec.settings
    is_measured = end.status not in (EpisodeStatus.BROKEN, EpisodeStatus.INVALID)
    if not is_measured or stage is None or not isinstance(settings, TaskSettings):
        return end
    judged = settings.success.predicate(end.target).conditions if settings.success != NO_CRITERIA else ()
    conditions = (*judged, *(each for milestone in settings.progress for each in milestone.predicate.conditions))
    text = stage.unknown_name_text(conditions)
    cause = f"success and progress cannot be judged: {text}"
    return end.with_status(EpisodeStatus.INVALID, cause, end.answer) if text else end


def _progress(end: EpisodeEnd, stage: SimulatedStage | None) -> Progress | None:
    """Returns the progress of a measured episode with milestones; None for other episodes."""
    settings = end.spec.settings
    if end.status in (EpisodeStatus.BROKEN, EpisodeStatus.INVALID) or stage is None:
        return None
    if not isinstance(settings, TaskSettings) or not settings.progress:
        return None
    return progress_of(settings.progress, stage)


def _success_conditions(settings: EpisodeSettings) -> tuple[Condition, ...]:
    """Returns the conditions of the success criteria of a task; empty in other modes."""
    required = settings.success.required if isinstance(settings, TaskSettings) else None
    return required.conditions if required is not None else ()


def _milestone_spans(progress: Progress | None) -> list[Span]:
    """Returns a span per milestone, from the start of the task to the moment at which the milestone was reached."""
    if progress is None:
        return []
    times_s = [*progress.times_s, *[None] * (len(progress.milestones) - len(progress.times_s))]
    return [
        Span(
            "milestone",
            milestone.name,
            progress.started_s,
            time_s,
            failed=time_s is None,
            reason="missed first" if milestone.name == progress.first_missed else "",
        )
        for milestone, time_s in zip(progress.milestones, times_s, strict=True)
    ]


def _read_hand_track(folder: Path, joints: JointSamples | None) -> ObjectTrack | None:
    urdf, srdf = read_descriptions(folder)
    link = hand_link(srdf) if srdf else ""
    return hand_track(urdf, link, joints) if urdf and link and joints is not None else None


def _snapshot(end: EpisodeEnd, faults: Mapping[str, str]) -> dict[str, Any]:
    return {
        **common_parts(end.spec, end.load),
        "parameters": end.answer.get("parameters_digest", ""),
        "final_objects": end.answer.get("final", {}),
        **{key: end.answer[key] for key in SNAPSHOT_KEYS if end.answer.get(key)},
        **({COLD_START: True} if end.is_cold else {}),
        **({"metric_faults": dict(faults)} if faults else {}),
    }


def _part_spans(end: EpisodeEnd, wall_s: float) -> list[Span]:
    """Returns the spans of the episode's parts: start of the stack, task, check and recording, stop."""
    moments, spans, start_s = end.answer.get("parts", {}), [], 0.0
    for name, moment in EPISODE_PARTS:
        if moment in moments:
            spans.append(Span("episode", name, start_s, float(moments[moment])))
            start_s = float(moments[moment])
    if end.stop_s:
        spans.append(Span("episode", "stop", max(wall_s - end.stop_s, 0.0), wall_s))
    return spans


def _state_spans(end: EpisodeEnd) -> tuple[Span, ...]:
    """Returns the spans of the task's states from the record of the task's node."""
    files = sorted((end.folder / TASK_RECORDS).glob("*.json"))
    if not files:
        return ()
    record = json.loads(files[-1].read_text())
    zero = float(record["begun"]) - end.begun
    return tuple(
        Span(
            "state",
            state["path"],
            zero + state["started_s"],
            None if state["ended_s"] is None else zero + state["ended_s"],
            state["outcome"] or "",
            failed=state["failed"],
            reason=state["reason"],
        )
        for state in record["states"]
    )


def _component_spans(end: EpisodeEnd, recording: Mapping[str, Any]) -> list[Span]:
    """Returns the spans of the components; the measured time replaces the reported time of the first generation."""
    begun, answer, spans = end.begun_monotonic, end.answer, []
    generation_end_s = answer.get("requested_wall", 0.0) + answer.get("generation_s", 0.0)
    for entry in recording.get("reports", ()):
        begin, wall_s = entry["wall_begin"], entry["wall_s"]
        if entry["component"] == "generation" and begin < generation_end_s:
            begin, wall_s = answer["requested_wall"], answer.get("generation_s", wall_s)
            generation_end_s = 0.0  # only one generation precedes the task
        ended_s = begin - begun + wall_s
        spans.append(
            Span(
                "component",
                entry["component"],
                begin - begun,
                ended_s,
                "",
                failed=not entry["succeeded"],
                reason=entry["reason"],
            )
        )
    return spans
