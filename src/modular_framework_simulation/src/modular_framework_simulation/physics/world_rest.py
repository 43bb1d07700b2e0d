# SPDX-License-Identifier: BSD-3-Clause
"""Detects when nothing in a world moves, so that its steps need not be computed."""

from __future__ import annotations

from collections.abc import Iterable

from modular_framework_simulation.physics.physics_engine import PhysicsEngine
from modular_framework_simulation.physics.simulated_body import SimulatedBody

_AT_REST = 1e-9
"""What is not faster is at rest [m/s, rad/s]: it would be 4 micrometres away after an hour. What engines leave of the
velocity of a robot that holds still is 1e-13; a held object that creeps by a millimetre an hour has 3e-7."""
_LOOK_S = 0.1
"""From one look at the velocities to the next [s of simulated time]."""


class WorldRest:
    """Whether a world is at rest: nothing had a velocity after two steps in a row, so nothing accelerates either.

    It stays at rest until `disturb` says that something is done to it: by a force, a command, a change of a model.

    Args:
        engine: Of the world.
    """

    def __init__(self, engine: PhysicsEngine) -> None:
        self._engine = engine
        self._steps = 0
        self._was_still = False
        self.holds = False
        """Whether the world is at rest."""

    def disturb(self) -> None:
        """Ends the rest: the coming steps are computed."""
        self._steps, self._was_still, self.holds = 0, False, False

    def after_step(self, bodies: Iterable[SimulatedBody]) -> None:
        """Looks at the velocities now and then; to be called after every computed step.

        Args:
            bodies: All models.
        """
        self._steps += 1
        if self._was_still or self._steps % round(_LOOK_S / self._engine.settings.time_step_s) == 0:
            resting = self._engine.resting()
            parts = [part for body in bodies for part in body.parts]
            parts.sort(key=lambda part: part.number in resting)  # what moves is found first
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
