# SPDX-License-Identifier: BSD-3-Clause
"""Reader for moveit_msgs/Constraints; invalid constraints are errors and never replaced by guesses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from moveit_msgs.msg import ConstraintEvalResult, Constraints
from shape_msgs.msg import SolidPrimitive

from modular_framework_planning.constraints.constraint_kinds import (
    ConstraintResult,
    FrameOnRobot,
    JointConstraint,
    OrientationConstraint,
    Parameterization,
    PositionConstraint,
)
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.constraints.robot_frames import frame_on_robot, require_holding_link
from modular_framework_planning.errors import ErrorCode, GeometryError, PlanningError, UnknownNameError
from modular_framework_planning.geometry.regions import (
    BoxSolid,
    ConeSolid,
    CylinderSolid,
    HullSolid,
    Solid,
    SphereSolid,
)
from modular_framework_planning.geometry.spatial import IDENTITY_XYZW, Transform, make_transform, quaternion_or_identity
from modular_framework_planning.messages.multi_dof import with_angles
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import GOAL_BOUNDS_TOLERANCE

PRIMITIVES: dict[int, tuple[Callable[..., Solid], int]] = {
    SolidPrimitive.BOX: (BoxSolid, 3),
    SolidPrimitive.SPHERE: (SphereSolid, 1),
    SolidPrimitive.CYLINDER: (CylinderSolid, 2),
    SolidPrimitive.CONE: (ConeSolid, 2),
}


def constraints_from_message(
    scene: PlanningScene,
    message: Any,
    field_name: str,
    code: ErrorCode = ErrorCode.INVALID_GOAL_CONSTRAINTS,
    tip: str = "",
) -> KinematicConstraints:
    """Reads a Constraints message.

    Args:
        scene: Scene with the poses of frames; frames on the robot move with the robot.
        message: moveit_msgs/Constraints.
        field_name: Name of the message field, for error messages.
        code: Error code for invalid constraints.
        tip: Link for constraints without a link_name.

    Raises:
        PlanningError: A visibility constraint, unknown name, non-finite number, negative tolerance, zero quaternion or
            empty region.
    """
    if message.visibility_constraints:
        raise PlanningError(
            code,
            f"{field_name}: {len(message.visibility_constraints)} visibility constraints, which are "
            "not supported; use joint, position or orientation constraints",
        )
    reader = _Reader(scene, code, tip)
    return KinematicConstraints(
        scene.model,
        [
            reader.joint(item, f"{field_name}.joint_constraints[{n}]")
            for n, item in enumerate(with_angles(scene, message.joint_constraints, field_name, code))
        ],
        [
            reader.position(item, f"{field_name}.position_constraints[{n}]")
            for n, item in enumerate(message.position_constraints)
        ],
        [
            reader.orientation(item, f"{field_name}.orientation_constraints[{n}]")
            for n, item in enumerate(message.orientation_constraints)
        ],
        message.name,
    )


def evaluated_one_by_one(
    scene: PlanningScene, message: Any, field_name: str, tip: str
) -> tuple[list[ConstraintResult], list[str]]:
    """Evaluates each constraint at the scene's state; an invalid constraint counts as violated at infinite distance.

    Args:
        scene: Scene with the state.
        message: moveit_msgs/Constraints.
        field_name: Name of the message field, for error messages.
        tip: Link for constraints without a link_name.

    Returns:
        The results in the order of `KinematicConstraints.evaluate`, visibility constraints last, and a message for each
        invalid constraint.
    """
    results, faults = [], []
    for kind in ("joint", "position", "orientation", "visibility"):
        for index, item in enumerate(getattr(message, f"{kind}_constraints")):
            source = f"{field_name}.{kind}_constraints[{index}]"
            try:
                alone = constraints_from_message(
                    scene, Constraints(**{f"{kind}_constraints": [item]}), field_name, tip=tip
                )
                results += alone.evaluate(scene.positions)
            except PlanningError as error:
                reason = error.reason.replace(f"{field_name}.{kind}_constraints[0]", source)
                faults.append(reason if source in reason else f"{source}: {reason}")
                name = getattr(item, f"{'joint' if kind == 'joint' else 'link'}_name", "")
                results.append(ConstraintResult(kind, name, False, np.inf, faults[-1]))
    return results, faults


def result_messages(results: Sequence[ConstraintResult]) -> list[ConstraintEvalResult]:
    """Returns one message per constraint, in the order of the results."""
    return [ConstraintEvalResult(result=item.satisfied, distance=item.distance) for item in results]


class _Reader:
    """Reads the constraints of one message."""

    def __init__(self, scene: PlanningScene, code: ErrorCode, tip: str) -> None:
        self._scene, self._code, self._tip = scene, code, tip

    def _finite(self, field_name: str, **values: float) -> None:
        bad = {name: value for name, value in values.items() if not np.isfinite(value)}
        if bad:
            raise PlanningError(self._code, f"{field_name}: {bad}; every number must be finite")

    def _tolerance(self, field_name: str, name: str, value: float) -> float:
        if not value >= 0.0:
            raise PlanningError(self._code, f"{field_name}: {name} is {value}; give a number of at least 0")
        return float(value)

    def _weight(self, field_name: str, value: float) -> float:
        self._finite(field_name, weight=value)
        return float(value) if value > np.finfo(float).eps else 1.0  # as in MoveIt, an unset weight counts as 1

    def joint(self, message: Any, field_name: str) -> JointConstraint:
        """Reads a JointConstraint."""
        model = self._scene.model
        if message.joint_name not in model.index:
            raise UnknownNameError(self._code, f"{field_name}: joint", message.joint_name, model.joint_names)
        self._finite(field_name, position=message.position)
        index = model.index[message.joint_name]
        target = min(max(message.position, model.lower[index]), model.upper[index])
        if abs(target - message.position) > GOAL_BOUNDS_TOLERANCE:
            target = message.position  # callers report that this constraint cannot be satisfied
        return JointConstraint(
            message.joint_name,
            index,
            float(target),
            self._tolerance(field_name, "tolerance_below", message.tolerance_below),
            self._tolerance(field_name, "tolerance_above", message.tolerance_above),
            is_continuous=model.is_continuous(index),
            weight=self._weight(field_name, message.weight),
        )

    def _link(self, name: str, field_name: str) -> FrameOnRobot:
        name = (name or self._tip).removeprefix("/")
        require_holding_link(self._scene, name, f"{field_name}: link")
        return frame_on_robot(self._scene, name)

    def position(self, message: Any, field_name: str) -> PositionConstraint:
        """Reads a PositionConstraint."""
        offset = message.target_point_offset
        self._finite(f"{field_name}: target_point_offset", x=offset.x, y=offset.y, z=offset.z)
        return PositionConstraint(
            self._link(message.link_name, field_name),
            np.array([offset.x, offset.y, offset.z]),
            frame_on_robot(self._scene, message.header.frame_id),
            self._regions(message.constraint_region, f"{field_name}: constraint_region"),
            self._weight(field_name, message.weight),
        )

    def _regions(self, volume: Any, field_name: str) -> tuple[tuple[Solid, Transform], ...]:
        regions = []
        for kind, shapes, poses in (
            ("primitive", volume.primitives, volume.primitive_poses),
            ("mesh", volume.meshes, volume.mesh_poses),
        ):
            if len(shapes) != len(poses):
                raise PlanningError(
                    self._code,
                    f"{field_name}: {len(shapes)} {kind} shapes and {len(poses)} poses; give one pose per shape",
                )
            for index, (shape, pose) in enumerate(zip(shapes, poses, strict=True)):
                source = f"{field_name} {kind} {index}"
                regions.append((self._solid(shape, source), self._region_pose(shape, pose, source)))
        if not regions:
            raise PlanningError(self._code, f"{field_name} is empty; give at least one primitive or mesh with its pose")
        return tuple(regions)

    def _region_pose(self, shape: Any, pose: Any, field_name: str) -> Transform:
        """Reads a region's pose; as in MoveIt, an unset rotation is the identity (without warning for spheres)."""
        p, q = pose.position, pose.orientation
        rotation = (q.x, q.y, q.z, q.w)
        is_sphere = getattr(shape, "type", 0) == SolidPrimitive.SPHERE
        try:
            return make_transform(
                (p.x, p.y, p.z),
                IDENTITY_XYZW if is_sphere and not any(rotation) else quaternion_or_identity(rotation, field_name),
                field_name,
            )
        except GeometryError as error:
            raise PlanningError(self._code, error.reason) from error

    def _solid(self, shape: Any, field_name: str) -> Solid:
        try:
            if hasattr(shape, "vertices"):
                return HullSolid(np.array([(p.x, p.y, p.z) for p in shape.vertices], dtype=float))
            if shape.type not in PRIMITIVES:
                raise GeometryError(f"type {shape.type}; allowed types: 1 box, 2 sphere, 3 cylinder, 4 cone")
            build, count = PRIMITIVES[shape.type]
            if len(shape.dimensions) < count:
                raise GeometryError(f"type {shape.type} with {len(shape.dimensions)} dimensions; give {count}")
            return build(*(float(value) for value in shape.dimensions[:count]))
        except GeometryError as error:
            raise PlanningError(self._code, f"{field_name}: {error.reason}") from error

    def orientation(self, message: Any, field_name: str) -> OrientationConstraint:
        """Reads an OrientationConstraint."""
        q = message.orientation
        try:
            quaternion = quaternion_or_identity((q.x, q.y, q.z, q.w), f"{field_name}: orientation")
            target = make_transform((0.0, 0.0, 0.0), quaternion, f"{field_name}: orientation").rotation
        except GeometryError as error:
            raise PlanningError(self._code, error.reason) from error
        known = {item.value: item for item in Parameterization}
        if message.parameterization not in known:
            raise PlanningError(
                self._code,
                f"{field_name}: parameterization {message.parameterization}; allowed values: "
                + ", ".join(f"{item.value} {item.name}" for item in Parameterization),
            )
        tolerances = [
            self._tolerance(field_name, name, abs(getattr(message, name)))
            for name in ("absolute_x_axis_tolerance", "absolute_y_axis_tolerance", "absolute_z_axis_tolerance")
        ]
        return OrientationConstraint(
            self._link(message.link_name, field_name),
            frame_on_robot(self._scene, message.header.frame_id),
            target,
            np.minimum(tolerances, 2.0 * np.pi),
            known[message.parameterization],
            self._weight(field_name, message.weight),
        )
