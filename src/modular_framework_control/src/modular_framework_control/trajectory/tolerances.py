# SPDX-License-Identifier: BSD-3-Clause
"""Path and goal tolerances of a trajectory, and the text of their violations.

Defaults come from the parameters below `constraints`; a goal may replace or erase them. An infinite tolerance is one
that is not checked.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modular_framework_control.trajectory.joint_trajectory import Array, InvalidTrajectoryError
from modular_framework_ros.node_handle import NodeHandle, read_number


@dataclass(frozen=True, slots=True)
class JointTolerance:
    """A tolerance of a goal: positive replaces the default, 0 keeps it, negative erases it.

    Attributes:
        position: [rad] or [m].
        velocity: [rad/s] or [m/s].
    """

    position: float = 0.0
    velocity: float = 0.0


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Bounds on position and velocity error of each joint.

    Attributes:
        path: on the way, shape (2, joints).
        goal: at the end, shape (2, joints).
        goal_time_s: how long after the end the goal may still be reached [s].
    """

    path: Array
    goal: Array
    goal_time_s: float

    @property
    def checks_path(self) -> bool:
        """Whether there is anything to check on the way."""
        return bool(np.isfinite(self.path).any())


def read_tolerances(controller_nh: NodeHandle, joint_names: Sequence[str]) -> Tolerances:
    """Defaults from `constraints/{goal_time, stopped_velocity_tolerance, <joint>/{trajectory, goal}}`.

    What is not positive, as a tolerance, is not checked.

    Raises:
        ParameterError: a value that is not a number, or a negative time.
    """
    constraints = controller_nh.child("constraints")
    stopped = _bound(read_number(constraints, "stopped_velocity_tolerance", 0.01, None))
    path = np.full((2, len(joint_names)), math.inf)
    goal = np.full((2, len(joint_names)), math.inf)
    for i, name in enumerate(joint_names):
        path[0, i] = _bound(read_number(constraints, f"{name}/trajectory", 0.0, None))
        goal[0, i] = _bound(read_number(constraints, f"{name}/goal", 0.0, None))
        goal[1, i] = stopped
    return Tolerances(path, goal, read_number(constraints, "goal_time", 0.0))


def _bound(value: float) -> float:
    return value if value > 0.0 else math.inf


def tolerances_of_goal(
    defaults: Tolerances,
    joint_names: Sequence[str],
    joints: Sequence[int],
    path: Mapping[str, JointTolerance],
    goal: Mapping[str, JointTolerance],
    goal_time_s: float,
) -> Tolerances:
    """The tolerances of one goal; joints it does not move are not checked, and those of other joints are not used.

    Args:
        defaults: those of the controller.
        joint_names: all joints of the controller.
        joints: indices of the joints of the goal.
        path: what the goal says for the way, by joint name.
        goal: what the goal says for the end, by joint name.
        goal_time_s: positive replaces the default [s], 0 keeps it, negative means 0.

    Raises:
        InvalidTrajectoryError: one that is not a number.
    """
    given = [(kind, *item) for kind, tolerances in (("path", path), ("goal", goal)) for item in tolerances.items()]
    faults = [
        f"{kind}_tolerance of joint '{name}' is not a number: position {tolerance.position:.6g}, velocity "
        f"{tolerance.velocity:.6g}; expected more than 0 (a bound), 0 (the parameter's) or less (not checked)"
        for kind, name, tolerance in given
        if math.isnan(tolerance.position) or math.isnan(tolerance.velocity)
    ]
    if faults:
        raise InvalidTrajectoryError("; ".join(faults))
    time_s = defaults.goal_time_s if goal_time_s == 0.0 else max(0.0, goal_time_s)
    return Tolerances(
        _merged(defaults.path, joint_names, joints, path), _merged(defaults.goal, joint_names, joints, goal), time_s
    )


def foreign_tolerances(
    joint_names: Sequence[str], path: Mapping[str, JointTolerance], goal: Mapping[str, JointTolerance]
) -> str:
    """Which tolerances of a goal are of joints that the controller does not have; "" when none is.

    Args:
        joint_names: all joints of the controller.
        path: what the goal says for the way, by joint name.
        goal: what the goal says for the end, by joint name.
    """
    foreign = [
        f"{kind}_tolerance of joint '{name}'"
        for kind, tolerances in (("path", path), ("goal", goal))
        for name in tolerances
        if name not in joint_names
    ]
    return (
        f"not used: {', '.join(foreign)}, which the controller does not have; it has: {', '.join(joint_names)}"
        if foreign
        else ""
    )


def _merged(
    defaults: Array, joint_names: Sequence[str], joints: Sequence[int], given: Mapping[str, JointTolerance]
) -> Array:
    merged = np.full_like(defaults, math.inf)
    for i in joints:
        tolerance = given.get(joint_names[i], JointTolerance())
        for row, value in enumerate((tolerance.position, tolerance.velocity)):
            merged[row, i] = defaults[row, i] if value == 0.0 else value if value > 0.0 else math.inf
    return merged


def violations(error: Array, tolerance: Array, joint_names: Sequence[str]) -> str:
    """Which joints are out of tolerance, each with its error and its tolerance; "" when none is.

    Args:
        error: desired minus actual, position and velocity, shape (2, joints).
        tolerance: same shape; infinite where nothing is checked.
        joint_names: names of the joints.
    """
    within = np.abs(error) <= tolerance
    if within.all():
        return ""
    outside = ~within & np.isfinite(tolerance)
    quantities = ("position", "velocity")
    return "; ".join(
        f"joint '{joint_names[i]}': {quantities[row]} error {error[row, i]:.6g}, tolerance {tolerance[row, i]:.6g}"
        for row, i in np.argwhere(outside)
    )
