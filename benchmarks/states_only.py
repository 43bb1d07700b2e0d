# SPDX-License-Identifier: BSD-3-Clause
"""A collision checker that looks at single states of a motion, as MoveIt does at its defaults; for comparison.

    PYTHONPATH=benchmarks benchmarks/planning FOLDER --collision-detector states_only/StatesOnly

States are judged as the shipped checker does. What lies between two of them is not seen.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from modular_framework_planning.collision_detection.collision_bodies import Joints
from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.contacts import Contact
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_scene.planning_scene import PlanningScene

SHARE = 0.01
"""Distance of the states as a share of the joint space's extent, both summed over the joints; half a turn, which is the
longest way, is the extent of a joint without limits."""


class StatesOnly(ExactCollisionChecker):
    """See CollisionChecker; the steps that are asked for do not count."""

    def __init__(self, scene: PlanningScene, moving: Joints = None, tolerated: Sequence[Contact] = ()) -> None:
        super().__init__(scene, moving, tolerated)
        chosen = slice(None) if moving is None else moving
        spans = np.where(self.model.continuous, np.pi, self.model.upper - self.model.lower)
        self._spacing = SHARE * float(spans[chosen].sum())

    def path_is_free(self, vertices: Array, step: float, first: int = 0) -> bool:
        return all(super(StatesOnly, self).path_is_free(state[None], 1.0) for state in self._states(vertices, first))

    def colliding_state(self, vertices: Array, step: float) -> Array | None:
        return next((state for state in self._states(vertices, 0) if not self.is_free(state)), None)

    def _states(self, vertices: Array, first: int) -> Iterator[Array]:
        if first == 0:
            yield vertices[0]
        for start, end in zip(vertices[:-1], vertices[1:], strict=True):
            count = max(1, int(np.ceil(np.abs(end - start).sum() / self._spacing)))
            yield from start + np.arange(1, count + 1)[:, None] / count * (end - start)
