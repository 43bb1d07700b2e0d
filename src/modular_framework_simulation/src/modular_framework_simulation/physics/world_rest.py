# SPDX-License-Identifier: BSD-3-Clause
"""Detects when nothing in a world moves, so that its steps need not be computed."""

from __future__ import annotations

from collections.abc import Iterable

from modular_framework_simulation.physics.physics_engine import PhysicsEngine
from modular_framework_simulation.physics.simulated_body import SimulatedBody

_AT_REST = 1e-9
"""Maximum velocity at rest [m/s, rad/s], which moves a body by 4 micrometres per hour. For comparison, the numerical
residual of a robot that holds its position is 1e-13, and an object that creeps by 1 mm per hour has 3e-7."""
_CHECK_PERIOD_S = 0.1
"""Period of the velocity checks [s of simulated time]."""


class WorldRest:
    """Detects rest of a world: all velocities are 0 after two consecutive steps, so all accelerations are also 0.

    The world stays at rest until `disturb` reports an external change: a force, a command, or a change of a model.

    Args:
        engine: Physics engine of the world.
    """

    def __init__(self, engine: PhysicsEngine) -> None:
        self._engine = engine
        self._steps = 0
        self._was_still = False
        self.holds = False
        """Whether the world is at rest."""

    def disturb(self) -> None:
        """Marks the world as moving, so that the following steps are computed."""
        self._steps, self._was_still, self.holds = 0, False, False

    def after_step(self, bodies: Iterable[SimulatedBody]) -> None:
        """Checks the velocities periodically; call this method after every computed step.

        Args:
            bodies: All models of the world.
        """
        self._steps += 1
        if self._was_still or self._steps % round(_CHECK_PERIOD_S / self._engine.settings.time_step_s) == 0:
            resting = self._engine.resting()
            parts = [part for body in bodies for part in body.parts]
            parts.sort(key=lambda part: part.number in resting)  # moving bodies first, to end the search early
            still = not any(map(self._moves, parts))
            self.holds = still and self._was_still
            self._was_still = still

    def _moves(self, part: SimulatedBody) -> bool:
        engine, number = self._engine, part.number
        if not part.static and _is_fast(value for vector in engine.base_twist(number) for value in vector):
            return True
        joints = list(part.joint_indices.values())
        if joints and _is_fast(state.velocity for state in engine.joint_states(number, joints)):
            return True
        return any(_is_fast(engine.ball_joint_state(number, index)[1]) for index in part.ball_joint_indices)


def _is_fast(velocities: Iterable[float]) -> bool:
    return any(abs(each) > _AT_REST for each in velocities)
