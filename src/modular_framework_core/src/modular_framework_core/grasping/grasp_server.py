# SPDX-License-Identifier: BSD-3-Clause
"""Checks grasp commands for the manipulator, and decides whether the manipulator reached a stage."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

from modular_framework_core.commander.robot_groups import Group, RobotModelError

CLOSED_STATE = "closed"
TOLERANCE_FRACTION, MAX_TOLERANCE = 0.025, 0.05
"""Default position tolerance as a fraction of the smallest range of a finger joint, and its maximum [rad or m]."""


class GraspCommandError(ValueError):
    """A grasp command cannot be executed; the text contains the reason and the allowed values."""


class Stage(IntEnum):
    """Stage of a grasp; the values are the constants of modular_framework_core/GraspCommand."""

    PREGRASP = 0
    GRASP = 1
    POSTGRASP = 2

    @classmethod
    def of(cls, number: int) -> Stage:
        """Returns the stage for a value of `grasp_state`.

        Raises:
            GraspCommandError: The value is not a stage.
        """
        try:
            return cls(number)
        except ValueError as error:
            raise GraspCommandError(
                f"grasp_state is {number}; allowed: PRE_GRASP_STATE=0, GRASP_STATE=1, POST_GRASP_STATE=2"
            ) from error


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a motion of the fingers.

    Attributes:
        positions: Joint positions after the motion, by name [rad or m].
        stalled: Whether the fingers stopped before they reached their targets.
        text: Message of the controller.
        pressing: Whether the fingers press with an effort that would move free fingers.
    """

    positions: Mapping[str, float]
    stalled: bool
    text: str = ""
    pressing: bool = False


@dataclass(frozen=True, slots=True)
class Verdict:
    """Decision whether a stage was reached, with the reason."""

    reached: bool
    reason: str


def posture_targets(names: Sequence[str], positions: Sequence[float], group: Group) -> dict[str, float]:
    """Checks a posture against the manipulator's planning group.

    Args:
        names: Joints of the posture.
        positions: Joint positions [rad or m].
        group: Planning group of the manipulator.

    Returns:
        Joint positions by name.

    Raises:
        GraspCommandError: The numbers of names and positions differ, a joint is repeated or not in the group, or a
            position is outside the joint limits.
    """
    if not names:
        raise GraspCommandError("the posture has no joint names; give at least one joint with its position")
    targets = _values_by_joint("the posture", names, "positions", positions, group)
    for name, position in targets.items():
        joint = group.joint(name)
        if not math.isfinite(position) or not joint.lower - 1e-6 <= position <= joint.upper + 1e-6:
            raise GraspCommandError(
                f"joint '{name}': the target is {position}; allowed: {joint.lower} to {joint.upper}"
            )
    return targets


def _values_by_joint(
    label: str, names: Sequence[str], kind: str, values: Sequence[float], group: Group
) -> dict[str, float]:
    """Returns values by joint name; errors name the message part `label` and the kind of values."""
    if len(names) != len(values):
        raise GraspCommandError(
            f"{label} has {len(names)} joint names and {len(values)} {kind}; the numbers must be equal"
        )
    if len(set(names)) != len(names):
        raise GraspCommandError(f"{label} contains a joint twice: {list(names)}; list each joint once")
    for name in names:
        try:
            group.joint(name)
        except RobotModelError as error:
            raise GraspCommandError(f"{label}: {error}") from error
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def torque_share(max_torque: float, full_scale: float) -> float:
    """Returns the maximum torque of a command as a fraction of the effort limits, clipped to 1.

    Args:
        max_torque: Maximum torque of the command, in the unit of ``full_scale``.
        full_scale: Value that corresponds to the effort limits; above 0.

    Raises:
        GraspCommandError: The torque is not a positive number.
    """
    if not 0.0 < max_torque < math.inf:
        raise GraspCommandError(
            f"max_torque is {max_torque}; allowed: numbers above 0 ({full_scale:g} is the full torque)"
        )
    return min(1.0, max_torque / full_scale)


def torque_intensities(names: Sequence[str], values: Sequence[float], group: Group) -> dict[str, float]:
    """Checks the torque intensities of a grasp against the manipulator's planning group.

    Args:
        names: Joint names.
        values: Torque intensities in [-1, 1]; negative values are outward. An empty sequence stands for full intensity
            of all joints.
        group: Planning group of the manipulator.

    Returns:
        Torque intensities by joint name.

    Raises:
        GraspCommandError: The numbers of names and values differ, a joint is repeated or not in the group, or an
            intensity is outside [-1, 1].
    """
    if not values:
        return {}
    intensities = _values_by_joint("torque_intensity", names, "values", values, group)
    for name, value in intensities.items():
        if not -1.0 <= value <= 1.0:
            raise GraspCommandError(f"the torque intensity of joint '{name}' is {value}; allowed: -1 to 1")
    return intensities


def effort_limits(
    targets: Mapping[str, float], intensities: Mapping[str, float], group: Group, share: float, stage: Stage
) -> dict[str, float]:
    """Computes the effort limit of each joint.

    The effort limit is |torque intensity| x `share` x effort limit of the joint in the URDF. The default intensity is
    1. At the stage `grasp`, an intensity of 0 means no effort. At the other stages, the controller then chooses the
    effort.

    Args:
        targets: Joints to move.
        intensities: Torque intensities in [-1, 1], by joint name.
        group: Planning group of the manipulator.
        share: Maximum torque as a fraction of the effort limits, in (0, 1].
        stage: Commanded stage.

    Returns:
        Effort limits by joint name [Nm or N]. Joints whose effort the controller chooses are missing: joints without an
        effort limit in the URDF, and joints with an intensity of 0 outside the stage `grasp`.
    """
    limits: dict[str, float] = {}
    for name in targets:
        strength, effort = abs(intensities.get(name, 1.0)) * share, group.joint(name).effort
        if strength == 0.0:
            if stage is Stage.GRASP:
                limits[name] = 0.0
        elif 0.0 < effort < math.inf:
            limits[name] = strength * effort
    return limits


def refuse_no_effort(name: str, effort: float) -> None:
    """Raises an error for a joint without effort; for drivers that limit the effort.

    Raises:
        GraspCommandError: The effort is 0.
    """
    if effort == 0.0:
        raise GraspCommandError(
            f"joint '{name}' has an effort limit of 0 (max_torque x torque intensity); "
            "allowed: more than 0; increase max_torque or the torque intensity"
        )


def closed_positions(group: Group) -> dict[str, float]:
    """Returns the joint positions of the closed hand: the group state ``closed``, or else the upper limits."""
    return group.states.get(CLOSED_STATE) or {joint.name: joint.upper for joint in group.joints}


def reached_tolerance(group: Group) -> float:
    """Returns the default position tolerance [rad or m]: a small fraction of the fingers' range of motion."""
    ranges = [joint.upper - joint.lower for joint in group.joints if 0.0 < joint.upper - joint.lower < math.inf]
    return min([MAX_TOLERANCE, *(TOLERANCE_FRACTION * each for each in ranges)])


def judge(
    stage: Stage, targets: Mapping[str, float], outcome: Outcome, closed: Mapping[str, float], tolerance: float
) -> Verdict:
    """Decides whether a stage was reached.

    - `pregrasp` is reached if all joints are at their targets.
    - `grasp` is reached if the fingers stalled, or if all joints are at targets of a hand that is not closed. A fully
      closed hand holds no object.
    - `postgrasp` is reached if all joints are at their targets, or if the object still blocks the fingers.

    Args:
        stage: Commanded stage.
        targets: Commanded positions by joint name [rad or m].
        outcome: Result of the motion.
        closed: Joint positions of the closed hand, by name [rad or m].
        tolerance: Position tolerance [rad or m].
    """
    away = {name: abs(outcome.positions.get(name, math.inf) - target) for name, target in targets.items()}
    worst = max(away, key=away.__getitem__)
    reached = away[worst] <= tolerance
    shut = all(
        abs(outcome.positions.get(name, math.inf) - closed[name]) <= tolerance for name in targets if name in closed
    )
    missed = (
        f"joint '{worst}' is {away[worst]:.4f} away from its target {targets[worst]:.4f}; tolerance: {tolerance}"
        f"{'; ' + outcome.text if outcome.text else ''}"
    )
    match stage:
        case Stage.PREGRASP:
            return Verdict(reached, "posture reached" if reached else missed)
        case Stage.GRASP if shut and any(name in closed for name in targets):
            return Verdict(False, "the fingers closed fully without an object between them")
        case Stage.GRASP if outcome.stalled:
            return Verdict(True, "the fingers stopped at an object before they were closed")
        case Stage.POSTGRASP if outcome.stalled and not reached:
            return Verdict(not shut, "an object still blocks the fingers" if not shut else missed)
        case _:
            return Verdict(reached, "posture reached" if reached else missed)
