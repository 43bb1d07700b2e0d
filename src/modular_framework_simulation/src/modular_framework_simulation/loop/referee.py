# SPDX-License-Identifier: BSD-3-Clause
"""Records evidence against an episode: requests that changed the world, and motions that physics does not explain.

The referee reads the world in the simulation's process, so no other node can change its records.
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

MAX_UNEXPLAINED_M = 0.01
"""Maximum displacement between two checks beyond the displacement that the velocity explains [m], due to contacts."""
MAX_INTERVENTIONS = 100


@dataclass(frozen=True, slots=True)
class Intervention:
    """A change of the world that is not caused by its physics.

    Attributes:
        number: Index of the intervention since the start of the simulation, from 1.
        time_s: Simulated time [s].
        what: Service or topic that changed the world, or a description of the unexplained motion.
        caller: Name of the calling node; "" if unknown.
    """

    number: int
    time_s: float
    what: str
    caller: str


@dataclass(frozen=True, slots=True)
class _Motion:
    """Centre of mass [m] and speed [m/s] of a model at a simulated time [ns]."""

    centre: Vector3
    speed: float
    time_ns: int


class Referee:
    """Records interventions.

    Args:
        world: The world, read by the loop's thread only.
    """

    def __init__(self, world: PhysicsWorld) -> None:
        self._world = world
        self._lock = threading.Lock()
        self._interventions: deque[Intervention] = deque(maxlen=MAX_INTERVENTIONS)
        self._count = 0
        self._seen: dict[str, _Motion] = {}
        self._seen_ns = self._seen_revision = -1

    @property
    def interventions(self) -> tuple[Intervention, ...]:
        """Returns the latest interventions, at most MAX_INTERVENTIONS."""
        with self._lock:
            return tuple(self._interventions)

    def note(self, what: str, caller: str) -> None:
        """Records an intervention; may be called from any thread."""
        with self._lock:
            self._count += 1
            self._interventions.append(Intervention(self._count, self._world.time_ns * 1e-9, what, caller))

    def look_for_jumps(self) -> None:
        """Records models that moved farther since the last check than their velocity allows; used as a hook.

        Requests that move models are recorded by their services; after such a request, the check restarts.
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
        """Records a jump; the world reports the motion of a sleeping model with a delay of at most REST_LOOK_S."""
        passed_s = min((now.time_ns - before.time_ns) * 1e-9, passed_s + REST_LOOK_S)
        fall = math.hypot(*self._world.gravity) * passed_s
        moved_m = math.dist(now.centre, before.centre)
        if moved_m > (max(now.speed, before.speed) + fall) * passed_s + MAX_UNEXPLAINED_M:
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
