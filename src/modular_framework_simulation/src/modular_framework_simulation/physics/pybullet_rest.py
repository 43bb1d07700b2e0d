# SPDX-License-Identifier: BSD-3-Clause
"""Which bodies PyBullet leaves out of its steps because they lie still, and what makes it compute them again.

The engine lets a body rest that was slow for two seconds, and wakes it when a moving body touches it. What it does not
notice is handled here:

- A body that a hand has held still for two seconds would stay in the air when the hand opens: in the step in which the
  contact ends it has no velocity yet. So whatever touches a body with joints is woken now and then.
- What lies on a body that a request takes away, or feels another gravity, is woken by `wake_all`.
- A body wakes at the end of a step, in which a new velocity and forces are lost; they are given again after it.
- The load on a joint of a body at rest would read zero, so a body in which one is measured never rests.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from modular_framework_simulation.physics.physics_engine import BASE_INDEX
from modular_framework_simulation.physics.physics_settings import PhysicsSettings

_REST_AFTER_S = 2.0
"""How long a body is slow before it rests; fixed in the engine [s]."""
_LOOK_S = 0.5
"""How often what touches bodies with joints is woken [s of simulated time]."""


class Rest:
    """The bodies of one connection to the engine that may rest: those without joints that are not fixed.

    Args:
        api: The module pybullet.
        client: The connection.
        settings: Numbers of the engine.
    """

    def __init__(self, api: Any, client: int, settings: PhysicsSettings) -> None:
        self._api, self._client, self._settings = api, client, settings
        self._woken: dict[int, int] = {}  # bodies that may rest, and the step in which each was woken last
        self._jointed: list[int] = []
        self._steps = 0
        self._waking: set[int] = set()
        self._lost: list[tuple[int, Callable[[], None]]] = []

    def adjust(self, settings: PhysicsSettings) -> None:
        """Continues with other settings."""
        self._settings = settings
        self.wake_all()

    def add(self, body: int, fixed: bool, has_joints: bool) -> None:
        """Says what a new body is like."""
        if has_joints:
            self._jointed.append(body)
        elif not fixed and self._settings.rest_speed > 0.0:
            self._woken[body] = self._steps
            self._change(body, self._api.ACTIVATION_STATE_ENABLE_SLEEPING)

    def keep_awake(self, body: int) -> None:
        """Lets a body never rest."""
        if self._woken.pop(body, None) is not None:
            self._change(body, self._api.ACTIVATION_STATE_DISABLE_SLEEPING)

    def remove(self, body: int) -> None:
        """Forgets a body."""
        self._woken.pop(body, None)
        self._waking.discard(body)
        self._lost = [each for each in self._lost if each[0] != body]
        if body in self._jointed:
            self._jointed.remove(body)

    def _change(self, body: int, activation: int) -> None:
        threshold = self._settings.rest_speed**2  # of the sum of the squared velocities
        self._api.changeDynamics(
            body, BASE_INDEX, activationState=activation, sleepThreshold=threshold, physicsClientId=self._client
        )

    def wake(self, body: int) -> None:
        """Lets a body move again; one that always does is left alone."""
        if body in self._woken:
            if self._rests(body):
                self._waking.add(body)
            self._woken[body] = self._steps
            self._change(body, self._api.ACTIVATION_STATE_WAKE_UP)

    def wake_all(self) -> None:
        """Lets every body move again."""
        for body in self._woken:
            self.wake(body)

    def _rests(self, body: int) -> bool:
        """Whether a body rests: the engine gives those no velocity at all."""
        if (self._steps - self._woken[body]) * self._settings.time_step_s < _REST_AFTER_S:
            return False
        linear, angular = self._api.getBaseVelocity(body, physicsClientId=self._client)
        return not any(linear) and not any(angular)

    def disturb(self, body: int, action: Callable[[], None]) -> None:
        """Does something to a body, which wakes; what a body at rest would lose is done again after the step."""
        self.wake(body)
        action()
        if body in self._waking:
            self._lost.append((body, action))

    def after_step(self) -> None:
        """Repeats what bodies that woke in this step lost, and keeps awake what a body with joints touches."""
        self._steps += 1
        for _, action in self._lost:
            action()
        self._waking.clear()
        self._lost.clear()
        if self._woken and self._steps % round(_LOOK_S / self._settings.time_step_s) == 0:
            for body in self._jointed:
                points = self._api.getContactPoints(bodyA=body, physicsClientId=self._client)
                for touched in sorted({point[2] for point in points} & self._woken.keys()):
                    self.wake(touched)
