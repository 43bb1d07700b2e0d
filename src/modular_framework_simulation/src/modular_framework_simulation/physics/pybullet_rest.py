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

If many bodies sleep, the bodies far from all moving bodies are stored outside of the engine (`pybullet_store`), because
they would fill the processor's caches in every step. A stored body comes back when a moving body approaches it, or a
body that touches it, and when a request concerns it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from typing import Any

import numpy as np

from modular_framework_simulation.physics.physics_engine import BASE_INDEX, REST_LOOK_S
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.pybullet_store import BodyStore, Boxes

_REST_AFTER_S = 2.0
"""Time at low speed after which the engine puts a body to sleep; fixed in the engine [s]."""
_WAKE_PERIOD_S = 0.5
"""Period for waking the bodies in contact with bodies with joints [s of simulated time]."""
MAX_ASLEEP = 100
"""Number of sleeping bodies in the engine above which bodies are stored; fewer bodies cost at most 0.1 ms per step."""
_APPROACH_STEPS = 5
"""Number of steps between two checks for moving bodies that approach stored bodies."""
_NEAR_M = 0.1
"""Distance from a moving body at which a stored body comes back, in addition to the motion until the next check [m]. At
twice this distance a body is stored."""


class SleepingBodies:
    """Sleeping bodies of a connection to the engine. Movable bodies without joints and static bodies can sleep.

    Args:
        api: Module pybullet.
        client: Id of the connection.
        settings: Physics settings.
        store: Numbers of the bodies, and the stored bodies.
    """

    def __init__(self, api: Any, client: int, settings: PhysicsSettings, store: BodyStore) -> None:
        self._api, self._client, self._settings, self._store = api, client, settings, store
        self._woken: dict[int, int] = {}  # movable bodies that can sleep, with the step of the last wake-up
        self._jointed: list[int] = []
        self._never_move: set[int] = set()
        self._slept: set[int] = set()  # bodies asleep at the last check
        self._known: set[int] = set()  # bodies asleep at the last two checks
        self._steps = 0
        self._waking: set[int] = set()
        self._lost: list[tuple[int, Callable[[], None]]] = []
        self._inside: set[int] = set()  # movable bodies that can sleep, except stored bodies
        self._loaded: set[int] = set()  # bodies restored since the last step
        self._watched: set[int] = set()  # bodies whose contacts are read
        self._corners: dict[tuple[int, int], tuple[Any, Any]] = {}  # link boxes at the last check, by body and link
        self._checked = 0  # step number of the last check
        self._may_approach = False  # whether the next step needs a check

    def adjust(self, settings: PhysicsSettings) -> None:
        """Applies new settings."""
        self._settings = settings
        self.wake_all()

    def add(self, body: int, fixed: bool, has_joints: bool) -> None:
        """Adds a new body.

        Args:
            body: Number of the body.
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
            self._inside.add(body)
            self._change(body, self._api.ACTIVATION_STATE_ENABLE_SLEEPING)

    def body_id(self, body: int) -> int:
        """Returns the engine's id of a body, which is loaded again if it is stored."""
        if body in self._store.stored_poses:
            self._bring_back([body])
        return self._store.body_id(body)

    def _bring_back(self, bodies: Collection[int]) -> None:
        self._store.bring_back(bodies)
        self._inside.update(bodies)
        self._loaded.update(bodies)
        for body in bodies:
            self._change(body, self._api.ACTIVATION_STATE_ENABLE_SLEEPING | self._api.ACTIVATION_STATE_SLEEP)

    def _bring_back_near(self, body: int) -> list[int]:
        """Brings the stored bodies at a body back, and returns them."""
        found = self._store.find(self._boxes([body])) if self._store.stored_poses else []
        self._bring_back(found)
        return found

    def watch(self, body: int) -> None:
        """Keeps a body and its neighbours in the engine, because its contacts are read."""
        if body not in self._watched and body not in self._jointed:
            self._watched.add(body)
            for near in self._bring_back_near(body):
                self.wake(near)

    def keep_awake(self, body: int) -> None:
        """Prevents a body from sleeping."""
        self.body_id(body)
        if self._woken.pop(body, None) is not None or body in self._never_move:
            for bodies in (self._never_move, self._slept, self._known, self._inside):
                bodies.discard(body)
            self._change(body, self._api.ACTIVATION_STATE_DISABLE_SLEEPING)

    def remove(self, body: int) -> None:
        """Forgets a body."""
        self._woken.pop(body, None)
        for bodies in (
            self._waking,
            self._never_move,
            self._slept,
            self._known,
            self._loaded,
            self._watched,
            self._inside,
        ):
            bodies.discard(body)
        self._corners = {key: corners for key, corners in self._corners.items() if key[0] != body}
        self._lost = [each for each in self._lost if each[0] != body]
        if body in self._jointed:
            self._jointed.remove(body)

    def _change(self, body: int, activation: int) -> None:
        threshold = self._settings.rest_speed**2  # minimum of the sum of the squared velocities
        self._api.changeDynamics(
            self.body_id(body),
            BASE_INDEX,
            activationState=activation,
            sleepThreshold=threshold,
            physicsClientId=self._client,
        )

    def wake(self, body: int) -> None:
        """Wakes a body; has no effect on bodies that never sleep."""
        self._expect_motion()
        if body in self._woken:
            self.body_id(body)
            if body not in self._loaded and self._is_at_rest(body):
                self._waking.add(body)
            self._woken[body] = self._steps
            self._slept.discard(body)
            self._known.discard(body)
            self._change(body, self._api.ACTIVATION_STATE_WAKE_UP)

    def wake_touching(self, body: int) -> None:
        """Wakes the bodies that touched a body in the last step, because the body is about to move."""
        self._expect_motion()
        if self._woken:
            near = self._bring_back_near(body)
            points = self._api.getContactPoints(bodyA=self.body_id(body), physicsClientId=self._client)
            for touched in sorted({*near, *(self._store.number(point[2]) for point in points)}):
                self.wake(touched)

    def wake_near(self, body: int) -> None:
        """Wakes the bodies that overlap a static body or are close to it; moving bodies wake others by contact."""
        if body not in self._never_move or not self._woken:
            return
        self._bring_back_near(body)
        for corners in self._link_corners(body).values():
            found = self._api.getOverlappingObjects(*corners, physicsClientId=self._client)
            for near in sorted({self._store.number(body_id) for body_id, _ in found or ()}):
                self.wake(near)

    def _link_corners(self, body: int) -> dict[int, tuple[Any, Any]]:
        """Returns the lower and the upper corner of the box of each link [m]."""
        body_id = self.body_id(body)
        links = range(BASE_INDEX, self._api.getNumJoints(body_id, physicsClientId=self._client))
        return {link: self._api.getAABB(body_id, link, physicsClientId=self._client) for link in links}

    def _boxes(self, bodies: Iterable[int]) -> Boxes:
        return Boxes.of_corners(corners for body in bodies for corners in self._link_corners(body).values())

    @property
    def bodies_at_rest(self) -> Collection[int]:
        """Static bodies, and bodies that have been asleep for at least REST_LOOK_S."""
        return self._never_move | self._known

    def _update_sleeping(self) -> None:
        """Updates the sleeping bodies; this check detects bodies that the engine has woken by a contact."""
        slept = {body for body in self._inside if self._is_at_rest(body)} | self._store.stored_poses.keys()
        self._known, self._slept = slept & self._slept, slept
        asleep = [body for body in self._known & self._inside if self._store.can_store(body)]
        if len(asleep) > MAX_ASLEEP:
            self._store_far(sorted(asleep))

    def _store_far(self, asleep: list[int]) -> None:
        """Stores the bodies that no body can reach soon."""
        boxes = self._boxes(asleep)
        others = [body for body in (*self._jointed, *self._woken) if body not in self._slept]
        far = ~boxes.reached_from(self._boxes({*others, *self._watched}).grown(2.0 * _NEAR_M))
        chosen = [body for body, is_far in zip(asleep, far, strict=True) if is_far]
        self._store.store(chosen, Boxes(boxes.lower[far], boxes.upper[far]))
        self._inside.difference_update(chosen)
        self._expect_motion()

    def before_step(self) -> None:
        """Brings back the stored bodies that a moving body approaches; must be called before every step."""
        steps = self._steps - self._checked
        if not self._store.stored_poses or not (self._may_approach or steps >= _APPROACH_STEPS):
            return
        moving = [*self._jointed, *(body for body in sorted(self._inside) if not self._is_at_rest(body))]
        corners = {(body, link): box for body in moving for link, box in self._link_corners(body).items()}
        boxes = Boxes.of_corners(corners.values())
        before = Boxes.of_corners(self._corners.get(key, box) for key, box in corners.items())
        moved = np.maximum(abs(boxes.lower - before.lower), abs(boxes.upper - before.upper)).max(axis=1, initial=0.0)
        self._may_approach = not corners.keys() <= self._corners.keys()  # the motion of some boxes is not known yet
        self._corners, self._checked = corners, self._steps
        self._bring_back(self._store.find(boxes.grown(_NEAR_M + 2.0 * _APPROACH_STEPS / max(steps, 1) * moved)))

    def _expect_motion(self) -> None:
        """Requests a check before the next step; the previous positions say nothing about a body that was placed."""
        self._may_approach = True
        self._corners.clear()

    def wake_all(self) -> None:
        """Wakes all bodies."""
        self._bring_back(list(self._store.stored_poses))
        for body in self._woken:
            self.wake(body)

    def _is_at_rest(self, body: int) -> bool:
        """Returns whether a body sleeps; the velocities of a sleeping body are exactly 0."""
        if body in self._store.stored_poses:
            return True
        if (self._steps - self._woken[body]) * self._settings.time_step_s < _REST_AFTER_S:
            return False
        linear, angular = self._api.getBaseVelocity(self._store.body_id(body), physicsClientId=self._client)
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
        self._loaded.clear()
        if self._steps % round(REST_LOOK_S / self._settings.time_step_s) == 0:
            self._update_sleeping()
        if self._steps % round(_WAKE_PERIOD_S / self._settings.time_step_s) == 0:
            for body in self._jointed:
                self.wake_touching(body)
