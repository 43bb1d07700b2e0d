# SPDX-License-Identifier: BSD-3-Clause
"""What the modes without simulation share: robots and solvers are made once, what cannot be run is a broken episode."""

from __future__ import annotations

import abc
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_benchmark.modes.measured_record import Stopwatch, broken_record
from modular_framework_benchmark.modes.robots import Robot
from modular_framework_benchmark.modes.ros_robots import load_robot
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec
from modular_framework_planning.errors import ModelError, PlanningError

PreparedT = TypeVar("PreparedT")


class ModelEpisodeRunner(abc.ABC, Generic[PreparedT]):
    """Runs episodes of a mode without simulation; belongs to one process.

    Attributes:
        prepared_by: Names of the settings that `prepare` uses: episodes with the same values of them share its result.
    """

    prepared_by: ClassVar[tuple[str, ...]]

    def __init__(self) -> None:
        """Starts nothing: robots are loaded for the first episode that needs them."""
        self._robots: dict[str, Robot] = {}
        self._prepared: dict[str, PreparedT] = {}

    def run(self, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
        """Runs an episode.

        Args:
            spec: What to run; the experiment file of its mode has the settings.
            folder: Folder of the episode.
        """
        watch = Stopwatch()
        try:
            return self.measure(spec, folder, watch)
        except (ModeError, ModelError, PlanningError) as error:
            return broken_record(spec, str(error), watch)

    @abc.abstractmethod
    def measure(self, spec: EpisodeSpec, folder: Path, watch: Stopwatch) -> EpisodeRecord:
        """Does what the episode is about; `watch` runs since its begin.

        Raises:
            ModeError: A setting of it is wrong.
            ModelError: The robot is.
            PlanningError: What it asks for cannot be prepared.
        """

    @abc.abstractmethod
    def prepare(self, settings: Mapping[str, Any]) -> PreparedT:
        """Makes what episodes share, such as a solver; raises as `measure` does."""

    def end(self, prepared: PreparedT) -> None:
        """Ends what `prepare` has started: nothing, unless a mode starts processes."""

    def prepared(self, settings: Mapping[str, Any]) -> PreparedT:
        """Returns what `prepare` makes for an episode's settings, made once; raises as `measure` does."""
        key = json.dumps([settings.get(name) for name in self.prepared_by], sort_keys=True)
        if key not in self._prepared:
            self._prepared[key] = self.prepare(settings)
        return self._prepared[key]

    def close(self) -> None:
        """Ends the processes, if there are any, and forgets the robots; may be called twice."""
        for prepared in self._prepared.values():
            self.end(prepared)
        self._prepared.clear()
        self._robots.clear()

    def robot(self, robot: str | Mapping[str, Any]) -> Robot:
        """Returns a robot, see :func:`load_robot`; loads it once.

        Raises:
            ModeError: A file of it is missing or wrong.
        """
        key = json.dumps(robot, sort_keys=True)
        if key not in self._robots:
            self._robots[key] = load_robot(robot)
        return self._robots[key]
