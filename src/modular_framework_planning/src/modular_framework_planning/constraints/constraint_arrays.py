# SPDX-License-Identifier: BSD-3-Clause
"""Conversion of constraints to the arrays of the compiled constraint checks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.constraints.compiled_constraints import (
    BOX,
    CONE,
    CYLINDER,
    EULER_ANGLES,
    HULL,
    POINT,
    ROTATION_VECTOR,
    SPHERE,
    ConstraintArrays,
    JointMapping,
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
from modular_framework_planning.kinematics.chain_model import joint_tree
from modular_framework_planning.robot_model.robot_model import RobotModel


def constraint_arrays(
    model: RobotModel,
    joints: Sequence[JointConstraint],
    positions: Sequence[PositionConstraint],
    orientations: Sequence[OrientationConstraint],
) -> tuple[ConstraintArrays, NDArray[np.int64]]:
    """Returns constraints as arrays, and the indices in a position vector of the constrained joints.

    Args:
        model: Robot model.
        joints: Joint constraints.
        positions: Position constraints.
        orientations: Orientation constraints.
    """
    pairs = [(item.link, item.reference) for item in positions] + [(item.link, item.reference) for item in orientations]
    supports = [[_supports(model, frame) for frame in pair] for pair in pairs]
    joint_ids = sorted(set[int]().union(*(frame for pair in supports for frame in pair)))
    rows_by_joint = {0: -1, **{joint_id: row for row, joint_id in enumerate(joint_ids)}}
    tree = joint_tree(model, joint_ids)._replace(
        parents=np.array([rows_by_joint[model.pin_model.parents[joint_id]] for joint_id in joint_ids], dtype=np.int64)
    )
    solids = [region for item in positions for region in item.regions]
    ends = np.cumsum([0, *(len(item.regions) for item in positions)])
    faces = [solid.faces if isinstance(solid, HullSolid) else np.empty((0, 4)) for solid, _ in solids]
    face_ends = np.cumsum([0, *(len(item) for item in faces)])
    no_region = np.zeros((len(orientations), 2))
    constraints = ConstraintArrays(
        tree=tree,
        ranges=_matrix([(item.target, item.below, item.above) for item in joints], 3),
        is_continuous=np.array([item.is_continuous for item in joints], dtype=bool),
        kinds=np.array([POINT] * len(positions) + [_orientation_kind(item) for item in orientations], dtype=np.int64),
        frames=np.array([[rows_by_joint[frame.joint] for frame in pair] for pair in pairs], dtype=np.int64).reshape(
            -1, 2
        ),
        placements=np.array([*map(_point_placements, positions), *map(_rotation_placements, orientations)]).reshape(
            -1, 2, 3, 4
        ),
        signs=_matrix([[(n in link) - (n in other) for n in joint_ids] for link, other in supports], len(joint_ids)),
        tolerances=_matrix([*([(0.0,) * 3] * len(positions)), *(item.tolerances for item in orientations)], 3),
        regions=np.vstack([np.column_stack([ends[:-1], ends[1:]]), no_region]).astype(np.int64),
        shapes=np.array([_shape(solid)[0] for solid, _ in solids], dtype=np.int64),
        sizes=_matrix([_shape(solid)[1] for solid, _ in solids], 3),
        poses=np.array([pose.homogeneous[:3] for _, pose in solids]).reshape(-1, 3, 4),
        face_ranges=np.column_stack([face_ends[:-1], face_ends[1:]]).astype(np.int64),
        faces=np.ascontiguousarray(np.vstack([np.empty((0, 4)), *faces])),
    )
    return constraints, np.array(
        [*(joint_id - 1 for joint_id in joint_ids), *(item.index for item in joints)], dtype=np.int64
    )


def joint_mapping(
    model: RobotModel, columns: NDArray[np.int64], indices: NDArray[np.int64], positions: Array
) -> JointMapping:
    """Returns the mapping of joint vectors to constrained joints, including mimic joints.

    Args:
        model: Robot model.
        columns: Indices of the constrained joints in a position vector.
        indices: Indices of the joint vectors' joints in a position vector.
        positions: Positions of the whole robot, for all other joints [rad or m].
    """
    rows_by_joint = {int(joint_id): column for column, joint_id in enumerate(indices)}
    followers = {follower: (leader, gain, offset) for follower, leader, gain, offset in model.mimics}
    mappings = []
    for index in columns.tolist():
        leader, gain, offset = followers.get(index, (index, 1.0, 0.0))
        mappings.append(
            (rows_by_joint[leader], gain, offset) if leader in rows_by_joint else (-1, 1.0, float(positions[index]))
        )
    drivers, gains, offsets = zip(*mappings, strict=True) if mappings else ((), (), ())
    return JointMapping(np.array(drivers, dtype=np.int64), np.array(gains, dtype=float), np.array(offsets, dtype=float))


def full_joint_mapping(columns: NDArray[np.int64]) -> JointMapping:
    """Returns the mapping of positions of the whole robot, including mimic joints, to constrained joints."""
    return JointMapping(columns, np.ones(len(columns)), np.zeros(len(columns)))


def _matrix(mappings: Sequence[Sequence[float] | Array], columns: int) -> Array:
    return np.array(mappings, dtype=float).reshape(len(mappings), columns)


def _supports(model: RobotModel, frame: FrameOnRobot) -> set[int]:
    return {int(joint_id) for joint_id in model.pin_model.supports[frame.joint] if joint_id > 0}


def _orientation_kind(item: OrientationConstraint) -> int:
    return EULER_ANGLES if item.parameterization is Parameterization.XYZ_EULER_ANGLES else ROTATION_VECTOR


def _point_placements(item: PositionConstraint) -> list[Array]:
    link, reference = item.link.placement.homogeneous[:3].copy(), item.reference.placement.homogeneous[:3]
    link[:, 3] = item.link.placement.act(item.offset)
    return [link, reference]


def _rotation_placements(item: OrientationConstraint) -> list[Array]:
    link, reference = (frame.placement.homogeneous[:3].copy() for frame in (item.link, item.reference))
    if _orientation_kind(item) == EULER_ANGLES:
        reference[:, :3] = reference[:, :3] @ item.target
    else:
        link[:, :3] = link[:, :3] @ item.target.T
    return [link, reference]


def _shape(solid: Solid) -> tuple[int, tuple[float, float, float]]:
    match solid:
        case BoxSolid():
            return BOX, (solid.x, solid.y, solid.z)
        case SphereSolid():
            return SPHERE, (solid.radius, 0.0, 0.0)
        case CylinderSolid():
            return CYLINDER, (solid.height, solid.radius, 0.0)
        case ConeSolid():
            return CONE, (solid.height, solid.radius, 0.0)
        case HullSolid():
            return HULL, (0.0, 0.0, 0.0)
    raise TypeError(f"{type(solid).__name__} is not a region; allowed: boxes, spheres, cylinders, cones and hulls")
