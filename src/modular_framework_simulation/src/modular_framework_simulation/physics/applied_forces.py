# SPDX-License-Identifier: BSD-3-Clause
"""Forces and torques on links and joints that requests apply for an interval of simulated time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from modular_framework_simulation.physics.body_joints import apply_effort
from modular_framework_simulation.physics.body_links import apply_wrench
from modular_framework_simulation.physics.part_names import PartName
from modular_framework_simulation.physics.physics_engine import PhysicsEngine
from modular_framework_simulation.physics.simulated_body import SimulatedBody
from modular_framework_urdf.rotations import Vector3


@dataclass(frozen=True, slots=True)
class Interval:
    """Interval of simulated time.

    Attributes:
        start_ns: Start [ns]; steps that begin earlier are outside.
        end_ns: End [ns], or None; steps that begin at the end or later are outside.
    """

    start_ns: int
    end_ns: int | None

    @staticmethod
    def from_request(now_ns: int, start_ns: int, duration_ns: int) -> Interval:
        """Returns the interval of a request.

        Args:
            now_ns: Current simulated time [ns].
            start_ns: Requested start [ns]; a time in the past stands for the current time.
            duration_ns: Requested duration [ns]; a negative duration stands for no end.
        """
        start = max(now_ns, start_ns)
        return Interval(start, None if duration_ns < 0 else start + duration_ns)

    def is_over(self, time_ns: int) -> bool:
        """Returns whether all steps that begin now or later are outside."""
        return self.end_ns is not None and time_ns >= self.end_ns


@dataclass(frozen=True, slots=True)
class LinkWrench:
    """Force and torque on a link.

    Attributes:
        link: Name of the link.
        force: Force at the centre of mass, in the world frame [N].
        torque: Torque in the world frame [Nm].
        interval: Interval of the wrench.
    """

    link: PartName
    force: Vector3
    torque: Vector3
    interval: Interval


@dataclass(frozen=True, slots=True)
class JointEffort:
    """Torque [Nm] or force [N] along the axis of a joint."""

    joint: PartName
    effort: float
    interval: Interval


@dataclass(frozen=True, slots=True)
class SavedForces:
    """Copy of all current and future forces."""

    wrenches: tuple[LinkWrench, ...]
    efforts: tuple[JointEffort, ...]


class AppliedForces:
    """Forces on the world in addition to gravity, contacts and the robot's drives; used by one thread.

    The engine discards forces after each step, so they are applied before every step.

    Args:
        engine: The physics engine.
    """

    def __init__(self, engine: PhysicsEngine) -> None:
        self._engine = engine
        self._wrenches: list[LinkWrench] = []
        self._efforts: list[JointEffort] = []

    @property
    def pending(self) -> bool:
        """Returns whether any current or future force exists."""
        return bool(self._wrenches or self._efforts)

    def add_wrench(self, wrench: LinkWrench) -> None:
        """Adds a wrench; several wrenches on a link add up."""
        self._wrenches.append(wrench)

    def add_effort(self, effort: JointEffort) -> None:
        """Adds an effort; several efforts on a joint add up."""
        self._efforts.append(effort)

    def clear_link(self, link: PartName) -> int:
        """Removes all current and future wrenches on a link; returns their number."""
        before = len(self._wrenches)
        self._wrenches = [each for each in self._wrenches if each.link != link]
        return before - len(self._wrenches)

    def clear_joint(self, joint: PartName) -> int:
        """Removes all current and future efforts on a joint; returns their number."""
        before = len(self._efforts)
        self._efforts = [each for each in self._efforts if each.joint != joint]
        return before - len(self._efforts)

    def clear(self) -> None:
        """Removes all wrenches and efforts."""
        self._wrenches, self._efforts = [], []

    def save(self) -> SavedForces:
        """Returns a copy of all wrenches and efforts."""
        return SavedForces(tuple(self._wrenches), tuple(self._efforts))

    def restore(self, saved: SavedForces) -> None:
        """Restores the wrenches and efforts of a copy."""
        self._wrenches, self._efforts = list(saved.wrenches), list(saved.efforts)

    def forget_model(self, model: str) -> None:
        """Removes all wrenches and efforts on a deleted model."""
        self._wrenches = [each for each in self._wrenches if each.link.model != model]
        self._efforts = [each for each in self._efforts if each.joint.model != model]

    def apply(self, time_ns: int, bodies: Mapping[str, SimulatedBody]) -> None:
        """Applies all forces that are due in the step that begins now.

        Args:
            time_ns: Simulated time at the start of the step [ns].
            bodies: Models by name.
        """
        if not self.pending:
            return
        self._wrenches = [each for each in self._wrenches if not each.interval.is_over(time_ns)]
        self._efforts = [each for each in self._efforts if not each.interval.is_over(time_ns)]
        for wrench in self._wrenches:
            if wrench.interval.start_ns <= time_ns:
                body = bodies[wrench.link.model]
                apply_wrench(self._engine, body, wrench.link.part, wrench.force, wrench.torque)
        for effort in self._efforts:
            if effort.interval.start_ns <= time_ns:
                apply_effort(self._engine, bodies[effort.joint.model], effort.joint.part, effort.effort)
