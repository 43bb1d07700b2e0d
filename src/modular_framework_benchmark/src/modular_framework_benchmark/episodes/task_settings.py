# SPDX-License-Identifier: BSD-3-Clause
"""Settings of an episode of mode `task`, from `EpisodeSpec.settings`."""

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
    """An object with its initial pose.

    Attributes:
        name: Name of the object in the simulation.
        model: Folder in the description package's models, or absolute path of an .sdf file.
        position: Position in the world frame [m].
        rpy: Roll, pitch, yaw in the world frame [rad].
    """

    name: str
    model: str
    position: tuple[float, float, float]
    rpy: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class SuccessCriteria:
    """Success criteria for the final state of the world.

    Attributes:
        object: Name of the object to be lifted and held; "" if the outcome of the task suffices.
        lifted_m: Minimum height above the initial height [m].
        hold_s: Simulated time between the end of the task and the check [s].
    """

    object: str = ""
    lifted_m: float = 0.1
    hold_s: float = 2.0


@dataclass(frozen=True, slots=True)
class TaskSettings:
    """Settings of an episode of mode `task`.

    Attributes:
        package: Package of the launch file; empty for a path.
        launch_file: Name or path of the launch file.
        arguments: Launch arguments.
        parameters: ROS parameters that override those of the launch files, keyed by absolute name.
        objects: Objects to spawn before the task starts.
        success: Success criteria.
        shake_s: Simulated duration of the shake after the check [s]; 0 for no shake.
        time_limit_s: Maximum real time from the start to the end of the task [s].
        record_bag: Whether to record all topics to a bag.
        record_video: Whether to render a video.
        warm: Whether the stack may be reused.
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
        SettingsError: A setting is missing or wrong.
    """
    settings = spec.settings
    launch = str(settings.get("launch", DEFAULT_LAUNCH))
    package, _, launch_file = ("", "", launch) if launch.startswith("/") else launch.partition("/")
    if not launch_file:
        raise SettingsError(f"setting 'launch' is {settings['launch']!r}; allowed: PACKAGE/FILE.launch; correct it")
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
        raise SettingsError(f"setting 'objects', number {number}: {', '.join(missing)} is missing; add it")
    try:
        position = (float(entry["x"]), float(entry["y"]), float(entry["z"]))
        rpy = (float(entry.get("roll", 0.0)), float(entry.get("pitch", 0.0)), float(entry.get("yaw", 0.0)))
    except (TypeError, ValueError) as error:
        raise SettingsError(f"setting 'objects', number {number}: {error}; use numbers [m, rad]") from error
    return PlacedObject(str(entry.get("name") or f"object_{number}"), str(entry["model"]), position, rpy)


def _success(given: Mapping[str, Any], objects: tuple[PlacedObject, ...]) -> SuccessCriteria:
    if not given:
        return SuccessCriteria()
    name = str(given.get("object") or (objects[0].name if objects else ""))
    if not name:
        raise SettingsError(
            "setting 'success' names no object, and there are no objects; add 'object', or remove 'success'"
        )
    return SuccessCriteria(name, float(given.get("lifted", 0.1)), float(given.get("hold_time", 2.0)))
