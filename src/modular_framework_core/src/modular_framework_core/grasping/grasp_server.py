# SPDX-License-Identifier: BSD-3-Clause
"""Checks a grasp command for the manipulator, and decides whether the manipulator reached it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

from modular_framework_core.commander.robot_groups import Group, RobotModelError

CLOSED_STATE = "closed"
TOLERANCE_SHARE, WIDEST_TOLERANCE = 0.025, 0.05
"""Distance that counts as reached: a share of the smallest range of the fingers' joints, and the most [rad or m]."""


class GraspCommandError(ValueError):
    """A grasp command cannot be carried out; the text says why and what is allowed."""


class Stage(IntEnum):
    """Stage of a grasp, with the numbers of modular_framework_core/GraspCommand."""

    PREGRASP = 0
    GRASP = 1
    POSTGRASP = 2

    @classmethod
    def of(cls, number: int) -> Stage:
        """Returns the stage of a number.

        Raises:
            GraspCommandError: There is no such stage.
        """
        try:
            return cls(number)
        except ValueError as error:
            raise GraspCommandError(
                f"grasp_state is {number}, allowed are PRE_GRASP_STATE=0, GRASP_STATE=1, POST_GRASP_STATE=2"
            ) from error


@dataclass(frozen=True, slots=True)
class Outcome:
    """Final positions of the fingers, and how the motion ended.

    Attributes:
        positions: {joint: position} after the motion [rad or m].
        stalled: True when something stopped the fingers before they got to their targets.
        text: Message of the controller.
        pressing: True when they press with an effort that moves free fingers.
    """

    positions: Mapping[str, float]
    stalled: bool
    text: str = ""
    pressing: bool = False


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a stage was reached, and the reason."""

    reached: bool
    reason: str


def posture_targets(names: Sequence[str], positions: Sequence[float], group: Group) -> dict[str, float]:
    """Checks a posture against the manipulator's planning group.

    Args:
        names: Joints of the posture.
        positions: Their positions [rad or m].
        group: Planning group of the manipulator.

    Returns:
        {joint: position}.

    Raises:
        GraspCommandError: Names and positions do not pair, a joint is foreign or repeated, or a position is out of
            limits.
    """
    if not names:
        raise GraspCommandError("the posture has no joint names; it needs at least one, with its position")
    targets = _paired("the posture", names, "positions", positions, group)
    for name, position in targets.items():
        joint = group.joint(name)
        if not math.isfinite(position) or not joint.lower - 1e-6 <= position <= joint.upper + 1e-6:
            raise GraspCommandError(
                f"joint '{name}' is to go to {position}, its limits are [{joint.lower}, {joint.upper}]"
            )
    return targets


def _paired(what: str, names: Sequence[str], kind: str, values: Sequence[float], group: Group) -> dict[str, float]:
    """Pairs joints of the group with their values; ``what`` and ``kind`` say in errors of what."""
    if len(names) != len(values):
        raise GraspCommandError(
            f"{what} has {len(names)} joint names and {len(values)} {kind}; it needs as many of each"
        )
    if len(set(names)) != len(names):
        raise GraspCommandError(f"{what} names a joint twice: {list(names)}; name each once")
    for name in names:
        try:
            group.joint(name)
        except RobotModelError as error:
            raise GraspCommandError(f"{what}: {error}") from error
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def torque_share(max_torque: float, full_scale: float) -> float:
    """Computes a command's greatest torque as a share of what the joints can do; more than they can do is 1.

    Args:
        max_torque: Of the command, in the unit of ``full_scale``.
        full_scale: Value that stands for the joints' full effort, more than 0.

    Raises:
        GraspCommandError: The torque is no positive number.
    """
    if not 0.0 < max_torque < math.inf:
        raise GraspCommandError(
            f"max_torque is {max_torque}, allowed are numbers of more than 0 ({full_scale:g} is "
            "the full torque); set how hard the fingers may press"
        )
    return min(1.0, max_torque / full_scale)


def torque_intensities(names: Sequence[str], values: Sequence[float], group: Group) -> dict[str, float]:
    """Checks the torque intensities of a grasp against the manipulator's planning group.

    Args:
        names: Joints.
        values: Their intensities in [-1, 1]; negative means outward. None at all leaves every joint at full intensity.
        group: Planning group of the manipulator.

    Returns:
        {joint: intensity}.

    Raises:
        GraspCommandError: As for a posture; the range of an intensity is [-1, 1].
    """
    if not values:
        return {}
    intensities = _paired("torque_intensity", names, "values", values, group)
    for name, value in intensities.items():
        if not -1.0 <= value <= 1.0:
            raise GraspCommandError(f"the torque intensity of joint '{name}' is {value}, allowed is -1 to 1")
    return intensities


def effort_limits(
    targets: Mapping[str, float], intensities: Mapping[str, float], group: Group, share: float, stage: Stage
) -> dict[str, float]:
    """Computes the effort each joint may use.

    The effort is |torque intensity| x share of the greatest torque x the joint's effort limit in the URDF. A joint
    without an intensity counts as 1. An intensity of 0 is no effort where the fingers are to close on an object; where
    they only take a posture, it leaves theirs to the controller.

    Args:
        targets: Joints to move.
        intensities: {joint: intensity in [-1, 1]}.
        group: Planning group of the manipulator.
        share: Greatest torque as a share of what the joints can do, in (0, 1].
        stage: Stage that is commanded.

    Returns:
        {joint: effort} [N m or N]; without the joints whose effort is left to the controller: those with an intensity
        of 0 outside the grasp, and those whose effort the URDF does not limit.
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
    """Refuses to move a joint that may not use any effort, for those that bound it.

    Raises:
        GraspCommandError: The effort is 0.
    """
    if effort == 0.0:
        raise GraspCommandError(
            f"joint '{name}' is to move with no torque, allowed is more than 0 (max_torque x its "
            "torque intensity, which is 0 or too small); give the grasp more of either"
        )


def closed_positions(group: Group) -> dict[str, float]:
    """Returns where the joints are when the hand is shut: the group state ``closed``, else the upper limits."""
    return group.states.get(CLOSED_STATE) or {joint.name: joint.upper for joint in group.joints}


def reached_tolerance(group: Group) -> float:
    """Returns the distance that counts as reached [rad or m]: a small share of the fingers' range of motion."""
    ranges = [joint.upper - joint.lower for joint in group.joints if 0.0 < joint.upper - joint.lower < math.inf]
    return min([WIDEST_TOLERANCE, *(TOLERANCE_SHARE * each for each in ranges)])


def judge(
    stage: Stage, targets: Mapping[str, float], outcome: Outcome, closed: Mapping[str, float], tolerance: float
) -> Verdict:
    """Decides whether a stage was reached.

    pregrasp: every joint is at its target. grasp: something stopped the fingers, or they are at targets short of a
    shut hand; a hand that shuts fully holds nothing. postgrasp: every joint is at its target, or the object still
    stops them.

    Args:
        stage: Stage that was commanded.
        targets: {joint: position} commanded.
        outcome: What happened.
        closed: {joint: position} of the shut hand.
        tolerance: Greatest distance that counts as reached [rad or m].

    Returns:
        The verdict.
    """
    away = {name: abs(outcome.positions.get(name, math.inf) - target) for name, target in targets.items()}
    worst = max(away, key=away.__getitem__)
    reached = away[worst] <= tolerance
    shut = all(
        abs(outcome.positions.get(name, math.inf) - closed[name]) <= tolerance for name in targets if name in closed
    )
    missed = (
        f"joint '{worst}' is {away[worst]:.4f} away from its target {targets[worst]:.4f}, allowed is {tolerance}"
        f"{'; ' + outcome.text if outcome.text else ''}"
    )
    match stage:
        case Stage.PREGRASP:
            return Verdict(reached, "posture reached" if reached else missed)
        case Stage.GRASP if shut and any(name in closed for name in targets):
            return Verdict(False, "the fingers closed fully without anything between them")
        case Stage.GRASP if outcome.stalled:
            return Verdict(True, "the fingers stopped on something before they were shut")
        case Stage.POSTGRASP if outcome.stalled and not reached:
            return Verdict(not shut, "the fingers are still stopped by something" if not shut else missed)
        case _:
            return Verdict(reached, "posture reached" if reached else missed)
