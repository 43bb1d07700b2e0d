# SPDX-License-Identifier: BSD-3-Clause
"""The settings of an episode of mode `task`, read from `EpisodeSpec.settings`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from modular_framework_benchmark.episodes.errors import SettingsError
from modular_framework_benchmark.records.episode import EpisodeSpec

DEFAULT_LAUNCH = "modular_framework_api/start_framework.launch"
DEFAULT_TIME_LIMIT_S = 120.0


@dataclass(frozen=True, slots=True)
class PlacedObject:
    """An object and where it is put.

    Attributes:
        name: Its name in the simulation.
        model: Folder in the description package's models, or the absolute path of an .sdf file.
        position: In the world frame [m].
        rpy: Roll, pitch, yaw in the world frame [rad].
    """

    name: str
    model: str
    position: tuple[float, float, float]
    rpy: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class SuccessCriteria:
    """What must hold in the world at the end.

    Attributes:
        object: Name of the object that is to be lifted and held; "": the outcome of the task is enough.
        lifted_m: How much higher it must be than at the start [m].
        hold_s: Simulated time after the end of the task when that is checked [s].
    """

    object: str = ""
    lifted_m: float = 0.1
    hold_s: float = 2.0


@dataclass(frozen=True, slots=True)
class TaskSettings:
    """What an episode of mode `task` runs.

    Attributes:
        package: Package of the launch file; empty for a path.
        launch_file: Name of the launch file, or its path.
        arguments: Launch arguments.
        parameters: ROS parameters by absolute name, set over those of the launch files.
        objects: What is put into the world before the task starts.
        success: What must hold at the end.
        shake_s: Simulated time for which the object is shaken after that [s]; 0: it is not.
        time_limit_s: Longest real time from the start to the end of the task [s].
        record_bag: Whether all topics are recorded to a bag.
        record_video: Whether a video is made.
        warm: Whether the stack may be used again.
    """

    package: str
    launch_file: str
    arguments: Mapping[str, str]
    parameters: Mapping[str, Any]
    objects: tuple[PlacedObject, ...]
    success: SuccessCriteria
    shake_s: float
    time_limit_s: float
    record_bag: bool
    record_video: bool
    warm: bool


def read_settings(spec: EpisodeSpec) -> TaskSettings:
    """Returns the settings of an episode.

    Raises:
        SettingsError: One is missing or wrong.
    """
    settings = spec.settings
    launch = str(settings.get("launch", DEFAULT_LAUNCH))
    package, _, launch_file = ("", "", launch) if launch.startswith("/") else launch.partition("/")
    if not launch_file:
        raise SettingsError(f"setting 'launch' is {settings['launch']!r}; allowed is PACKAGE/FILE.launch; correct it")
    arguments = {name: _text(value) for name, value in dict(settings.get("arguments") or {}).items()}
    if settings.get("task"):
        arguments["task_constructor_script"] = str(settings["task"])
    objects = tuple(_object(entry, number) for number, entry in enumerate(settings.get("objects") or ()))
    record = dict(settings.get("record") or {})
    success = dict(settings.get("success") or {})
    return TaskSettings(
        package=package,
        launch_file=launch_file,
        arguments=arguments,
        parameters=dict(settings.get("parameters") or {}),
        objects=objects,
        success=_success(success, objects),
        shake_s=float(success.get("shake", 0.0)),
        time_limit_s=float(settings.get("time_limit", DEFAULT_TIME_LIMIT_S)),
        record_bag=bool(record.get("bag", False)),
        record_video=bool(record.get("video", False)),
        warm=bool(settings.get("warm", True)),
    )


def _text(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _object(entry: Mapping[str, Any], number: int) -> PlacedObject:
    missing = [key for key in ("model", "x", "y", "z") if key not in entry]
    if missing:
        raise SettingsError(f"setting 'objects', number {number}: {', '.join(missing)} is missing; give it")
    try:
        position = (float(entry["x"]), float(entry["y"]), float(entry["z"]))
        rpy = (float(entry.get("roll", 0.0)), float(entry.get("pitch", 0.0)), float(entry.get("yaw", 0.0)))
    except (TypeError, ValueError) as error:
        raise SettingsError(f"setting 'objects', number {number}: {error}; give numbers [m, rad]") from error
    return PlacedObject(str(entry.get("name") or f"object_{number}"), str(entry["model"]), position, rpy)


def _success(given: Mapping[str, Any], objects: tuple[PlacedObject, ...]) -> SuccessCriteria:
    if not given:
        return SuccessCriteria()
    name = str(given.get("object") or (objects[0].name if objects else ""))
    if not name:
        raise SettingsError(
            "setting 'success' names no object, and there are no objects; add 'object', or leave it out"
        )
    return SuccessCriteria(name, float(given.get("lifted", 0.1)), float(given.get("hold_time", 2.0)))
