# SPDX-License-Identifier: BSD-3-Clause
"""Which bodies PyBullet leaves out of its steps because they lie still, and what makes it compute them again.

The engine lets a body rest that was slow for two seconds, and wakes it when a moving body touches it. What it does not
notice is handled here:

- A body that a hand has held still for two seconds would stay in the air when the hand opens: in the step in which the
  contact ends it has no velocity yet. So whatever touches a body with joints is woken now and then.
- Bodies that touch one that a request moves or takes away are woken by `wake_touching`, bodies in the place where a
  static body is put by `wake_near`. Another gravity wakes everything (`wake_all`).
- A body wakes at the end of a step, in which a new velocity and forces are lost; they are given again after it.
- The load on a joint of a body at rest would read zero, so a body in which one is measured never rests.

Bodies that never move rest from the start; the engine would otherwise compute their contacts with everything on them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

from modular_framework_simulation.physics.physics_engine import BASE_INDEX, REST_LOOK_S
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
        self._never_move: set[int] = set()
        self._slept: set[int] = set()  # at the last look
        self._known: set[int] = set()  # at the last two looks
        self._steps = 0
        self._waking: set[int] = set()
        self._lost: list[tuple[int, Callable[[], None]]] = []

    def adjust(self, settings: PhysicsSettings) -> None:
        """Continues with other settings."""
        self._settings = settings
        self.wake_all()

    def add(self, body: int, fixed: bool, has_joints: bool) -> None:
        """Adds a new body.

        Args:
            body: Number of the body in the engine.
            fixed: Whether the body is fixed to the world.
            has_joints: Whether the body has joints; such a body never rests.
        """
        if has_joints:
            self._jointed.append(body)
        elif self._settings.rest_speed > 0.0 and fixed:
            self._never_move.add(body)
            self._change(body, self._api.ACTIVATION_STATE_ENABLE_SLEEPING | self._api.ACTIVATION_STATE_SLEEP)
        elif self._settings.rest_speed > 0.0:
            self._woken[body] = self._steps
            self._change(body, self._api.ACTIVATION_STATE_ENABLE_SLEEPING)

    def keep_awake(self, body: int) -> None:
        """Lets a body never rest."""
        if self._woken.pop(body, None) is not None or body in self._never_move:
            for bodies in (self._never_move, self._slept, self._known):
                bodies.discard(body)
            self._change(body, self._api.ACTIVATION_STATE_DISABLE_SLEEPING)

    def remove(self, body: int) -> None:
        """Forgets a body."""
        self._woken.pop(body, None)
        for bodies in (self._waking, self._never_move, self._slept, self._known):
            bodies.discard(body)
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
            self._slept.discard(body)
            self._known.discard(body)
            self._change(body, self._api.ACTIVATION_STATE_WAKE_UP)

    def wake_touching(self, body: int) -> None:
        """Lets what touched a body in the last step move again: the body is about to be elsewhere."""
        points = self._api.getContactPoints(bodyA=body, physicsClientId=self._client) if self._woken else ()
        for touched in sorted({point[2] for point in points}):
            self.wake(touched)

    def wake_near(self, body: int) -> None:
        """Lets what a body that never moves is in or beside now move again; other bodies wake what they touch."""
        if body not in self._never_move or not self._woken:
            return
        for link in range(BASE_INDEX, self._api.getNumJoints(body, physicsClientId=self._client)):
            corners = self._api.getAABB(body, link, physicsClientId=self._client)
            found = self._api.getOverlappingObjects(*corners, physicsClientId=self._client)
            for near in sorted({number for number, _ in found or ()}):
                self.wake(near)

    @property
    def known(self) -> Collection[int]:
        """Bodies that never move, and those that have been at rest for at least REST_LOOK_S."""
        return self._never_move | self._known

    def _look(self) -> None:
        """Looks which bodies rest; what a moving body woke by a touch is noticed here."""
        slept = {body for body in self._woken if self._rests(body)}
        self._known, self._slept = slept & self._slept, slept

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
        if self._steps % round(REST_LOOK_S / self._settings.time_step_s) == 0:
            self._look()
        if self._steps % round(_LOOK_S / self._settings.time_step_s) == 0:
            for body in self._jointed:
                self.wake_touching(body)
