# SPDX-License-Identifier: BSD-3-Clause
"""Judges what a grasp command asks of the manipulator, and whether the manipulator did it."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

from modular_framework_core.robot_groups import Group, RobotModelError

CLOSED_STATE = "closed"


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
            raise GraspCommandError(f"grasp_state is {number}, allowed are PRE_GRASP_STATE=0, GRASP_STATE=1, "
                                    "POST_GRASP_STATE=2") from error


@dataclass(frozen=True, slots=True)
class Outcome:
    """Where the fingers ended.

    Attributes:
        positions: {joint: position} after the motion [rad or m].
        stalled: True when something stopped the fingers before they got to their targets.
        text: What the controller said.
    """

    positions: Mapping[str, float]
    stalled: bool
    text: str = ""


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a stage was reached, and why that is the answer."""

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
    if not names or len(names) != len(positions):
        raise GraspCommandError(f"the posture has {len(names)} joint names and {len(positions)} positions; "
                                "it needs as many of each, at least one")
    if len(set(names)) != len(names):
        raise GraspCommandError(f"the posture names a joint twice: {list(names)}")
    targets: dict[str, float] = {}
    for name, position in zip(names, positions, strict=True):
        try:
            joint = group.joint(name)
        except RobotModelError as error:
            raise GraspCommandError(str(error)) from error
        if not math.isfinite(position) or not joint.lower - 1e-6 <= position <= joint.upper + 1e-6:
            raise GraspCommandError(f"joint '{name}' is to go to {position}, its limits are "
                                    f"[{joint.lower}, {joint.upper}]")
        targets[name] = float(position)
    return targets


def effort_limits(targets: Mapping[str, float], intensities: Mapping[str, float], group: Group,
                  torque_share: float) -> dict[str, float]:
    """Computes the effort each joint may use.

    The effort is |torque intensity| x share of the greatest torque x the joint's effort limit in the URDF. A joint
    without an intensity counts as 1.

    Args:
        targets: Joints to move.
        intensities: {joint: intensity in [-1, 1]}; negative means outward.
        group: Planning group of the manipulator.
        torque_share: Greatest torque as a share of what the joints can do, in (0, 1].

    Returns:
        {joint: effort} [N m or N]; 0 for a joint without an effort limit, which means the controller's own limit.

    Raises:
        GraspCommandError: An intensity or the share is out of range.
    """
    if not 0.0 < torque_share <= 1.0:
        raise GraspCommandError(f"max_torque is {torque_share:.3f} of the greatest torque, "
                                "allowed is more than 0, up to 1")
    limits: dict[str, float] = {}
    for name in targets:
        intensity = intensities.get(name, 1.0)
        if not -1.0 <= intensity <= 1.0:
            raise GraspCommandError(f"the torque intensity of joint '{name}' is {intensity}, allowed is -1 to 1")
        effort = group.joint(name).effort
        limits[name] = abs(intensity) * torque_share * effort if math.isfinite(effort) else 0.0
    return limits


def closed_positions(group: Group) -> dict[str, float]:
    """Returns where the joints are when the hand is shut: the group state ``closed``, else the upper limits."""
    return group.states.get(CLOSED_STATE) or {joint.name: joint.upper for joint in group.joints}


def judge(stage: Stage, targets: Mapping[str, float], outcome: Outcome, closed: Mapping[str, float],
          tolerance: float) -> Verdict:
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
    shut = all(abs(outcome.positions.get(name, math.inf) - closed[name]) <= tolerance
               for name in targets if name in closed)
    missed = (f"joint '{worst}' is {away[worst]:.4f} away from its target {targets[worst]:.4f}, allowed is {tolerance}"
              f"{'; ' + outcome.text if outcome.text else ''}")
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
