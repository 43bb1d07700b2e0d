# SPDX-License-Identifier: BSD-3-Clause
"""Limits of joint_limits.yaml take the place of the URDF's, tighter or looser, as in MoveIt."""

from __future__ import annotations

from typing import Any

import pytest

from modular_framework_urdf.joint_limits import JointLimits, described_limits, overwritten
from modular_framework_urdf.urdf_reader import read_urdf

DESCRIBED = JointLimits(-1.0, 1.0, 2.0, 1.0)
JOINT = """<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="{kind}"><parent link="a"/>
<child link="b"/><limit lower="-1" upper="1" velocity="{velocity}" effort="1"/>{safety}</joint></robot>"""
SAFETY = '<safety_controller k_velocity="1" soft_lower_limit="-3" soft_upper_limit="0.8"/>'


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ({}, (-1.0, 1.0, 2.0, 1.0)),
        ({"has_velocity_limits": True, "max_velocity": 0.5}, (-1.0, 1.0, 0.5, 1.0)),
        ({"max_velocity": 3.0, "max_acceleration": 7.0}, (-1.0, 1.0, 3.0, 7.0)),
        ({"has_position_limits": True, "min_position": -2.0, "max_position": 0.5}, (-2.0, 0.5, 2.0, 1.0)),
        ({"has_position_limits": True, "max_position": 1.5}, (-1.0, 1.5, 2.0, 1.0)),
        ({"min_position": -0.5, "max_position": 0.5}, (-1.0, 1.0, 2.0, 1.0)),
        ({"has_position_limits": False, "min_position": -0.5}, (-1.0, 1.0, 2.0, 1.0)),
    ],
)
def test_an_entry_overwrites_in_both_directions(entry: dict[str, Any], expected: tuple[float, ...]) -> None:
    limits, notes = overwritten("j", DESCRIBED, entry)
    assert (limits.lower, limits.upper, limits.velocity, limits.acceleration) == expected
    looser = expected[0] < -1.0 or expected[1] > 1.0 or expected[2] > 2.0
    assert bool(notes) == looser and all("looser than the URDF's" in note for note in notes)


def test_a_velocity_limit_that_is_switched_off_is_the_default_of_a_joint_without_limit() -> None:
    """As in MoveIt 1: RobotModelLoader removes the URDF's limit, and joints without a limit are timed with 1 rad/s."""
    limits, (note,) = overwritten("j", DESCRIBED, {"has_velocity_limits": False, "max_velocity": 3.0})
    assert limits.velocity == 1.0
    assert note == "joint_limits/j: has_velocity_limits is false, so that the default 1 replaces the URDF's 2"


def test_a_continuous_joint_gets_no_bounds() -> None:
    entry = {"has_position_limits": True, "min_position": -0.5, "max_position": 0.5}
    limits, notes = overwritten("j", DESCRIBED, entry, is_endless=True)
    assert (limits.lower, limits.upper) == (-1.0, 1.0) and "has_position_limits is ignored" in notes[0]


def test_limits_of_jerk_and_braking_are_read() -> None:
    assert overwritten("j", DESCRIBED, {"has_jerk_limits": True, "max_jerk": 20.0})[0].jerk == 20.0
    assert overwritten("j", DESCRIBED, {"has_jerk_limits": False, "max_jerk": 20.0})[0].jerk == 1000.0
    assert overwritten("j", DESCRIBED, {"has_deceleration_limits": True, "max_deceleration": -3.0})[0].braking == 3.0


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        ({"max_jerk": -1}, "jerk -1"),
        ({"max_velocity": "fast"}, "joint_limits/j/max_velocity: 'fast' is not a finite number"),
        ({"has_position_limits": True, "min_position": 2.0}, "bounds .2.0, 1.0.*must not exceed"),
        ({"max_deceleration": 1.0}, "must be below 0"),
    ],
)
def test_entries_without_meaning_are_refused(entry: dict[str, Any], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        overwritten("j", DESCRIBED, entry)


@pytest.mark.parametrize(
    ("kind", "velocity", "safety", "expected"),
    [
        ("revolute", 2, "", (-1.0, 1.0, 2.0)),
        ("revolute", 0, SAFETY, (-1.0, 0.8, 1.0)),
        ("continuous", 2, "", (-float("inf"), float("inf"), 2.0)),
    ],
)
def test_soft_limits_narrow_the_described_ones(
    kind: str, velocity: float, safety: str, expected: tuple[float, ...]
) -> None:
    (joint,) = read_urdf(JOINT.format(kind=kind, velocity=velocity, safety=safety), "URDF").joints
    limits = described_limits(joint)
    assert (limits.lower, limits.upper, limits.velocity) == expected
