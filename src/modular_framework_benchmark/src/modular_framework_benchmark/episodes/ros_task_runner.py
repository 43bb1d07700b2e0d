# SPDX-License-Identifier: BSD-3-Clause
"""Runs an episode of mode `task`: the complete stack, one task, and a judgement of the world's final state."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from modular_framework_benchmark.episodes.episode_record import EpisodeEnd, make_record, write_episode
from modular_framework_benchmark.episodes.episode_video import make_video_apart
from modular_framework_benchmark.episodes.ros_stack_launch import resolve_launch
from modular_framework_benchmark.episodes.snapshot import MachineLoad
from modular_framework_benchmark.episodes.stack import Stack, StackError, StackLaunch
from modular_framework_benchmark.experiments.success_criteria import NO_CRITERIA
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.metrics.recording_files import TASK_RECORDS, read_stage
from modular_framework_benchmark.predicates.conditions import REGIONS
from modular_framework_benchmark.predicates.predicate import Stage
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.records.episode_settings import SettingsError

ABORT_TIMEOUT_S = 20.0
"""Time for the recorder to write its data when an episode is aborted [s]."""


class TaskEpisodeRunner:
    """Runs episodes one after another.

    A stack whose world can be reset is reused by the next episode. An episode starts a new stack if it has a different
    launch, or if the previous episode did not end normally. The first episode of a stack runs twice, and its second
    run is recorded: the first run loads what every node loads on first use. The first run is recorded instead if a
    second run of its duration would exceed the time limit, or if the first run did not end normally.
    """

    def __init__(self) -> None:
        """Initialises without starting a stack."""
        self._stack: Stack | None = None
        self._launched: StackLaunch | None = None
        self._resolved: dict[str, StackLaunch] = {}

    def run(self, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
        """Runs an episode within its time limit.

        Args:
            spec: Specification of the episode.
            folder: Empty folder for the episode's files.

        Returns:
            Record of the episode; a launch that dies gives a record with the cause.
        """
        end = EpisodeEnd(spec, folder, time.time(), time.monotonic(), MachineLoad.now())
        try:
            settings = spec.settings_of(TaskSettings)
            launch, target = self._launch_of(settings), settings.judged_object
        except SettingsError as error:
            self.close()
            return make_record(end.broken(str(error)))
        stack, is_cold = self._stack_for(launch)
        end = replace(end, is_cold=is_cold, target=target)
        try:
            end = self._run_on(stack, settings, launch, end)
            if is_cold and _can_run_again(stack, settings, launch, end):
                _empty(folder)
                end = self._run_on(stack, settings, launch, end)
        finally:
            stop = time.monotonic()
            stack.write_log(folder / "log.txt")
            if not (settings.warm and _can_restart(stack, launch, end)):
                self.close()
        end = replace(end, stop_s=time.monotonic() - stop)
        if settings.record.video and "zero" in end.answer:
            end = replace(end, answer={**end.answer, "video_fault": make_video_apart(folder)})
        record = make_record(end)
        write_episode(folder, record)
        return record

    def close(self) -> None:
        """Stops the reusable stack and all its processes; repeated calls are allowed."""
        if self._stack is not None:
            self._stack.stop()
        self._stack = self._launched = None

    def _launch_of(self, settings: TaskSettings) -> StackLaunch:
        """Returns the launch of an episode; cached, because resolving it takes as long as a warm start."""
        key = json.dumps([settings.launch, settings.arguments, settings.task, settings.parameters], sort_keys=True)
        if key not in self._resolved:
            self._resolved[key] = resolve_launch(settings)
        return self._resolved[key]

    def _stack_for(self, launch: StackLaunch) -> tuple[Stack, bool]:
        """Returns the stack of a launch, and whether the stack is new."""
        if self._stack is not None and self._launched == launch and self._stack.alive():
            return self._stack, False
        self.close()
        self._stack, self._launched = Stack(launch), launch
        return self._stack, True

    def _run_on(self, stack: Stack, settings: TaskSettings, launch: StackLaunch, end: EpisodeEnd) -> EpisodeEnd:
        request = {
            "folder": str(end.folder),
            "objects": [asdict(placed) for placed in settings.objects],
            "target": end.target,
            "hold_s": settings.success.hold_s,
            "shake_s": settings.success.shake or 0.0,
            "bag": settings.record.bag,
            "method_nodes": list(launch.method_nodes),
            "controllers": list(launch.controllers),
            "parameters": {
                "/seed": end.spec.seed,
                "/task/record_directory": str(end.folder / TASK_RECORDS),
                REGIONS: {**launch.regions, **{region.name: region.as_parameter for region in settings.regions}},
            },
            "begun": end.begun_monotonic,
        }
        remaining_s = settings.time_limit - (time.monotonic() - end.begun_monotonic)
        try:
            answer = stack.request(request, remaining_s)
        except StackError as error:
            return end.broken(str(error))
        except TimeoutError:
            answer = stack.abort(ABORT_TIMEOUT_S) or {}
            if not answer.get("foul"):
                cause = f"no end within {settings.time_limit:g} s; {stack.last_output()}"
                # Without a request, the world was not ready and the method was not called.
                status = EpisodeStatus.TIMED_OUT if "requested_s" in answer else EpisodeStatus.BROKEN
                return end.with_status(status, cause, answer)
        if "fault" in answer:
            return end.broken(stack.root_cause(str(answer["fault"])))
        if answer.get("foul"):
            return end.with_status(EpisodeStatus.INVALID, str(answer["foul"]), answer)
        cause = _failure(settings, end.target, answer, read_stage(end.folder, answer))
        return end.with_status(EpisodeStatus.FAILED if cause else EpisodeStatus.SUCCEEDED, cause, answer)


def _can_restart(stack: Stack, launch: StackLaunch, end: EpisodeEnd) -> bool:
    """Returns whether another episode can run on a stack after an episode."""
    ended = end.status in (EpisodeStatus.SUCCEEDED, EpisodeStatus.FAILED)
    return launch.can_restart and ended and stack.alive()


def _can_run_again(stack: Stack, settings: TaskSettings, launch: StackLaunch, end: EpisodeEnd) -> bool:
    """Returns whether an episode can run a second time within its time limit."""
    if not _can_restart(stack, launch, end):
        return False
    spent_s = time.monotonic() - end.begun_monotonic
    run_s = spent_s - float(end.answer["parts"]["up"])
    return spent_s + run_s < settings.time_limit


def _empty(folder: Path) -> None:
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def _failure(settings: TaskSettings, target: str, answer: Mapping[str, Any], stage: Stage | None) -> str:
    """Returns why an episode whose task ended did not succeed; "" after a success.

    Args:
        settings: Settings of the episode.
        target: Name of the object to be lifted and held in the short form of the success criteria.
        answer: Answer of the recorder.
        stage: True states of the world from the start of the task to the check; None without a record.
    """
    if not answer["task_succeeded"]:
        return str(answer["reason"]) or f"the task ended with outcome '{answer['outcome']}'"
    if settings.success == NO_CRITERIA:
        return ""
    if stage is None:
        return "the simulation recorded no states of the world, so that success cannot be judged"
    unmet = settings.success.predicate(target).unmet_reasons(stage)
    return f"the task claims success, but {settings.success.hold_s:g} s later {' and '.join(unmet)}" if unmet else ""
