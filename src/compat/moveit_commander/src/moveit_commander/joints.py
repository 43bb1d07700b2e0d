# SPDX-License-Identifier: BSD-3-Clause
"""Joint of the robot model, from the URDF, the SRDF's virtual joint and joint_limits.yaml."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Any

from modular_framework_urdf import robot as urdf_robot
from modular_framework_urdf.joint_limits import (
    DEFAULT_ACCELERATION,
    DEFAULT_VELOCITY,
    JointLimits,
    described_limits,
    overwritten,
)
from modular_framework_urdf.mimics import Mimic
from modular_framework_urdf.robot import MOVABLE_KINDS, Vector
from modular_framework_urdf.srdf_reader import VirtualJoint
from moveit_commander.exception import RobotModelError

ASSUMED_ROOT_JOINT = "ASSUMED_FIXED_ROOT_JOINT"
NO_MIMIC = Mimic("", 1.0, 0.0)
QUATERNION_W = "rot_w"


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint with bounds [rad or m], origin [m, rad] in the parent link, and axis in the joint frame.

    A planar or floating joint has `parts`, one joint per variable named "joint/variable". `neutral` is the initial
    position.
    """

    name: str
    kind: str
    parent: str
    child: str
    _: KW_ONLY
    lower: float = 0.0
    upper: float = 0.0
    velocity: float = 1.0
    acceleration: float = 1.0
    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (1.0, 0.0, 0.0)
    leader: str = ""
    multiplier: float = 1.0
    offset: float = 0.0
    parts: tuple[Joint, ...] = ()
    neutral: float = 0.0

    @property
    def variables(self) -> tuple[Joint, ...]:
        """Returns the variables: the parts of a planar or floating joint, the joint if movable, or nothing."""
        return self.parts or ((self,) if self.is_movable else ())

    @property
    def is_movable(self) -> bool:
        return self.kind in MOVABLE_KINDS

    @property
    def active(self) -> bool:
        """Whether the joint moves independently: neither fixed nor mimic."""
        return bool(self.parts) or (self.is_movable and not self.leader)

    @property
    def default(self) -> float:
        """The neutral position, or the middle of the bounds if the neutral position is outside."""
        return self.neutral if self.lower <= self.neutral <= self.upper else (self.lower + self.upper) / 2.0

    def admits(self, value: float, tolerance: float = 0.0) -> bool:
        """Returns whether a position is within the bounds; any finite position of a continuous joint is."""
        if not math.isfinite(value):
            return False
        return self.kind == "continuous" or self.lower - tolerance <= value <= self.upper + tolerance

    def bounded(self, value: float) -> float:
        """Returns the position wrapped to (-pi, pi] or clipped to the bounds."""
        if self.kind == "continuous":
            return math.remainder(value, 2.0 * math.pi)
        return min(max(value, self.lower), self.upper)


def root_joint(virtual: VirtualJoint | None, root_link: str, limits: Mapping[str, Any]) -> Joint:
    """Returns the joint above the root link: the SRDF's virtual joint with limits, or a fixed joint.

    Args:
        virtual: Virtual joint of the SRDF, or None.
        root_link: Root link of the robot.
        limits: Entries of joint_limits.yaml, keyed by joint.
    """
    if virtual is None:
        return Joint(ASSUMED_ROOT_JOINT, "fixed", "", root_link)
    parts = tuple(_part(virtual, name, limits) for name in virtual.variables)
    return Joint(virtual.name, virtual.kind if parts else "fixed", virtual.parent_frame, root_link, parts=parts)


def _part(joint: VirtualJoint, name: str, limits: Mapping[str, Any]) -> Joint:
    """Returns a variable of a virtual joint, with the limits of joint_limits.yaml or else MoveIt's limits."""
    variable = name.rpartition("/")[2]
    bound = math.pi if variable == "theta" else 1.0 if variable.startswith("rot_") else math.inf
    joint_limits = limits.get(joint.name) or {}  # the parameter server splits "joint/variable" at the slash
    entry = limits.get(name) or (joint_limits.get(variable) if isinstance(joint_limits, Mapping) else None) or {}
    default = JointLimits(-bound, bound, DEFAULT_VELOCITY, DEFAULT_ACCELERATION)
    try:
        found, _ = overwritten(name, default, entry)
    except (ValueError, TypeError, AttributeError) as error:
        raise RobotModelError(f"virtual joint '{joint.name}', entry in joint_limits.yaml: {error}") from error
    return Joint(
        name,
        "continuous" if variable == "theta" and not entry.get("has_position_limits", False) else "prismatic",
        joint.parent_frame,
        joint.child_link,
        lower=found.lower,
        upper=found.upper,
        velocity=found.velocity,
        acceleration=found.acceleration,
        neutral=1.0 if variable == QUATERNION_W else 0.0,
    )


def is_quaternion(variable: Joint) -> bool:
    """Returns whether a variable is a quaternion component of a floating joint."""
    return variable.name.rpartition("/")[2].startswith("rot_")


def joint_of(joint: urdf_robot.Joint, limits: Mapping[str, Any]) -> Joint:
    """Returns a joint of the URDF with its limits; raises RobotModelError for invalid numbers."""
    try:
        return _with_limits(joint, limits.get(joint.name) or {})
    except (ValueError, TypeError, AttributeError) as error:
        raise RobotModelError(
            f"URDF joint '{joint.name}' or its entry in joint_limits.yaml: {error}; numbers and the "
            "elements parent and child are needed"
        ) from error


def _with_limits(joint: urdf_robot.Joint, entry: Mapping[str, Any]) -> Joint:
    """Returns a joint with the limits of the description, overridden by its entry in joint_limits.yaml."""
    is_endless = joint.kind == "continuous"
    limits, _ = overwritten(joint.name, described_limits(joint), entry, is_endless)
    lower, upper = (-math.pi, math.pi) if is_endless else (limits.lower, limits.upper)
    mimic = joint.mimic or NO_MIMIC
    return Joint(
        joint.name,
        joint.kind,
        joint.parent,
        joint.child,
        lower=lower,
        upper=upper,
        velocity=limits.velocity,
        acceleration=limits.acceleration,
        xyz=joint.origin.xyz,
        rpy=joint.origin.rpy,
        axis=joint.axis,
        leader=mimic.leader,
        multiplier=mimic.multiplier,
        offset=mimic.offset,
    )
