# SPDX-License-Identifier: BSD-3-Clause
"""Arrays of a scene's bodies and watched pairs for the compiled collision checks."""

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
from modular_framework_planning.collision_detection.pair_arrays import PairMembers, pair_arrays
from modular_framework_planning.kinematics.chain_model import whole_tree
from modular_framework_planning.robot_model.robot_model import RobotModel


@dataclass(frozen=True, slots=True, eq=False)
class CompiledWorld:
    """The arrays of a scene.

    Attributes:
        world: Bodies and pairs.
        arguments: Arrays of the world, as arguments for compiled functions.
        members: Indices of the watched pairs that each pair of the arrays represents.
        uncompiled: Indices of watched pairs without bounding geometry, which need the exact check at every state.
    """

    world: World
    arguments: tuple[NDArray[Any], ...]
    members: PairMembers
    uncompiled: tuple[int, ...]


def _never_interrupt() -> None:
    """Never interrupts."""


def compile_world(
    model: RobotModel,
    parts: Sequence[PlacedGeometry],
    pairs: WatchedPairs,
    check_interrupt: Callable[[], None] = _never_interrupt,
) -> CompiledWorld:
    """Builds the arrays of a scene; results are cached per shape for the shape's lifetime.

    Args:
        model: Robot model.
        parts: Geometries of the scene, the model's links first.
        pairs: Watched pairs, without fixed pairs.
        check_interrupt: Function called between shapes; raises an exception to stop.
    """
    bodies = scene_bodies(model, parts, pairs, check_interrupt)
    arrays, joined = bodies.arrays, pair_arrays(model, bodies, pairs)
    world = World(
        tree=whole_tree(model),
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
        counts=np.zeros(CHECK_COUNTS, dtype=np.int64),
        refusals=np.zeros(len(joined.pairs), dtype=np.int64),
        common_joints=joined.common_joints,
    )
    return CompiledWorld(world, arguments(world), joined.members, joined.uncompiled)
