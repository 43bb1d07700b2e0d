# SPDX-License-Identifier: BSD-3-Clause
"""Common part of the modes without simulation: caches robots and solvers, and records errors as broken episodes."""

from __future__ import annotations

import abc
import json
from pathlib import Path
from typing import Any, Generic, TypeVar

from modular_framework_benchmark.experiments.robot_setting import ModelSettingsT, RobotSource
from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_benchmark.modes.measured_record import Stopwatch, broken_record
from modular_framework_benchmark.modes.robots import Robot
from modular_framework_benchmark.modes.ros_robots import load_robot
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec
from modular_framework_benchmark.records.episode_settings import as_json
from modular_framework_planning.errors import ModelError, PlanningError

SetupT = TypeVar("SetupT")


class ModelEpisodeRunner(abc.ABC, Generic[ModelSettingsT, SetupT]):
    """Runs episodes of a mode without simulation within a process."""

    def __init__(self) -> None:
        """Creates empty caches; robots are loaded on demand."""
        self._robots: dict[RobotSource, Robot] = {}
        self._prepared: dict[str, SetupT] = {}

    def run(self, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
        """Runs an episode.

        Args:
            spec: Specification of the episode, with the settings of its mode.
            folder: Folder of the episode.
        """
        watch = Stopwatch()
        try:
            return self.measure(spec, folder, watch)
        except (ModeError, ModelError, PlanningError) as error:
            return broken_record(spec, str(error), watch)

    @abc.abstractmethod
    def measure(self, spec: EpisodeSpec, folder: Path, watch: Stopwatch) -> EpisodeRecord:
        """Runs the component and returns the record of the episode.

        Args:
            spec: Specification of the episode.
            folder: Folder of the episode.
            watch: Stopwatch of the episode.

        Raises:
            ModeError: A setting is invalid.
            ModelError: The robot model is invalid.
            PlanningError: The component cannot be prepared.
        """

    @abc.abstractmethod
    def setup_key(self, settings: ModelSettingsT) -> tuple[Any, ...]:
        """Returns the settings that `prepare` uses; episodes with equal values share its result."""

    @abc.abstractmethod
    def prepare(self, settings: ModelSettingsT) -> SetupT:
        """Returns data that episodes share, such as a solver; raises like `measure`."""

    def end(self, prepared: SetupT) -> None:
        """Releases the result of `prepare`; overridden by modes that start processes."""

    def cached_setup(self, settings: ModelSettingsT) -> SetupT:
        """Returns the cached result of `prepare` for an episode's settings; raises like `measure`."""
        key = json.dumps(as_json(self.setup_key(settings)), sort_keys=True)
        if key not in self._prepared:
            self._prepared[key] = self.prepare(settings)
        return self._prepared[key]

    def close(self) -> None:
        """Releases all results of `prepare` and the robots; repeated calls are allowed."""
        for prepared in self._prepared.values():
            self.end(prepared)
        self._prepared.clear()
        self._robots.clear()

    def robot(self, robot: RobotSource) -> Robot:
        """Returns a cached robot, see :func:`load_robot`.

        Raises:
            ModeError: A file of the robot is missing or invalid.
        """
        if robot not in self._robots:
            self._robots[robot] = load_robot(robot)
        return self._robots[robot]
