# SPDX-License-Identifier: BSD-3-Clause
"""Planar and floating virtual joints: a transform in messages, a chain of single-variable joints in the planner.

The planner works on joints with one variable, so that a moving base needs no special case. The rotation of a floating
joint is stored as yaw, pitch and roll (intrinsic rotations about z, y and x) and converted to a quaternion in messages.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from modular_framework_planning.errors import ModelError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_urdf.srdf_reader import VirtualJoint

PLANAR, FLOATING, FIXED = "planar", "floating", "fixed"
UNBOUNDED_M = 1.0e5  # bound of the base position without a limit [m]
_X, _Y, _Z = "1 0 0", "0 1 0", "0 0 1"
_ROTATION = 2.0 * np.pi
# Name (as in MoveIt except for the rotation of a floating joint), prismatic or not, and axis of each variable.
_VARIABLES = {
    PLANAR: (("x", True, _X), ("y", True, _Y), ("theta", False, _Z)),
    FLOATING: (
        ("trans_x", True, _X),
        ("trans_y", True, _Y),
        ("trans_z", True, _Z),
        ("yaw", False, _Z),
        ("pitch", False, _Y),
        ("roll", False, _X),
    ),
}
QUATERNION_VARIABLES = ("rot_x", "rot_y", "rot_z", "rot_w")  # MoveIt's names for the rotation of a floating joint


@dataclass(frozen=True, slots=True)
class Variable:
    """A joint of the chain.

    Attributes:
        name: Joint name.
        kind: URDF joint type.
        axis: URDF joint axis.
        parent, child: Names of the connected links.
        bound: Position limit on both sides [rad or m].
    """

    name: str
    kind: str
    axis: str
    parent: str
    child: str
    bound: float


@dataclass(frozen=True, slots=True)
class MultiDofJoint(VirtualJoint):
    """A planar or floating virtual joint with its variables."""

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the variables, "joint/variable", in the order of a position vector."""
        return tuple(f"{self.name}/{name}" for name, _, _ in _VARIABLES[self.kind])

    @property
    def translations(self) -> tuple[str, ...]:
        """Names of the translation variables, along x, y (and z) of the parent frame."""
        return tuple(f"{self.name}/{name}" for name, is_prismatic, _ in _VARIABLES[self.kind] if is_prismatic)

    @property
    def angles(self) -> tuple[str, ...]:
        """Names of the rotation variables."""
        return tuple(f"{self.name}/{name}" for name, is_prismatic, _ in _VARIABLES[self.kind] if not is_prismatic)

    @property
    def quaternion(self) -> tuple[str, ...]:
        """Names of the quaternion variables (x, y, z, w) in MoveIt messages; empty for a planar joint."""
        return tuple(f"{self.name}/{name}" for name in QUATERNION_VARIABLES) if self.kind == FLOATING else ()

    def chain(self) -> tuple[Variable, ...]:
        """Returns the single-variable joints of the chain, outermost first."""
        names = self.variables
        parents, children = (self.parent_frame, *names[:-1]), (*names[:-1], self.child_link)
        result = []
        for (short_name, is_prismatic, axis), name, parent, child in zip(
            _VARIABLES[self.kind], names, parents, children, strict=True
        ):
            kind = "prismatic" if is_prismatic else "revolute" if short_name == "pitch" else "continuous"
            bound = UNBOUNDED_M if is_prismatic else 0.5 * np.pi
            result.append(Variable(name, kind, axis, parent, child, bound))
        return tuple(result)

    def values(self, transform: Transform, reference: Array | None = None) -> Array:
        """Returns the values of the variables for a pose of the child link.

        Args:
            transform: Pose of the child link in the parent frame; a planar joint uses only x, y and the rotation about
                z, as in MoveIt.
            reference: Values to which continuous angles are unwrapped.
        """
        rotation, position = np.asarray(transform.rotation), np.asarray(transform.translation)
        if self.kind == PLANAR:
            values = np.array([*position[:2], np.arctan2(rotation[1, 0], rotation[0, 0])])
            angles = [2]
        else:
            values, angles = np.array([*position, *_yaw_pitch_roll(rotation, reference)]), [3, 5]
        if reference is not None:
            for index in angles:
                values[index] += _ROTATION * np.round((reference[index] - values[index]) / _ROTATION)
        return values

    def transform(self, values: Array) -> Transform:
        """Returns the pose of the child link in the parent frame."""
        if self.kind == PLANAR:
            x, y, theta = (float(value) for value in values)
            return pin.SE3(pin.utils.rotate("z", theta), np.array([x, y, 0.0]))
        yaw, pitch, roll = (float(value) for value in values[3:])
        rotation = pin.utils.rotate("z", yaw) @ pin.utils.rotate("y", pitch) @ pin.utils.rotate("x", roll)
        return pin.SE3(rotation, np.array(values[:3], dtype=float))

    def twists(self, values: Array, velocities: Array, accelerations: Array) -> tuple[Array, Array]:
        """Returns the velocity and acceleration of the child link in the parent frame.

        Args:
            values: Values of the variables [rad or m].
            velocities: Velocities of the variables [per s].
            accelerations: Accelerations of the variables [per s^2].

        Returns:
            Two arrays of shape (6,), linear before angular [m/s, rad/s and per s^2].
        """
        if self.kind == PLANAR:
            columns = [0, 1, 5]
            velocity, acceleration = np.zeros(6), np.zeros(6)
            velocity[columns], acceleration[columns] = velocities, accelerations
            return velocity, acceleration
        yaw, pitch = (float(value) for value in values[3:5])
        outer = pin.utils.rotate("z", yaw)
        axes = np.array([[0.0, 0.0, 1.0], outer[:, 1], (outer @ pin.utils.rotate("y", pitch))[:, 0]])
        angular_velocities, angular_acceleration = velocities[3:, None] * axes, accelerations[3:] @ axes
        angular_acceleration = (
            angular_acceleration
            + np.cross(angular_velocities[0], angular_velocities[1])
            + np.cross(angular_velocities[0] + angular_velocities[1], angular_velocities[2])
        )
        return np.append(velocities[:3], angular_velocities.sum(axis=0)), np.append(
            accelerations[:3], angular_acceleration
        )


def _yaw_pitch_roll(rotation: Array, reference: Array | None) -> tuple[float, float, float]:
    """Returns the angles of a rotation; in gimbal lock, the yaw is the reference's yaw or 0."""
    level = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    pitch = float(np.arctan2(-rotation[2, 0], level))
    if level < 1.0e-9:
        yaw = 0.0 if reference is None else float(reference[3])
        remainder = pin.utils.rotate("z", -yaw) @ rotation
        return yaw, pitch, float(np.arctan2(-remainder[1, 2], remainder[1, 1]))
    yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
    return yaw, pitch, float(np.arctan2(rotation[2, 1], rotation[2, 2]))


def multi_dof_joint(
    virtual_joints: Iterable[VirtualJoint], root_link: str, links: Iterable[str]
) -> tuple[MultiDofJoint | None, tuple[str, ...]]:
    """Returns the planar or floating joint of the root link, or None, and notes about ignored virtual joints.

    Args:
        virtual_joints: Virtual joints of the SRDF; as in MoveIt, the first with the root link as child is used.
        root_link: Root link of the URDF.
        links: Links of the URDF.

    Raises:
        ModelError: The joint type is unknown, or the parent frame is a link of the robot.
    """
    notes = []
    for joint in virtual_joints:
        if joint.child_link != root_link:
            notes.append(
                f"SRDF virtual_joint '{joint.name}' is ignored: its child_link '{joint.child_link}' is not the root "
                f"link of the URDF; set it to '{root_link}'"
            )
            continue
        if joint.kind not in (FIXED, *_VARIABLES):
            raise ModelError(
                f"SRDF virtual_joint '{joint.name}': type '{joint.kind}'; allowed: {FIXED}, {PLANAR} and {FLOATING}"
            )
        if joint.kind == FIXED:
            return None, tuple(notes)
        if joint.parent_frame in links or not joint.parent_frame:
            raise ModelError(
                f"SRDF virtual_joint '{joint.name}': parent_frame '{joint.parent_frame}'; the robot moves in this "
                "frame, so it must not be empty or a link of the robot; choose a frame such as world, map or odom"
            )
        return MultiDofJoint(joint.name, joint.kind, joint.parent_frame, joint.child_link), tuple(notes)
    return None, tuple(notes)
