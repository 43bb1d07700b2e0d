# SPDX-License-Identifier: BSD-3-Clause
"""Keeps what an episode is judged by: the requests that changed the world, and motions that no physics explains.

It reads the world in the simulation's own process, so no other node can write what it says.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from modular_framework_simulation.physics.physics_engine import REST_LOOK_S
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_urdf.rotations import Vector3

JUMP_M = 0.01
"""Distance between two looks that contacts may add to what the velocity explains [m]."""
KEPT_INTERVENTIONS = 100


@dataclass(frozen=True, slots=True)
class Intervention:
    """A change of the world that is not due to its physics.

    Attributes:
        number: Counts all interventions since the simulation started, from 1.
        time_s: Simulated time [s].
        what: Service or topic that changed the world, or the motion that no velocity explains.
        caller: Name that the calling node gave; "" where none is known.
    """

    number: int
    time_s: float
    what: str
    caller: str


@dataclass(frozen=True, slots=True)
class _Motion:
    """Centre of mass [m] and speed [m/s] of a model, and when it had them [ns]."""

    centre: Vector3
    speed: float
    time_ns: int


class Referee:
    """Notes interventions.

    Args:
        world: Read by the loop's thread only.
    """

    def __init__(self, world: PhysicsWorld) -> None:
        self._world = world
        self._lock = threading.Lock()
        self._interventions: deque[Intervention] = deque(maxlen=KEPT_INTERVENTIONS)
        self._count = 0
        self._seen: dict[str, _Motion] = {}
        self._seen_ns = self._seen_revision = -1

    @property
    def interventions(self) -> tuple[Intervention, ...]:
        """The latest interventions, at most KEPT_INTERVENTIONS."""
        with self._lock:
            return tuple(self._interventions)

    def note(self, what: str, caller: str) -> None:
        """Notes an intervention; any thread may do it."""
        with self._lock:
            self._count += 1
            self._interventions.append(Intervention(self._count, self._world.time_ns * 1e-9, what, caller))

    def look(self) -> None:
        """Notes models that moved farther since the last look than their velocity allows; a hook.

        After a request that moved models, which is noted by its service, the look begins again.
        """
        world, passed_s = self._world, (self._world.time_ns - self._seen_ns) * 1e-9
        same_world = world.revision == self._seen_revision and passed_s > 0.0
        self._seen_ns, self._seen_revision = world.time_ns, world.revision
        if not same_world:
            self._seen = self._motions(world.bodies)
            return
        moving = self._motions(sorted(world.moving()))
        for name, now in moving.items():
            self._judge(name, self._seen[name], now, passed_s)
        self._seen |= moving

    def _judge(self, name: str, before: _Motion, now: _Motion, passed_s: float) -> None:
        """Notes a jump; a model that was at rest moves for at most REST_LOOK_S before the world says so."""
        passed_s = min((now.time_ns - before.time_ns) * 1e-9, passed_s + REST_LOOK_S)
        fall = math.hypot(*self._world.gravity) * passed_s
        moved_m = math.dist(now.centre, before.centre)
        if moved_m > (max(now.speed, before.speed) + fall) * passed_s + JUMP_M:
            speed = f"{before.speed:.2f} m/s before and {now.speed:.2f} m/s after"
            self.note(f"a jump of '{name}' by {moved_m:.3f} m in {passed_s:.3f} s, at {speed}", "")

    def _motions(self, names: Iterable[str]) -> dict[str, _Motion]:
        world, found = self._world, {}
        for name in names:
            body = world.bodies[name]
            if body.spec is not None and not body.static:
                speed = math.hypot(*world.engine.base_twist(body.number)[0])
                found[name] = _Motion(world.engine.base_centre(body.number).position, speed, world.time_ns)
        return found
