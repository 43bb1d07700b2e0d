# SPDX-License-Identifier: BSD-3-Clause
"""Forces and torques that requests let act on links and joints for some of simulated time."""

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
    """A stretch of simulated time.

    Attributes:
        start_ns: Its beginning [ns]; a step that begins before is outside.
        end_ns: Its end [ns], None without; a step that begins then or later is outside.
    """

    start_ns: int
    end_ns: int | None

    @staticmethod
    def from_request(now_ns: int, start_ns: int, duration_ns: int) -> Interval:
        """Returns the interval of a request: a start in the past means now, a negative duration has no end."""
        begin = max(now_ns, start_ns)
        return Interval(begin, None if duration_ns < 0 else begin + duration_ns)

    def is_over(self, time_ns: int) -> bool:
        """Whether no step that begins now or later is inside."""
        return self.end_ns is not None and time_ns >= self.end_ns


@dataclass(frozen=True, slots=True)
class LinkWrench:
    """A force and a torque on a link.

    Attributes:
        link: What they act on.
        force: At the centre of mass, in the world frame [N].
        torque: In the world frame [Nm].
        interval: When they act.
    """

    link: PartName
    force: Vector3
    torque: Vector3
    interval: Interval


@dataclass(frozen=True, slots=True)
class JointEffort:
    """A torque [Nm] or force [N] along the axis of a joint."""

    joint: PartName
    effort: float
    interval: Interval


@dataclass(frozen=True, slots=True)
class SavedForces:
    """A copy of what acts and will act."""

    wrenches: tuple[LinkWrench, ...]
    efforts: tuple[JointEffort, ...]


class AppliedForces:
    """What acts on the world besides gravity, contacts and the drives of the robot; used by one thread.

    The engine drops forces after each step, so they are applied again before every one.

    Args:
        engine: Where they act.
    """

    def __init__(self, engine: PhysicsEngine) -> None:
        self._engine = engine
        self._wrenches: list[LinkWrench] = []
        self._efforts: list[JointEffort] = []

    @property
    def pending(self) -> bool:
        """Whether something acts or will act."""
        return bool(self._wrenches or self._efforts)

    def add_wrench(self, wrench: LinkWrench) -> None:
        """Adds a force and a torque; several on one link add up."""
        self._wrenches.append(wrench)

    def add_effort(self, effort: JointEffort) -> None:
        """Adds an effort; several on one joint add up."""
        self._efforts.append(effort)

    def clear_link(self, link: PartName) -> int:
        """Ends all wrenches on a link, also those to come; returns how many."""
        before = len(self._wrenches)
        self._wrenches = [each for each in self._wrenches if each.link != link]
        return before - len(self._wrenches)

    def clear_joint(self, joint: PartName) -> int:
        """Ends all efforts on a joint, also those to come; returns how many."""
        before = len(self._efforts)
        self._efforts = [each for each in self._efforts if each.joint != joint]
        return before - len(self._efforts)

    def clear(self) -> None:
        """Ends all wrenches and efforts."""
        self._wrenches, self._efforts = [], []

    def saved(self) -> SavedForces:
        """Returns a copy of all wrenches and efforts."""
        return SavedForces(tuple(self._wrenches), tuple(self._efforts))

    def restore(self, saved: SavedForces) -> None:
        """Continues with the wrenches and efforts of a copy."""
        self._wrenches, self._efforts = list(saved.wrenches), list(saved.efforts)

    def forget_model(self, model: str) -> None:
        """Ends everything that has to do with a model that is gone."""
        self._wrenches = [each for each in self._wrenches if each.link.model != model]
        self._efforts = [each for each in self._efforts if each.joint.model != model]

    def apply(self, time_ns: int, bodies: Mapping[str, SimulatedBody]) -> None:
        """Lets everything act that is due in the step that begins now.

        Args:
            time_ns: Simulated time at the beginning of the step [ns].
            bodies: The models by name.
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
