# SPDX-License-Identifier: BSD-3-Clause
"""Path and goal tolerances of a trajectory, and descriptions of violations.

Defaults come from the parameters below `constraints`; a goal may replace or erase them. An infinite tolerance is not
checked.
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
    """A tolerance of a goal; positive replaces the default, 0 keeps the default, negative erases it.

    Attributes:
        position: Position tolerance [rad|m].
        velocity: Velocity tolerance [rad/s|m/s].
    """

    position: float = 0.0
    velocity: float = 0.0


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Bounds on position and velocity error of each joint.

    Attributes:
        path: Bounds during the motion, shape (2, joints).
        goal: Bounds at the end, shape (2, joints).
        goal_time_s: Maximum delay of reaching the goal after the end of the trajectory.
    """

    path: Array
    goal: Array
    goal_time_s: float

    @property
    def checks_path(self) -> bool:
        """Whether any path tolerance is finite."""
        return bool(np.isfinite(self.path).any())


def read_tolerances(controller_nh: NodeHandle, joint_names: Sequence[str]) -> Tolerances:
    """Reads the defaults `constraints/{goal_time, stopped_velocity_tolerance, <joint>/{trajectory, goal}}`.

    Tolerances up to 0 are not checked.

    Raises:
        ParameterError: A value is not a number, or the time is negative.
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
    *,
    path: Mapping[str, JointTolerance],
    goal: Mapping[str, JointTolerance],
    goal_time_s: float,
) -> Tolerances:
    """Returns the tolerances of a goal; joints outside the goal are not checked, and their tolerances are ignored.

    Args:
        defaults: Default tolerances of the controller.
        joint_names: All joints of the controller.
        joints: Indices of the goal's joints.
        path: Path tolerances of the goal, by joint name.
        goal: Goal tolerances of the goal, by joint name.
        goal_time_s: Goal time; positive replaces the default, 0 keeps the default, negative means 0.

    Raises:
        InvalidTrajectoryError: A tolerance is not a number.
    """
    named_tolerances = [
        (kind, *item) for kind, tolerances in (("path", path), ("goal", goal)) for item in tolerances.items()
    ]
    faults = [
        f"{kind}_tolerance of joint '{name}' is not a number: position {tolerance.position:.6g}, velocity "
        f"{tolerance.velocity:.6g}; expected more than 0 (a bound), 0 (the default) or less (not checked)"
        for kind, name, tolerance in named_tolerances
        if math.isnan(tolerance.position) or math.isnan(tolerance.velocity)
    ]
    if faults:
        raise InvalidTrajectoryError("; ".join(faults))
    time_s = defaults.goal_time_s if goal_time_s == 0.0 else max(0.0, goal_time_s)
    return Tolerances(
        _merge(defaults.path, joint_names, joints, path), _merge(defaults.goal, joint_names, joints, goal), time_s
    )


def foreign_tolerances(
    joint_names: Sequence[str], path: Mapping[str, JointTolerance], goal: Mapping[str, JointTolerance]
) -> str:
    """Returns a warning on tolerances for joints that the controller does not have, or "".

    Args:
        joint_names: All joints of the controller.
        path: Path tolerances of the goal, by joint name.
        goal: Goal tolerances of the goal, by joint name.
    """
    foreign = [
        f"{kind}_tolerance of joint '{name}'"
        for kind, tolerances in (("path", path), ("goal", goal))
        for name in tolerances
        if name not in joint_names
    ]
    return f"ignored: {', '.join(foreign)}; joints of the controller: {', '.join(joint_names)}" if foreign else ""


def _merge(
    defaults: Array, joint_names: Sequence[str], joints: Sequence[int], tolerances: Mapping[str, JointTolerance]
) -> Array:
    result = np.full_like(defaults, math.inf)
    for i in joints:
        tolerance = tolerances.get(joint_names[i], JointTolerance())
        for row, value in enumerate((tolerance.position, tolerance.velocity)):
            result[row, i] = defaults[row, i] if value == 0.0 else value if value > 0.0 else math.inf
    return result


def violations(error: Array, tolerance: Array, joint_names: Sequence[str]) -> str:
    """Returns the joints out of tolerance with errors and tolerances, or "".

    Args:
        error: Position and velocity errors, desired minus actual, shape (2, joints).
        tolerance: Tolerances, infinite if not checked; shape (2, joints).
        joint_names: Names of the joints.
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
