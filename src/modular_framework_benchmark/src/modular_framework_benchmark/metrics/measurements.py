# SPDX-License-Identifier: BSD-3-Clause
"""What was recorded of an episode, for metrics: values, without files and without ROS.

Times are seconds of the simulated clock since the recording began, and durations called `wall` are real time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from modular_framework_benchmark.records.episode import EpisodeStatus, Span
from modular_framework_benchmark.records.what_ran import WhatRan
from modular_framework_ros.reported_figures import Figure

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ComponentReport:
    """What a component reports of one piece of work.

    Attributes:
        component: `generation`, `planning`, `execution`, `grasp`, or a name of a user's own.
        name: What it was doing, such as the name of a plan.
        succeeded: Whether it succeeded.
        reason: Why it did not; "" on success.
        started_s: Start, simulated time [s].
        ended_s: End, simulated time [s].
        wall_s: Real time it took [s].
        figures: Its own figures, by their declarations, such as `CANDIDATES`.
        motion: The motion it made or executed; None without one.
        ran: What did it, in the modes without simulation.
    """

    component: str
    name: str
    succeeded: bool
    reason: str
    started_s: float
    ended_s: float
    wall_s: float
    figures: Mapping[Figure, float] = field(default_factory=dict)
    motion: Motion | None = None
    ran: WhatRan = WhatRan()


@dataclass(frozen=True, slots=True)
class Motion:
    """A trajectory.

    Attributes:
        joints: Names of the joints.
        times_s: Times of the points since its start, shape (n,) [s].
        positions: Shape (n, joints) [rad or m].
    """

    joints: tuple[str, ...]
    times_s: Array
    positions: Array


@dataclass(frozen=True, slots=True)
class JointSamples(Motion):
    """Measured joints; their times count from when the recording began.

    Attributes:
        velocities: [rad/s or m/s]; NaN where not measured.
        efforts: [Nm or N]; NaN where not measured.
        commands: Commanded positions; NaN before the first command.
    """

    velocities: Array
    efforts: Array
    commands: Array


@dataclass(frozen=True, slots=True)
class TrackingSamples:
    """What a trajectory controller wanted and what it got, at the same times.

    Attributes:
        controller: Its name.
        joints: Names of its joints.
        times_s: Shape (n,) [s].
        desired: Shape (n, joints) [rad or m].
        actual: Shape (n, joints) [rad or m].
    """

    controller: str
    joints: tuple[str, ...]
    times_s: Array
    desired: Array
    actual: Array

    @property
    def errors(self) -> Array:
        """Actual minus desired, shape (n, joints) [rad or m]."""
        return self.actual - self.desired


@dataclass(frozen=True, slots=True)
class ObjectTrack:
    """Poses of an object in the world frame.

    Attributes:
        name: Its name in the simulation.
        times_s: Shape (n,) [s].
        positions: Shape (n, 3) [m].
        quaternions: xyzw, shape (n, 4).
    """

    name: str
    times_s: Array
    positions: Array
    quaternions: Array


@dataclass(frozen=True, slots=True)
class Shake:
    """When the object was shaken after the task.

    Attributes:
        started_s: When that began [s].
        duration_s: How long it was shaken [s].
    """

    started_s: float
    duration_s: float


@dataclass(frozen=True, slots=True)
class EpisodeMeasurements:
    """All that was recorded of an episode.

    Attributes:
        settings: What was run, as in `EpisodeSpec.settings`.
        status: How it ended.
        outcome: Outcome of the task; "" without one.
        cause: Why it did not succeed.
        states: What the states did, by wall time since the episode began.
        task_started_s: When the task was started [s].
        task_s: Simulated time from the request for grasps, or else from when the objects rest, to the end of the task
            [s]; None if it did not end.
        task_wall_s: The same in real time [s].
        generation_s: Real time from the request for grasps to the answer [s]; None if nothing was requested.
        method_processor_s: Processor time of the method's processes from before the objects were placed to the end of
            the task [s]; None if it did not end.
        reports: What the components reported, in the order they ended.
        joints: Measured joints; None if none were recorded.
        tracking: One entry a trajectory controller.
        objects: Tracks of the objects, by name.
        hand: Track of the link that the gripper is fixed to; None if it is not known.
        target: Name of the object that success is about; "" without one.
        held: Whether the target was in the gripper when success was checked.
        shake: When it was shaken; None where that was not asked for.
        folder: Folder with the files of the episode.
    """

    settings: Mapping[str, Any]
    status: EpisodeStatus
    outcome: str = ""
    cause: str = ""
    states: tuple[Span, ...] = ()
    task_started_s: float = 0.0
    task_s: float | None = None
    task_wall_s: float | None = None
    generation_s: float | None = None
    method_processor_s: float | None = None
    reports: tuple[ComponentReport, ...] = ()
    joints: JointSamples | None = None
    tracking: tuple[TrackingSamples, ...] = ()
    objects: Mapping[str, ObjectTrack] = field(default_factory=dict)
    hand: ObjectTrack | None = None
    target: str = ""
    held: bool = False
    shake: Shake | None = None
    folder: Path | None = None

    def values_of(self, figure: Figure) -> list[float]:
        """Returns the values of a figure in the reports that have it, in the order the reports ended."""
        return [report.figures[figure] for report in self.of_component(figure.component) if figure in report.figures]

    def of_component(self, component: str) -> tuple[ComponentReport, ...]:
        """Returns the reports of a component, in the order they ended."""
        return tuple(report for report in self.reports if report.component == component)
