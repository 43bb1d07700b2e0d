# SPDX-License-Identifier: BSD-3-Clause
"""Puts the bodies of a scene and the pairs to check into the arrays that compiled collision checks work on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.body_arrays import (
    scene_bodies,
)
from modular_framework_planning.collision_detection.collision_bodies import PlacedGeometry, WatchedPairs
from modular_framework_planning.collision_detection.kernels.compiled_collision import (
    CHECK_COUNTS,
    World,
    arguments,
)
from modular_framework_planning.collision_detection.kernels.compiled_distance_field import KEPT, DistanceField
from modular_framework_planning.collision_detection.pair_arrays import Represented, pair_arrays
from modular_framework_planning.collision_detection.reaches import farthest_end
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.chain_model import whole_tree
from modular_framework_planning.robot_model.robot_model import RobotModel

FIELD_CELLS = 64  # of the field along each axis
FIELD_REACH_M = 2.5  # from the origin of the planning frame to the sides of the field at most


@dataclass(frozen=True, slots=True, eq=False)
class CompiledWorld:
    """The arrays of a scene.

    Attributes:
        arguments: the world as compiled functions take it.
        members: for every pair of the arrays, the watched pairs (by number) that it represents.
        uncompiled: watched pairs that have no bounding geometry and need the exact check at every state.
    """

    world: World
    arguments: tuple[NDArray[Any], ...]
    members: Represented
    uncompiled: tuple[int, ...]


def _never_interrupt() -> None:
    """Never interrupts."""


def compile_world(
    model: RobotModel,
    parts: Sequence[PlacedGeometry],
    pairs: WatchedPairs,
    check_interrupt: Callable[[], None] = _never_interrupt,
) -> CompiledWorld:
    """Builds the arrays; what is built for a shape is cached as long as the shape exists.

    Args:
        model: the robot.
        parts: geometries of the scene, the model's links first.
        pairs: the pairs to watch; those that no joint moves should not be among them.
        check_interrupt: called between shapes; raises an exception to stop.
    """
    bodies = scene_bodies(model, parts, pairs, check_interrupt)
    tree, arrays, joined = whole_tree(model), bodies.arrays, pair_arrays(model, bodies, pairs)
    reach = min(farthest_end(tree, arrays), FIELD_REACH_M)
    field = _field(arrays.kinds[joined.solids], arrays.sizes[joined.solids], arrays.poses[joined.solids], reach)
    world = World(
        tree=tree,
        joints=arrays.joints,
        poses=arrays.poses,
        roots=arrays.roots,
        is_environment=arrays.is_environment,
        kinds=arrays.kinds,
        sizes=arrays.sizes,
        spheres=arrays.spheres,
        closed=arrays.closed,
        robot=bodies.robot,
        scene=bodies.scene,
        pairs=joined.pairs,
        margins=joined.margins,
        excess=joined.excess,
        tables=joined.tables,
        table_joints=joined.table_joints,
        table_of=joined.table_of,
        watched=joined.watched,
        represented=joined.represented,
        counts=np.zeros(CHECK_COUNTS, dtype=np.int64),
        refusals=np.zeros(len(joined.pairs), dtype=np.int64),
        meets=joined.meets,
        field=field,
    )
    return CompiledWorld(world, arguments(world), joined.members, joined.uncompiled)


def _field(kinds: NDArray[np.int64], sizes: Array, poses: Array, reach: float) -> DistanceField:
    """Returns an empty field, `reach` [m] to every side of the origin of the planning frame."""
    cells = (FIELD_CELLS if len(kinds) else 0,) * 3
    kept = min(len(kinds), KEPT)
    return DistanceField(
        kinds,
        sizes,
        poses,
        np.array([-reach, -reach, -reach, 2.0 * reach / FIELD_CELLS]),
        np.zeros(cells, dtype=bool),
        np.empty((*cells, kept), dtype=np.int32),
        np.empty((*cells, kept)),
    )
