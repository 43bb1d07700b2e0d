# SPDX-License-Identifier: BSD-3-Clause
"""Estimates the disk space for the records of an experiment before it runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from modular_framework_benchmark.episodes.ros_stack_launch import preview_stack
from modular_framework_benchmark.experiments.planning_mode import PlanningSettings
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.episode_settings import EpisodeSettings
from modular_framework_simulation.sensors.camera_config import read_cameras
from modular_framework_simulation.sensors.cameras import POINT, Camera

SIMULATED_S = 10.0
"""Length of the shipped pick [s of simulated time], on which the following sizes were measured."""
TEXT_BYTES, MOTION_BYTES_PER_S = 230e3, 47e3
"""Log, parameters and reports of an episode [B]; samples of 10 joints and the record of the world [B/s]. Both grow with
the robot."""
BAG_BYTES_PER_S, VIDEO_BYTES_PER_S = 0.4e6, 6e3
DATABASE_BYTES, PLAN_BYTES = 10e3, 20e3
"""An episode in the database; the motion of a plan in the mode `planning` [B]."""
SENSORS_PARAMETER = "/gazebo/sensors"
SIZE_UNITS = ("B", "kB", "MB", "GB", "TB")


def disk_text(episodes: Sequence[EpisodeSpec]) -> str:
    """Returns a line with the estimated disk space of an experiment, itemised.

    Args:
        episodes: Episodes of the experiment.

    Raises:
        SettingsError: A launch file is invalid.
    """
    parts: dict[str, float] = {}
    for spec in episodes:
        for name, size in _sizes(spec.settings):
            parts[name] = parts.get(name, 0.0) + size
    items = ", ".join(f"{name} {size_text(size)}" for name, size in parts.items())
    simulated = any(isinstance(spec.settings, TaskSettings) for spec in episodes)
    assumption = f", each {SIMULATED_S:g} s of simulated time, as long as the shipped pick" if simulated else ""
    return f"  disk: about {size_text(sum(parts.values()))} for {len(episodes)} episodes{assumption}: {items}"


def size_text(size: float) -> str:
    """Returns a size [B] as text with two digits and a unit."""
    power = min(int(math.log10(max(size, 1.0)) // 3), 4)
    value = size / 1000**power
    return f"{value:.0f} {SIZE_UNITS[power]}" if value >= 10.0 else f"{value:.2g} {SIZE_UNITS[power]}"


def _sizes(settings: EpisodeSettings) -> Iterator[tuple[str, float]]:
    yield "database", DATABASE_BYTES
    if isinstance(settings, TaskSettings):
        yield from _task_sizes(settings)
    elif isinstance(settings, PlanningSettings) and settings.record.trajectories:
        yield "trajectories", PLAN_BYTES


def _task_sizes(settings: TaskSettings) -> Iterator[tuple[str, float]]:
    yield "logs and recordings", TEXT_BYTES + MOTION_BYTES_PER_S * SIMULATED_S
    if settings.record.video:
        yield "videos", VIDEO_BYTES_PER_S * SIMULATED_S
    if settings.record.bag:
        yield "bags without cameras", BAG_BYTES_PER_S * SIMULATED_S
        for camera in _cameras(settings):
            pinhole = camera.pinhole
            name = (
                f"camera '{camera.name}' in bags at most ({pinhole.width} x {pinhole.height} at {camera.rate_hz:g} Hz)"
            )
            yield name, _image_bytes(camera) * camera.rate_hz * SIMULATED_S


def _cameras(settings: TaskSettings) -> list[Camera]:
    """Returns the cameras of the launch's sensors_config.yaml, without cameras of models and robots."""
    sensors = preview_stack(settings).preview.below(SENSORS_PARAMETER)
    return read_cameras(sensors, SENSORS_PARAMETER, lambda frame: "world")[0]


def _image_bytes(camera: Camera) -> float:
    topics, pixels = camera.topics, camera.pinhole.width * camera.pinhole.height
    return float(pixels * (3 * bool(topics.image) + 4 * bool(topics.depth) + POINT.itemsize * bool(topics.points)))
