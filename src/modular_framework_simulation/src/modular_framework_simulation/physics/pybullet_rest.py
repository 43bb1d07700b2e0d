# SPDX-License-Identifier: BSD-3-Clause
"""Sleeping bodies in PyBullet: the engine does not compute bodies at rest until they are woken.

The engine puts a body to sleep that was slow for two seconds, and wakes the body if a moving body touches it. This
module handles the events that the engine does not detect:

- A body that a hand has held at rest would keep sleeping in the air after the hand opens, because its velocity is still
  0 when the contact ends. Therefore all bodies in contact with a body with joints are woken periodically.
- If a request moves or removes a body, `wake_touching` wakes the bodies in contact with it. If a static body is placed,
  `wake_near` wakes the bodies at this place. A change of gravity wakes all bodies (`wake_all`).
- A body wakes at the end of a step. A velocity or force of this step is lost and is therefore applied again afterwards.
- A joint load of a sleeping body would read 0, so a body with a measured joint load never sleeps.

Static bodies always sleep; otherwise the engine would compute their contacts with all resting bodies.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

from modular_framework_simulation.physics.physics_engine import BASE_INDEX, REST_LOOK_S
from modular_framework_simulation.physics.physics_settings import PhysicsSettings

_REST_AFTER_S = 2.0
"""Time at low speed after which the engine puts a body to sleep; fixed in the engine [s]."""
_WAKE_PERIOD_S = 0.5
"""Period for waking the bodies in contact with bodies with joints [s of simulated time]."""


class Rest:
    """Sleeping bodies of a connection to the engine. Movable bodies without joints and static bodies can sleep.

    Args:
        api: Module pybullet.
        client: Id of the connection.
        settings: Physics settings.
    """

    def __init__(self, api: Any, client: int, settings: PhysicsSettings) -> None:
        self._api, self._client, self._settings = api, client, settings
        self._woken: dict[int, int] = {}  # movable bodies that can sleep, with the step of the last wake-up
        self._jointed: list[int] = []
        self._never_move: set[int] = set()
        self._slept: set[int] = set()  # asleep at the last check
        self._known: set[int] = set()  # asleep at the last two checks
        self._steps = 0
        self._waking: set[int] = set()
        self._lost: list[tuple[int, Callable[[], None]]] = []

    def adjust(self, settings: PhysicsSettings) -> None:
        """Applies new settings."""
        self._settings = settings
        self.wake_all()

    def add(self, body: int, fixed: bool, has_joints: bool) -> None:
        """Adds a new body.

        Args:
            body: Engine id of the body.
            fixed: Whether the body is fixed to the world.
            has_joints: Whether the body has joints; such a body never sleeps.
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
        """Prevents a body from sleeping."""
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
        """Wakes a body; has no effect on bodies that never sleep."""
        if body in self._woken:
            if self._rests(body):
                self._waking.add(body)
            self._woken[body] = self._steps
            self._slept.discard(body)
            self._known.discard(body)
            self._change(body, self._api.ACTIVATION_STATE_WAKE_UP)

    def wake_touching(self, body: int) -> None:
        """Wakes the bodies that touched a body in the last step, because the body is about to move."""
        points = self._api.getContactPoints(bodyA=body, physicsClientId=self._client) if self._woken else ()
        for touched in sorted({point[2] for point in points}):
            self.wake(touched)

    def wake_near(self, body: int) -> None:
        """Wakes the bodies that overlap a static body or are close to it; moving bodies wake others by contact."""
        if body not in self._never_move or not self._woken:
            return
        for link in range(BASE_INDEX, self._api.getNumJoints(body, physicsClientId=self._client)):
            corners = self._api.getAABB(body, link, physicsClientId=self._client)
            found = self._api.getOverlappingObjects(*corners, physicsClientId=self._client)
            for near in sorted({number for number, _ in found or ()}):
                self.wake(near)

    @property
    def known(self) -> Collection[int]:
        """Static bodies, and bodies that have been asleep for at least REST_LOOK_S."""
        return self._never_move | self._known

    def _look(self) -> None:
        """Updates the sleeping bodies; this check detects bodies that the engine has woken by a contact."""
        slept = {body for body in self._woken if self._rests(body)}
        self._known, self._slept = slept & self._slept, slept

    def wake_all(self) -> None:
        """Wakes all bodies."""
        for body in self._woken:
            self.wake(body)

    def _rests(self, body: int) -> bool:
        """Returns whether a body sleeps; the velocities of a sleeping body are exactly 0."""
        if (self._steps - self._woken[body]) * self._settings.time_step_s < _REST_AFTER_S:
            return False
        linear, angular = self._api.getBaseVelocity(body, physicsClientId=self._client)
        return not any(linear) and not any(angular)

    def disturb(self, body: int, action: Callable[[], None]) -> None:
        """Wakes a body and applies an action to it; for a sleeping body, the action is repeated after the step."""
        self.wake(body)
        action()
        if body in self._waking:
            self._lost.append((body, action))

    def after_step(self) -> None:
        """Repeats lost actions, and wakes the bodies in contact with bodies with joints periodically."""
        self._steps += 1
        for _, action in self._lost:
            action()
        self._waking.clear()
        self._lost.clear()
        if self._steps % round(REST_LOOK_S / self._settings.time_step_s) == 0:
            self._look()
        if self._steps % round(_WAKE_PERIOD_S / self._settings.time_step_s) == 0:
            for body in self._jointed:
                self.wake_touching(body)
