# SPDX-License-Identifier: BSD-3-Clause
"""Selects the independent joints of a robot with their limits, and the mimic joints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from modular_framework_urdf.mimics import Mimic, resolve_mimics
from modular_framework_urdf.robot import Joint, Robot

DECIMALS = 3
"""Decimals of displayed positions."""


@dataclass(frozen=True, slots=True)
class SliderSettings:
    """Parameters of the public joint_state_publisher for reading a robot description.

    Attributes:
        use_mimic_tags: Whether <mimic> joints follow their leaders; otherwise they are independent.
        use_smallest_joint_limits: Whether the soft limits of a <safety_controller> narrow the range.
        zeros: Zero positions, by joint name [rad or m].
        dependent_joints: Additional mimic joints, by joint name.
    """

    use_mimic_tags: bool = True
    use_smallest_joint_limits: bool = True
    zeros: Mapping[str, float] = field(default_factory=dict)
    dependent_joints: Mapping[str, Mimic] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class SliderJoint:
    """Independent joint.

    Attributes:
        name: Joint name.
        lower: Minimum position [rad or m].
        upper: Maximum position [rad or m].
        zero: Position at startup and after `Center` [rad or m].
        unit: Unit of positions, "rad" or "m".
        continuous: Whether the joint is continuous, so that positions 2 pi apart are equal.
    """

    name: str
    lower: float
    upper: float
    zero: float
    unit: str
    continuous: bool

    @property
    def has_range(self) -> bool:
        """Whether the joint can move."""
        return self.upper > self.lower

    @property
    def range_text(self) -> str:
        """Text of the limits for the tooltip."""
        limits = f"{self.lower:.{DECIMALS}f} to {self.upper:.{DECIMALS}f} {self.unit}"
        return f"{limits}, continuous" if self.continuous else limits

    def shown_position(self, position: float) -> float:
        """Returns the position clamped to the limits; a position of a continuous joint is wrapped to -pi..pi."""
        if self.continuous and not self.lower <= position <= self.upper:
            position = math.remainder(position, math.tau)
        return min(max(position, self.lower), self.upper)


@dataclass(frozen=True, slots=True)
class SliderJoints:
    """Independent joints and mimic joints of a robot.

    Attributes:
        names: Names of all movable joints, in the order of the description.
        free: Independent joints, by name.
        following: Relations of the mimic joints to their leaders, by name.
        warnings: Ignored parts of the settings or the description, with the reason.
    """

    names: tuple[str, ...]
    free: Mapping[str, SliderJoint]
    following: Mapping[str, Mimic]
    warnings: tuple[str, ...]


def slider_joints(robot: Robot, settings: SliderSettings) -> SliderJoints:
    """Returns the joints of a robot.

    Args:
        robot: Robot description.
        settings: Settings for reading the description.

    Raises:
        ValueError: A range is empty, or a joint mimics itself or a joint that is not movable.
    """
    movable = {joint.name: joint for joint in robot.movable_joints()}
    warnings = [
        f"parameter {parameter}: there is no movable joint '{name}'; allowed: {', '.join(movable) or 'none'}"
        for parameter, names in (("zeros", settings.zeros), ("dependent_joints", settings.dependent_joints))
        for name in names
        if name not in movable
    ]
    mimics = {name: mimic for name, mimic in settings.dependent_joints.items() if name in movable}
    if settings.use_mimic_tags:
        mimics |= {name: joint.mimic for name, joint in movable.items() if joint.mimic is not None}
    following = resolve_mimics(mimics, movable)
    free = {name: _free_joint(joint, settings, warnings) for name, joint in movable.items() if name not in following}
    return SliderJoints(tuple(movable), free, following, tuple(warnings))


def _free_joint(joint: Joint, settings: SliderSettings, warnings: list[str]) -> SliderJoint:
    lower, upper = _limits(joint, settings.use_smallest_joint_limits, warnings)
    middle = (lower + upper) / 2
    zero = settings.zeros.get(joint.name, 0.0 if lower <= 0.0 <= upper else middle)
    if not lower <= zero <= upper:
        nearest = min(max(zero, lower), upper)
        warnings.append(f"parameter zeros/{joint.name}: {zero} is outside [{lower}, {upper}]; {nearest} is used")
        zero = nearest
    unit = "m" if joint.kind == "prismatic" else "rad"
    return SliderJoint(joint.name, lower, upper, zero, unit, joint.kind == "continuous")


def _limits(joint: Joint, smallest: bool, warnings: list[str]) -> tuple[float, float]:
    if joint.kind == "continuous":
        lower, upper = -math.pi, math.pi
    elif joint.limit is None:
        warnings.append(f"robot_description:{joint.line}: joint '{joint.name}' has no <limit> and stays at 0")
        return 0.0, 0.0
    else:
        lower, upper = joint.limit.lower, joint.limit.upper
    if smallest and joint.safety is not None:
        lower = max(lower, -math.inf if joint.safety.soft_lower_limit is None else joint.safety.soft_lower_limit)
        upper = min(upper, math.inf if joint.safety.soft_upper_limit is None else joint.safety.soft_upper_limit)
    if not (lower <= upper and math.isfinite(lower) and math.isfinite(upper)):
        raise ValueError(
            f"robot_description:{joint.line}: joint '{joint.name}' has the range [{lower}, {upper}]; allowed: a finite "
            "lower limit that is not above the upper limit; correct <limit> or <safety_controller>"
        )
    return lower, upper
