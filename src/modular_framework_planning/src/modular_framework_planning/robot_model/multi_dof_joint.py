# SPDX-License-Identifier: BSD-3-Clause
"""Planar and floating virtual joints: one transform on the wire, a chain of joints with one variable each inside.

Every part of the planner works on joints with one variable, so a base that moves needs no case of its own there. The
rotation of a floating joint is kept as yaw, pitch and roll (turns about the moving z, y and x axes); its quaternion is
read and written at the edge.
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
UNBOUNDED_M = 1.0e5  # [m]; how far a base is taken to be able to go where no limit says less
_X, _Y, _Z = "1 0 0", "0 1 0", "0 0 1"
_TURN = 2.0 * np.pi
# Names of the variables (MoveIt's, but for the floating joint's rotation), whether they slide, and their axes.
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
QUATERNION_VARIABLES = ("rot_x", "rot_y", "rot_z", "rot_w")  # MoveIt's names of a floating joint's rotation


@dataclass(frozen=True, slots=True)
class Variable:
    """One joint of the chain: name, URDF joint type, axis, links it connects, bounds [rad or m]."""

    name: str
    kind: str
    axis: str
    parent: str
    child: str
    bound: float


@dataclass(frozen=True, slots=True)
class MultiDofJoint(VirtualJoint):
    """A planar or floating virtual joint, with the variables that the planner moves."""

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of its variables, "joint/variable", in the order of a position vector."""
        return tuple(f"{self.name}/{name}" for name, _, _ in _VARIABLES[self.kind])

    @property
    def translations(self) -> tuple[str, ...]:
        """Names of its variables that are lengths along x, y (and z) of the parent frame."""
        return tuple(f"{self.name}/{name}" for name, slides, _ in _VARIABLES[self.kind] if slides)

    @property
    def angles(self) -> tuple[str, ...]:
        """Names of its variables that are turns."""
        return tuple(f"{self.name}/{name}" for name, slides, _ in _VARIABLES[self.kind] if not slides)

    @property
    def quaternion(self) -> tuple[str, ...]:
        """Names under which MoveIt's clients give the rotation (x, y, z, w); empty where an angle is enough."""
        return tuple(f"{self.name}/{name}" for name in QUATERNION_VARIABLES) if self.kind == FLOATING else ()

    def chain(self) -> tuple[Variable, ...]:
        """Returns the joints with one variable each that make it, the outermost first."""
        names = self.variables
        parents, children = (self.parent_frame, *names[:-1]), (*names[:-1], self.child_link)
        result = []
        for (short, slides, axis), name, parent, child in zip(
            _VARIABLES[self.kind], names, parents, children, strict=True
        ):
            kind = "prismatic" if slides else "revolute" if short == "pitch" else "continuous"
            bound = UNBOUNDED_M if slides else 0.5 * np.pi
            result.append(Variable(name, kind, axis, parent, child, bound))
        return tuple(result)

    def values(self, transform: Transform, near: Array | None = None) -> Array:
        """Returns the variables' values at a pose of the child link.

        Args:
            transform: of the child link in the parent frame; of a planar joint only x, y and the turn about z count,
                as in MoveIt.
            near: values of the variables; angles without an end are given at the turn nearest to these.
        """
        rotation, position = np.asarray(transform.rotation), np.asarray(transform.translation)
        if self.kind == PLANAR:
            found = np.array([*position[:2], np.arctan2(rotation[1, 0], rotation[0, 0])])
            angles = [2]
        else:
            found, angles = np.array([*position, *_yaw_pitch_roll(rotation, near)]), [3, 5]
        if near is not None:
            for number in angles:
                found[number] += _TURN * np.round((near[number] - found[number]) / _TURN)
        return found

    def transform(self, values: Array) -> Transform:
        """Returns the pose of the child link in the parent frame."""
        if self.kind == PLANAR:
            x, y, theta = (float(value) for value in values)
            return pin.SE3(pin.utils.rotate("z", theta), np.array([x, y, 0.0]))
        yaw, pitch, roll = (float(value) for value in values[3:])
        turn = pin.utils.rotate("z", yaw) @ pin.utils.rotate("y", pitch) @ pin.utils.rotate("x", roll)
        return pin.SE3(turn, np.array(values[:3], dtype=float))

    def twists(self, values: Array, rates: Array, changes: Array) -> tuple[Array, Array]:
        """Returns velocity and acceleration of the child link, in the axes of the parent frame.

        Args:
            values: of the variables [rad or m].
            rates: of these [per s].
            changes: of the rates [per s^2].

        Returns:
            Each of shape (6,): linear, then angular [m/s, rad/s and per s^2].
        """
        if self.kind == PLANAR:
            columns = [0, 1, 5]
            velocity, acceleration = np.zeros(6), np.zeros(6)
            velocity[columns], acceleration[columns] = rates, changes
            return velocity, acceleration
        yaw, pitch = (float(value) for value in values[3:5])
        outer = pin.utils.rotate("z", yaw)
        axes = np.array([[0.0, 0.0, 1.0], outer[:, 1], (outer @ pin.utils.rotate("y", pitch))[:, 0]])
        turning, speeding = rates[3:, None] * axes, changes[3:] @ axes
        speeding = speeding + np.cross(turning[0], turning[1]) + np.cross(turning[0] + turning[1], turning[2])
        return np.append(rates[:3], turning.sum(axis=0)), np.append(changes[:3], speeding)


def _yaw_pitch_roll(rotation: Array, near: Array | None) -> tuple[float, float, float]:
    """Returns the angles of a rotation; where it points straight up or down, the yaw is that of `near`, or 0."""
    level = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    pitch = float(np.arctan2(-rotation[2, 0], level))
    if level < 1.0e-9:
        yaw = 0.0 if near is None else float(near[3])
        rest = pin.utils.rotate("z", -yaw) @ rotation
        return yaw, pitch, float(np.arctan2(-rest[1, 2], rest[1, 1]))
    yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
    return yaw, pitch, float(np.arctan2(rotation[2, 1], rotation[2, 2]))


def multi_dof_joint(
    virtual_joints: Iterable[VirtualJoint], root_link: str, links: Iterable[str]
) -> tuple[MultiDofJoint | None, tuple[str, ...]]:
    """Returns the planar or floating joint above the root link, or None; and notes on virtual joints left out.

    Args:
        virtual_joints: of the SRDF; as in MoveIt the first one whose child is the root link counts.
        root_link: of the URDF.
        links: of the URDF.

    Raises:
        ModelError: the joint's type is unknown, or its parent frame is a link of the robot.
    """
    notes = []
    for joint in virtual_joints:
        if joint.child_link != root_link:
            notes.append(
                f"SRDF virtual_joint '{joint.name}' is ignored: its child_link '{joint.child_link}' is not the root "
                f"link of the URDF, '{root_link}'; name that one"
            )
            continue
        if joint.kind not in (FIXED, *_VARIABLES):
            raise ModelError(
                f"SRDF virtual_joint '{joint.name}': type '{joint.kind}'; allowed are {FIXED}, {PLANAR} and {FLOATING}"
            )
        if joint.kind == FIXED:
            return None, tuple(notes)
        if joint.parent_frame in links or not joint.parent_frame:
            raise ModelError(
                f"SRDF virtual_joint '{joint.name}': parent_frame '{joint.parent_frame}'; the robot moves in that "
                "frame, so it must be named and must not be one of the robot's links (usual are world, map and odom)"
            )
        return MultiDofJoint(joint.name, joint.kind, joint.parent_frame, joint.child_link), tuple(notes)
    return None, tuple(notes)
