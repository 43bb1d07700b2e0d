# SPDX-License-Identifier: BSD-3-Clause
"""Sleeping bodies in PyBullet: the engine does not compute bodies at rest until they are woken.

The engine puts a body to sleep that was slow for two seconds, and wakes the body if a moving body touches it. This
module handles the events that the engine does not detect:

- A body that a hand has held at rest would keep sleeping in the air after the hand opens, because its velocity is still
  0 when the contact ends. Therefore all bodies in contact with a robot, or with joints that moved, are woken
  periodically.
- If a request moves or removes a body, `wake_touching` wakes the bodies in contact with it. If a static body is placed,
  `wake_near` wakes the bodies at this place. A change of gravity wakes all bodies (`wake_all`).
- A body wakes at the end of a step. A velocity or force of this step is lost and is therefore applied again afterwards.
- A joint load of a sleeping body would read 0, so a body with a measured joint load never sleeps. A robot never sleeps.

Static bodies always sleep; otherwise the engine would compute their contacts with all resting bodies.

If many bodies sleep, the bodies far from all moving bodies are stored outside of the engine (`pybullet_store`), because
they would fill the processor's caches in every step. A stored body comes back when a moving body approaches it, or a
movable body that touches it, and when a request concerns it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any

import numpy as np

from modular_framework_simulation.physics.physics_engine import BASE_INDEX, REST_LOOK_S
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.pybullet_store import BodyStore, Boxes

_REST_AFTER_S = 2.0
"""Time at low speed after which the engine puts a body to sleep; fixed in the engine [s]."""
_WAKE_PERIOD_S = 0.5
"""Period for waking the bodies in contact with robots and moved joints [s of simulated time]."""
_MOVED = 1e-4
"""Motion of a joint or of its model in this period above which the bodies in contact are woken [m or rad]."""
MAX_ASLEEP = 100
"""Number of sleeping bodies in the engine above which bodies are stored; fewer bodies cost at most 0.1 ms per step."""
_APPROACH_STEPS = 5
"""Number of steps between two checks for moving bodies that approach stored bodies."""
_NEAR_M = 0.1
"""Distance from a moving body at which a stored body comes back, in addition to the motion until the next check [m]. At
twice this distance a body is stored."""


class SleepingBodies:
    """Sleeping bodies of a connection to the engine. All bodies except robots can sleep.

    Args:
        api: Module pybullet.
        client: Id of the connection.
        settings: Physics settings.
        store: Numbers of the bodies, and the stored bodies.
    """

    def __init__(self, api: Any, client: int, settings: PhysicsSettings, store: BodyStore) -> None:
        self._api, self._client, self._settings, self._store = api, client, settings, store
        self._woken: dict[int, int] = {}  # movable bodies that can sleep, with the step of the last wake-up
        self._sleepless: list[int] = []  # robots, and movable bodies with a measured joint load
        self._joints: dict[int, tuple[int, ...]] = {}  # movable joints of the bodies that can sleep
        self._placed: dict[int, Any] = {}  # base and joint positions of these bodies at the last periodic wake-up
        self._never_move: set[int] = set()
        self._slept: set[int] = set()  # bodies asleep at the last check
        self._known: set[int] = set()  # bodies asleep at the last two checks
        self._steps = 0
        self._waking: set[int] = set()
        self._lost: list[tuple[int, Callable[[], None]]] = []
        self._inside: set[int] = set()  # bodies that can sleep, except stored bodies and static bodies
        self._loaded: set[int] = set()  # bodies restored since the last step
        self._watched: set[int] = set()  # bodies whose contacts are read
        self._corners: dict[tuple[int, int], tuple[Any, Any]] = {}  # link boxes at the last check, by body and link
        self._checked = 0  # step number of the last check
        self._may_approach = False  # whether the next step needs a check

    def adjust(self, settings: PhysicsSettings) -> None:
        """Applies new settings."""
        self._settings = settings
        self.wake_all()

    def add(self, body: int, fixed: bool, joints: Sequence[int], is_robot: bool) -> None:
        """Adds a new body.

        Args:
            body: Number of the body.
            fixed: Whether the root link is fixed to the world.
            joints: Engine indices of the movable joints.
            is_robot: Whether the body is a robot, which never sleeps.
        """
        if is_robot:
            self._sleepless.append(body)
        elif self._settings.rest_speed > 0.0 and fixed and not joints:
            self._never_move.add(body)
            self._change(body, self._api.ACTIVATION_STATE_ENABLE_SLEEPING | self._api.ACTIVATION_STATE_SLEEP)
        elif self._settings.rest_speed > 0.0:
            if joints:
                self._joints[body] = tuple(joints)
            self._woken[body] = self._steps
            self._inside.add(body)
            self._change(body, self._api.ACTIVATION_STATE_ENABLE_SLEEPING)

    def body_id(self, body: int) -> int:
        """Returns the engine's id of a body, which is loaded again if it is stored."""
        if body in self._store.stored:  # a movable body needs the bodies that it touches
            self._bring_back([body] if body in self._never_move else self._store.find(self._store.box(body)))
        return self._store.body_id(body)

    def _bring_back(self, bodies: Collection[int]) -> None:
        self._store.bring_back(bodies)
        self._inside.update(body for body in bodies if body not in self._never_move)
        self._loaded.update(bodies)
        for body in bodies:
            self._change(body, self._api.ACTIVATION_STATE_ENABLE_SLEEPING | self._api.ACTIVATION_STATE_SLEEP)

    def _bring_back_near(self, body: int) -> list[int]:
        """Brings the stored bodies at a body back, and returns them."""
        stored = self._store.stored
        found = self._store.find(self._store.box(body) if body in stored else self._boxes([body])) if stored else []
        self._bring_back(found)
        return found

    def watch(self, body: int) -> None:
        """Keeps a body and its neighbours in the engine, because its contacts are read."""
        if body not in self._watched and body not in self._sleepless:
            self._watched.add(body)
            for near in self._bring_back_near(body):
                self.wake(near)

    def keep_awake(self, body: int) -> None:
        """Prevents a body from sleeping."""
        self.body_id(body)
        if body in self._woken or body in self._never_move:
            if self._woken.pop(body, None) is not None:
                self._sleepless.append(body)
            self._joints.pop(body, None)
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
        self._joints.pop(body, None)
        self._placed.pop(body, None)
        if body in self._sleepless:
            self._sleepless.remove(body)

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
            self._bring_back_near(body)  # the contacts of loaded bodies are unknown until the next step
            points = self._api.getContactPoints(bodyA=self.body_id(body), physicsClientId=self._client)
            for touched in sorted({*self._loaded, *(self._store.number(point[2]) for point in points)}):
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

    @property
    def motionless_bodies(self) -> Collection[int]:
        """Static bodies and stored bodies."""
        return self._never_move | self._store.stored.keys()

    def _update_sleeping(self) -> None:
        """Updates the sleeping bodies; this check detects bodies that the engine has woken by a contact."""
        stored = self._store.stored.keys()
        slept = {body for body in self._inside if self._is_at_rest(body)} | stored
        self._known, self._slept = slept & self._slept, slept
        resting = [*(self._known & self._inside), *(self._never_move - stored)]
        resting = [body for body in resting if self._store.can_store(body)]
        if len(resting) > MAX_ASLEEP:
            self._store_far(sorted(resting))

    def _store_far(self, resting: list[int]) -> None:
        """Stores the bodies that no other body can reach soon."""
        hulls = Boxes.of_corners(self._boxes([body]).hull for body in resting)
        movable = np.array([body not in self._never_move for body in resting], dtype=bool)
        moving = {*self._sleepless, *self._watched, *(self._inside - self._slept)}
        lying = self._inside.difference(resting, moving)  # these bodies keep the static bodies that they touch
        seeds = self._boxes(moving).grown(2.0 * _NEAR_M).joined(self._boxes(lying))
        far = ~hulls.reached_from(seeds, movable)
        chosen = [body for body, is_far in zip(resting, far, strict=True) if is_far]
        if chosen:
            self._store.store(chosen, Boxes(hulls.lower[far], hulls.upper[far]), movable[far])
            self._inside.difference_update(chosen)
            self._expect_motion()

    def before_step(self) -> None:
        """Brings back the stored bodies that a moving body approaches; must be called before every step."""
        steps = self._steps - self._checked
        if not self._store.stored or not (self._may_approach or steps >= _APPROACH_STEPS):
            return
        moving = [*self._sleepless, *(body for body in sorted(self._inside) if not self._is_at_rest(body))]
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
        self._bring_back(list(self._store.stored))
        for body in self._woken:
            self.wake(body)

    def _is_at_rest(self, body: int) -> bool:
        """Returns whether a body sleeps; the velocities of a sleeping body are exactly 0."""
        if body in self._store.stored:
            return True
        if (self._steps - self._woken[body]) * self._settings.time_step_s < _REST_AFTER_S:
            return False
        body_id = self._store.body_id(body)
        linear, angular = self._api.getBaseVelocity(body_id, physicsClientId=self._client)
        if any(linear) or any(angular):
            return False
        joints = self._joints.get(body, ())
        states = self._api.getJointStatesMultiDof(body_id, joints, physicsClientId=self._client) if joints else ()
        return not any(any(state[1]) for state in states)

    def disturb(self, body: int, action: Callable[[], None]) -> None:
        """Wakes a body and applies an action to it; for a sleeping body, the action is repeated after the step."""
        if body in self._woken:
            self.wake(body)
        action()
        if body in self._waking:
            self._lost.append((body, action))

    def after_step(self) -> None:
        """Repeats lost actions, and wakes the bodies in contact with robots and moved joints periodically."""
        self._steps += 1
        for _, action in self._lost:
            action()
        self._waking.clear()
        self._lost.clear()
        self._loaded.clear()
        if self._steps % round(REST_LOOK_S / self._settings.time_step_s) == 0:
            self._update_sleeping()
        if self._steps % round(_WAKE_PERIOD_S / self._settings.time_step_s) == 0:
            for body in (*self._sleepless, *self._moved_by_joints()):
                self.wake_touching(body)

    def _moved_by_joints(self) -> list[int]:
        """Returns the bodies with joints that have moved since the last call, except sleeping bodies."""
        moved = []
        for body, joints in self._joints.items():
            if body in self._slept:
                continue
            body_id = self._store.body_id(body)
            states = self._api.getJointStatesMultiDof(body_id, joints, physicsClientId=self._client)
            base = self._api.getBasePositionAndOrientation(body_id, physicsClientId=self._client)
            placed = np.concatenate([*base, *(state[0] for state in states)])
            before = self._placed.get(body)
            self._placed[body] = placed
            if before is None or np.abs(placed - before).max() > _MOVED:
                moved.append(body)
        return moved
