# SPDX-License-Identifier: BSD-3-Clause
"""Puts constraints into the plain arrays that their compiled loops work on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.constraints.compiled_constraints import (
    BALL,
    BOX,
    CONE,
    CYLINDER,
    EULER_ANGLES,
    HULL,
    POINT,
    ROTATION_VECTOR,
    Conditions,
    Drive,
)
from modular_framework_planning.constraints.constraint_kinds import (
    FrameOnRobot,
    JointConstraint,
    OrientationConstraint,
    Parameterization,
    PositionConstraint,
)
from modular_framework_planning.geometry.regions import (
    BoxSolid,
    ConeSolid,
    CylinderSolid,
    HullSolid,
    Solid,
    SphereSolid,
)
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.chain_model import tree_of
from modular_framework_planning.robot_model.robot_model import RobotModel


def arrays_of(
    model: RobotModel,
    joints: Sequence[JointConstraint],
    positions: Sequence[PositionConstraint],
    orientations: Sequence[OrientationConstraint],
) -> tuple[Conditions, NDArray[np.int64]]:
    """Returns constraints as arrays, and the indices in a position vector of the joints they are about."""
    pairs = [(item.link, item.reference) for item in positions] + [(item.link, item.reference) for item in orientations]
    supports = [[_supports(model, frame) for frame in pair] for pair in pairs]
    numbers = sorted(set[int]().union(*(frame for pair in supports for frame in pair)))
    place = {0: -1, **{number: row for row, number in enumerate(numbers)}}
    tree = tree_of(model, numbers)._replace(
        parents=np.array([place[model.pin_model.parents[number]] for number in numbers], dtype=np.int64)
    )
    solids = [region for item in positions for region in item.regions]
    ends = np.cumsum([0, *(len(item.regions) for item in positions)])
    faces = [solid.faces if isinstance(solid, HullSolid) else np.empty((0, 4)) for solid, _ in solids]
    face_ends = np.cumsum([0, *(len(item) for item in faces)])
    no_region = np.zeros((len(orientations), 2))
    conditions = Conditions(
        tree,
        _matrix([(item.target, item.below, item.above) for item in joints], 3),
        np.array([item.is_continuous for item in joints], dtype=bool),
        np.array([POINT] * len(positions) + [_kind(item) for item in orientations], dtype=np.int64),
        np.array([[place[frame.joint] for frame in pair] for pair in pairs], dtype=np.int64).reshape(-1, 2),
        np.array([*map(_point_placements, positions), *map(_turn_placements, orientations)]).reshape(-1, 2, 3, 4),
        _matrix([[(n in link) - (n in other) for n in numbers] for link, other in supports], len(numbers)),
        _matrix([*([(0.0,) * 3] * len(positions)), *(item.tolerances for item in orientations)], 3),
        np.vstack([np.column_stack([ends[:-1], ends[1:]]), no_region]).astype(np.int64),
        np.array([_shape(solid)[0] for solid, _ in solids], dtype=np.int64),
        _matrix([_shape(solid)[1] for solid, _ in solids], 3),
        np.array([pose.homogeneous[:3] for _, pose in solids]).reshape(-1, 3, 4),
        np.column_stack([face_ends[:-1], face_ends[1:]]).astype(np.int64),
        np.ascontiguousarray(np.vstack([np.empty((0, 4)), *faces])),
    )
    return conditions, np.array([*(number - 1 for number in numbers), *(item.index for item in joints)], dtype=np.int64)


def drive_of(model: RobotModel, columns: NDArray[np.int64], indices: NDArray[np.int64], positions: Array) -> Drive:
    """Returns how joint vectors move the joints that conditions are about.

    Args:
        model: the robot; its mimic joints follow.
        columns: indices in a position vector of the joints that the conditions are about.
        indices: the same of the joint vectors' joints.
        positions: of the whole robot, for all other joints [rad or m].
    """
    place = {int(number): column for column, number in enumerate(indices)}
    followers = {follower: (leader, gain, offset) for follower, leader, gain, offset in model.mimics}
    rows = []
    for index in columns.tolist():
        leader, gain, offset = followers.get(index, (index, 1.0, 0.0))
        rows.append((place[leader], gain, offset) if leader in place else (-1, 1.0, float(positions[index])))
    drivers, gains, offsets = zip(*rows, strict=True) if rows else ((), (), ())
    return Drive(np.array(drivers, dtype=np.int64), np.array(gains, dtype=float), np.array(offsets, dtype=float))


def whole_drive(columns: NDArray[np.int64]) -> Drive:
    """Returns how positions of the whole robot, mimic joints included, move the joints that conditions are about."""
    return Drive(columns, np.ones(len(columns)), np.zeros(len(columns)))


def _matrix(rows: Sequence[Sequence[float] | Array], columns: int) -> Array:
    return np.array(rows, dtype=float).reshape(len(rows), columns)


def _supports(model: RobotModel, frame: FrameOnRobot) -> set[int]:
    return {int(number) for number in model.pin_model.supports[frame.joint] if number > 0}


def _kind(item: OrientationConstraint) -> int:
    return EULER_ANGLES if item.parameterization is Parameterization.XYZ_EULER_ANGLES else ROTATION_VECTOR


def _point_placements(item: PositionConstraint) -> list[Array]:
    link, reference = item.link.placement.homogeneous[:3].copy(), item.reference.placement.homogeneous[:3]
    link[:, 3] = item.link.placement.act(item.offset)
    return [link, reference]


def _turn_placements(item: OrientationConstraint) -> list[Array]:
    link, reference = (frame.placement.homogeneous[:3].copy() for frame in (item.link, item.reference))
    if _kind(item) == EULER_ANGLES:
        reference[:, :3] = reference[:, :3] @ item.target
    else:
        link[:, :3] = link[:, :3] @ item.target.T
    return [link, reference]


def _shape(solid: Solid) -> tuple[int, tuple[float, float, float]]:
    match solid:
        case BoxSolid():
            return BOX, (solid.x, solid.y, solid.z)
        case SphereSolid():
            return BALL, (solid.radius, 0.0, 0.0)
        case CylinderSolid():
            return CYLINDER, (solid.height, solid.radius, 0.0)
        case ConeSolid():
            return CONE, (solid.height, solid.radius, 0.0)
        case HullSolid():
            return HULL, (0.0, 0.0, 0.0)
    raise TypeError(f"{type(solid).__name__} is no region; allowed are boxes, spheres, cylinders, cones and hulls")
