# SPDX-License-Identifier: BSD-3-Clause
"""Decides what the page says about the simulation, from the ROS master and from the poses that arrive."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from enum import Enum, auto

from modular_framework_simulation.sensors.scene_text import ScenePoses
from modular_framework_simulation.viewer.world_view import RealTimeFactor

MAX_SILENCE_S = 3.0
"""Maximum time between two messages of a running simulation [s]; 75 times their period, for a busy computer."""


class Phase(Enum):
    """Knowledge about the simulation."""

    SEARCHING = auto()
    """The ROS master was not asked yet."""
    NO_MASTER = auto()
    """The ROS master does not respond."""
    ABSENT = auto()
    """No simulation is registered at the ROS master."""
    WAITING = auto()
    """A simulation is registered, and its first poses have not arrived."""
    RUNNING = auto()
    """Poses arrive."""
    LOST = auto()
    """A simulation is registered, and its poses no longer arrive."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """Status of the simulation.

    Attributes:
        phase: Knowledge about the simulation.
        time_s: Simulated time of the latest poses [s]; 0 before the first poses.
        paused: Whether time was paused at the latest poses.
        factor: Measured ratio of simulated to real time.
        silence_s: Real time since the latest poses [s].
    """

    phase: Phase
    time_s: float = 0.0
    paused: bool = False
    factor: float = 0.0
    silence_s: float = 0.0

    @property
    def has_controls(self) -> bool:
        """Returns whether the page offers the controls of time."""
        return self.phase in (Phase.RUNNING, Phase.LOST)

    def __str__(self) -> str:
        match self.phase:
            case Phase.SEARCHING:
                return "Looking for a simulation."
            case Phase.NO_MASTER:
                return "The ROS master does not respond."
            case Phase.ABSENT:
                return "No simulation is running."
            case Phase.WAITING:
                return "Waiting for the first state of the simulation."
            case Phase.RUNNING:
                state = "paused" if self.paused else f"real time factor {self.factor:.2f}"
                return f"Time {self.time_s:.2f} s, {state}."
            case Phase.LOST:
                return f"The simulation has not responded for {self.silence_s:.0f} s, since time {self.time_s:.2f} s."
        raise ValueError(f"{self.phase} is not a phase")


class SimulationWatch:
    """Keeps the latest knowledge about the simulation.

    Poses that arrive prove that the simulation runs, whatever the master says. All methods may be called by any thread.
    """

    def __init__(self) -> None:
        self._found: Phase = Phase.SEARCHING
        self._poses: ScenePoses | None = None
        self._heard_s = 0.0
        self._factor = RealTimeFactor()
        self._lock = threading.Lock()

    def note_search(self, found: bool | None) -> None:
        """Notes whether a simulation is registered at the master; None if the master does not respond."""
        if found is None:
            self._found = Phase.NO_MASTER
        else:
            self._found = Phase.WAITING if found else Phase.ABSENT

    def note_poses(self, poses: ScenePoses, now_s: float) -> None:
        """Notes poses and their arrival time [s]."""
        with self._lock:
            self._poses, self._heard_s = poses, now_s
            self._factor.note(now_s, poses.time_ns)

    def forget(self) -> None:
        """Forgets everything, because the viewer listens no longer."""
        with self._lock:
            self._found, self._poses, self._factor = Phase.SEARCHING, None, RealTimeFactor()

    def status(self, now_s: float) -> Status:
        """Returns the status at a time [s] of the clock of the arrival times."""
        with self._lock:
            poses, found, silence_s, factor = self._poses, self._found, now_s - self._heard_s, self._factor.value
        if poses is None:
            return Status(phase=found)
        phase = Phase.RUNNING
        if silence_s > MAX_SILENCE_S:
            phase = Phase.LOST if found is Phase.WAITING else found
        return Status(
            phase=phase,
            time_s=poses.time_ns * 1e-9,
            paused=poses.paused,
            factor=factor,
            silence_s=silence_s,
        )
