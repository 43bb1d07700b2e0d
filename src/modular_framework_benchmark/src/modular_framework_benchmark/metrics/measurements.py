# SPDX-License-Identifier: BSD-3-Clause
"""Measurements of an episode for metrics: values, without files and without ROS.

Times are seconds of the simulated clock since the start of the recording; durations named `wall` are real time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from modular_framework_benchmark.predicates.progress import Progress
from modular_framework_benchmark.predicates.world_track import WorldTrack
from modular_framework_benchmark.records.episode import EpisodeStatus, Span
from modular_framework_benchmark.records.episode_settings import EpisodeSettings
from modular_framework_benchmark.records.used_software import UsedSoftware
from modular_framework_ros.reported_figures import Figure

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ComponentReport:
    """Report of a component on an activity.

    Attributes:
        component: `generation`, `planning`, `execution`, `grasp`, or a name defined by the user.
        name: Name of the activity, such as the name of a plan.
        succeeded: Whether the activity succeeded.
        reason: Reason for a failure; "" on success.
        started_s: Start in simulated time [s].
        ended_s: End in simulated time [s].
        wall_s: Real duration [s].
        processor_s: Processor time of a grasp generation method, in the mode `grasps` [s]; None in other modes.
        figures: Reported figures, keyed by declaration such as `CANDIDATES`.
        motion: Planned or executed motion; None without a motion.
        ran: Software that ran, in the modes without simulation.
    """

    component: str
    name: str
    succeeded: bool
    reason: str
    started_s: float
    ended_s: float
    _: KW_ONLY
    wall_s: float
    processor_s: float | None = None
    figures: Mapping[Figure, float] = field(default_factory=dict)
    motion: Motion | None = None
    ran: UsedSoftware = UsedSoftware()


@dataclass(frozen=True, slots=True)
class Motion:
    """A trajectory.

    Attributes:
        joints: Names of the joints.
        times_s: Times since the start of the trajectory, shape (n,) [s].
        positions: Joint positions, shape (n, joints) [rad or m].
    """

    joints: tuple[str, ...]
    times_s: Array
    positions: Array


@dataclass(frozen=True, slots=True)
class JointSamples(Motion):
    """Measured joint states, with times since the start of the recording.

    Attributes:
        velocities: Joint velocities [rad/s or m/s]; NaN if not measured.
        efforts: Joint efforts [Nm or N]; NaN if not measured.
        commands: Commanded positions [rad or m]; NaN before the first command.
    """

    velocities: Array
    efforts: Array
    commands: Array


@dataclass(frozen=True, slots=True)
class TrackingSamples:
    """Desired and actual positions of a trajectory controller.

    Attributes:
        controller: Name of the controller.
        joints: Names of the joints.
        times_s: Times, shape (n,) [s].
        desired: Desired positions, shape (n, joints) [rad or m].
        actual: Measured positions, shape (n, joints) [rad or m].
    """

    controller: str
    joints: tuple[str, ...]
    times_s: Array
    desired: Array
    actual: Array

    @property
    def errors(self) -> Array:
        """Actual minus desired positions, shape (n, joints) [rad or m]."""
        return self.actual - self.desired


@dataclass(frozen=True, slots=True)
class ObjectTrack:
    """Poses of an object in the world frame.

    Attributes:
        name: Name of the object in the simulation.
        times_s: Times, shape (n,) [s].
        positions: Positions, shape (n, 3) [m].
        quaternions: Orientations (xyzw), shape (n, 4).
    """

    name: str
    times_s: Array
    positions: Array
    quaternions: Array


@dataclass(frozen=True, slots=True)
class Shake:
    """Shake of the object after the task.

    Attributes:
        started_s: Start time [s].
        duration_s: Duration [s].
    """

    started_s: float
    duration_s: float


@dataclass(frozen=True, slots=True)
class EpisodeMeasurements:
    """Measurements of an episode.

    Attributes:
        settings: Settings of the episode; the class belongs to the mode.
        status: Final status.
        outcome: Outcome of the task; "" without a task.
        cause: Cause of a failure.
        states: Spans of the states, in real time since the start of the episode.
        task_started_s: Start time of the task [s].
        task_s: Simulated time from the request for grasps, or else from the moment when objects rest, to the end of the
            task [s]; None if the task did not end.
        task_wall_s: Real time of the same period [s].
        generation_s: Real time from the request for grasps to the answer [s]; None without a request.
        method_processor_s: Processor time of the method's processes from before the objects were spawned to the end of
            the task [s]; None if the task did not end.
        reports: Reports of the components in the order of their ends.
        joints: Measured joint states; None if not recorded.
        tracking: Tracking samples of the trajectory controllers.
        objects: Tracks of the objects, keyed by name.
        hand: Track of the gripper's parent link; None if unknown.
        target: Name of the object in the success criteria; "" for none.
        held: Whether the target was in the gripper at the success check.
        shake: Shake of the object; None if not requested.
        world: True states of the world from the start of the task to its check; None without a record.
        progress: Milestones that were reached; None without milestones.
        folder: Folder of the episode's files.
    """

    settings: EpisodeSettings
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
    world: WorldTrack | None = None
    progress: Progress | None = None
    folder: Path | None = None

    def values_of(self, figure: Figure) -> list[float]:
        """Returns the values of a figure in the reports that contain it, in the order of the reports."""
        return [report.figures[figure] for report in self.of_component(figure.component) if figure in report.figures]

    def of_component(self, component: str) -> tuple[ComponentReport, ...]:
        """Returns the reports of a component in the order of their ends."""
        return tuple(report for report in self.reports if report.component == component)
