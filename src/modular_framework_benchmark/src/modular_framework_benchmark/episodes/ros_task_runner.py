# SPDX-License-Identifier: BSD-3-Clause
"""Runs an episode of mode `task`: the whole stack by its launch file, one task, judged by what became of the world."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import roslaunch.core
import roslaunch.rlutil
import rospkg

from modular_framework_benchmark.episodes.episode_record import EpisodeEnd, make_record
from modular_framework_benchmark.episodes.snapshot import machine_load
from modular_framework_benchmark.episodes.stack import Stack, StackError
from modular_framework_benchmark.episodes.task_settings import SettingsError, TaskSettings, read_settings
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus
from modular_framework_core.launching.launch_arguments import METHOD, argument_values, check_arguments, known_arguments
from modular_framework_core.launching.robot_controllers_spawner import ControllerFileError, read_controller_file

OWN_ARGUMENTS = {"end_with_task": "false", "gui": "false", "rviz": "false"}
"""Launch arguments that every episode sets, where the launch file has them."""
ABORT_TIMEOUT_S = 15.0
"""How long the recorder has to write what it has when an episode is ended [s]."""


class TaskEpisodeRunner:
    """Runs episodes, one after the other."""

    def run(self, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
        """Runs an episode, within its time limit, and leaves no process.

        Args:
            spec: What to run.
            folder: Empty folder for its files.

        Returns:
            What it gave; a launch that dies is an episode with its cause.
        """
        end = EpisodeEnd(spec, folder, time.time(), time.monotonic(), machine_load())
        try:
            settings = read_settings(spec)
            launch = _resolved_launch(settings)
        except (
            ControllerFileError,
            SettingsError,
            roslaunch.core.RLException,
            rospkg.ResourceNotFound,
            OSError,
        ) as error:
            return make_record(end.broken(str(error)))
        stack = Stack(settings.package, settings.launch_file, launch.arguments, self._parameters(settings), folder)
        try:
            end = self._run_on(stack, settings, launch, end)
        finally:
            stop = time.monotonic()
            stack.stop()
        return make_record(end.stopped(time.monotonic() - stop))

    def close(self) -> None:
        """Ends what was kept for further episodes; may be called twice."""

    def _parameters(self, settings: TaskSettings) -> dict[str, Any]:
        return {"/task/wait_for_start": True, **settings.parameters}

    def _run_on(self, stack: Stack, settings: TaskSettings, launch: ResolvedLaunch, end: EpisodeEnd) -> EpisodeEnd:
        request = {
            "folder": str(end.folder),
            "objects": [asdict(placed) for placed in settings.objects],
            "target": settings.success.object,
            "hold_s": settings.success.hold_s,
            "method": launch.has_method,
            "controllers": list(launch.controllers),
            "parameters": {"/seed": end.spec.seed, "/task/record_directory": str(end.folder / "task_records")},
            "begun": end.begun_monotonic,
        }
        left_s = settings.time_limit_s - (time.monotonic() - end.begun_monotonic)
        try:
            answer = stack.ask(request, left_s)
        except StackError as error:
            stack.abort(0.5)
            return end.broken(str(error))
        except TimeoutError:
            answer = stack.abort(ABORT_TIMEOUT_S) or {}
            cause = f"no end within {settings.time_limit_s:g} s; {_doing(stack)}"
            return end.ended(EpisodeStatus.TIMED_OUT, cause, answer)
        if "fault" in answer:
            return end.broken(str(answer["fault"]))
        cause = _failure(settings, answer)
        return end.ended(EpisodeStatus.FAILED if cause else EpisodeStatus.SUCCEEDED, cause, answer)


@dataclass(frozen=True, slots=True)
class ResolvedLaunch:
    """What a launch file and its arguments say of the stack.

    Attributes:
        arguments: All arguments to give.
        has_method: Whether there is a method that generates grasps.
        controllers: Names of the controllers it starts.
    """

    arguments: Mapping[str, str]
    has_method: bool
    controllers: tuple[str, ...]


def _resolved_launch(settings: TaskSettings) -> ResolvedLaunch:
    path = roslaunch.rlutil.resolve_launch_arguments([settings.package, settings.launch_file])[0]
    known = known_arguments(path)
    arguments = {**settings.arguments, **{name: value for name, value in OWN_ARGUMENTS.items() if name in known}}
    given = [f"{name}:={value}" for name, value in arguments.items()]
    check_arguments(path, given)
    values = argument_values(path, given)
    controllers: tuple[str, ...] = ()
    if values.get("robot_package") and values.get("controller_file"):
        folder = Path(rospkg.RosPack().get_path(values["robot_package"])) / "controllers"
        controllers = read_controller_file(folder / values["controller_file"]).controllers
    return ResolvedLaunch(arguments, bool(values.get(METHOD, "")), controllers)


def _failure(settings: TaskSettings, answer: Mapping[str, Any]) -> str:
    """Returns why an episode whose task ended is no success; "" if it is one."""
    if not answer["task_succeeded"]:
        return str(answer["reason"]) or f"the task ended with outcome '{answer['outcome']}'"
    wanted = settings.success
    if not wanted.object:
        return ""
    lifted = answer["lifted_m"]
    if lifted is None:
        return f"there is no object '{wanted.object}' in the world"
    if lifted <= wanted.lifted_m or not answer["held"]:
        return (
            f"the task claims success, but '{wanted.object}' is {lifted:.3f} m higher {wanted.hold_s:g} s later "
            f"(wanted: more than {wanted.lifted_m:g} m) and {'still' if answer['held'] else 'not'} in the gripper"
        )
    return ""


def _doing(stack: Stack) -> str:
    """Returns what the stack said last."""
    lines = [line.strip() for line in stack.log().splitlines() if line.strip()]
    return f"the launch said last: {lines[-1]}" if lines else "the launch said nothing"
