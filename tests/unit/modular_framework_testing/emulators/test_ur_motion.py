# SPDX-License-Identifier: BSD-3-Clause
"""The joints of the emulated arm."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modular_framework_testing.emulators.ur_motion import (
    MAX_ACCELERATION,
    MAX_VELOCITY,
    ArmMotion,
    Drive,
    MotionCommand,
    flange_pose,
)

DT_S = 0.008
POSITIONS = st.tuples(*[st.floats(-6.0, 6.0)] * 6)
DRIVES = st.sampled_from([Drive.SERVO, Drive.MOVE, Drive.SPEED, Drive.STOP, Drive.HOLD])


@settings(deadline=None)
@given(
    start=POSITIONS,
    commands=st.lists(st.tuples(DRIVES, POSITIONS, st.integers(1, 30)), max_size=6),
    speed=st.floats(0.0, 1.0),
)
def test_no_joint_is_ever_faster_than_the_arm_or_accelerates_more(
    start: tuple[float, ...], commands: list[tuple[Drive, tuple[float, ...], int]], speed: float
) -> None:
    motion = ArmMotion(start)
    for drive, target, cycles in commands:
        motion.set_command(MotionCommand(drive, target))
        for _ in range(cycles):
            before, positions = list(motion.velocities), list(motion.positions)
            motion.step(DT_S, speed)
            assert all(
                abs(new - old) <= MAX_ACCELERATION * DT_S + 1e-9
                for new, old in zip(motion.velocities, before, strict=True)
            )
            assert all(
                abs(new - old) <= MAX_VELOCITY * DT_S + 1e-9
                for new, old in zip(motion.positions, positions, strict=True)
            )


@settings(deadline=None)
@given(start=POSITIONS, target=POSITIONS)
def test_a_move_arrives_and_rests(start: tuple[float, ...], target: tuple[float, ...]) -> None:
    motion = ArmMotion(start)
    motion.set_command(MotionCommand(Drive.MOVE, target, velocity=2.0, acceleration=10.0))
    for _ in range(2_000):
        motion.step(DT_S, 1.0)
        if motion.is_finished:
            break
    assert motion.positions == pytest.approx(target, abs=1e-4)


def test_a_servo_target_is_followed_within_its_lookahead() -> None:
    motion = ArmMotion((0.0,) * 6)
    for cycle in range(250):
        target = 0.5 * (1.0 - math.cos(cycle * DT_S * math.pi))
        motion.set_command(MotionCommand(Drive.SERVO, (target,) * 6, lookahead_s=0.03))
        motion.step(DT_S, 1.0)
        assert motion.servo_error <= 0.03 * 0.5 * math.pi + 0.01


def test_at_a_slider_of_nothing_the_arm_rests() -> None:
    motion = ArmMotion((0.0,) * 6)
    motion.set_command(MotionCommand(Drive.SERVO, (0.3,) * 6))
    for _ in range(50):
        motion.step(DT_S, 0.0)
    assert motion.positions == [0.0] * 6
    assert motion.servo_error == pytest.approx(0.3)


def test_the_flange_is_where_the_makers_table_puts_it() -> None:
    # upright: the arm's lengths above each other, the wrist beside them
    assert flange_pose((0.0, -math.pi / 2, 0.0, -math.pi / 2, 0.0, 0.0))[:3] == pytest.approx(
        (0.0, -(0.10915 + 0.0823), 0.089159 + 0.425 + 0.39225 + 0.09465), abs=1e-9
    )
    # stretched out along x
    assert flange_pose((0.0,) * 6)[:3] == pytest.approx((-0.81725, -0.10915 - 0.0823, 0.089159 - 0.09465), abs=1e-9)


@settings(deadline=None)
@given(turn=st.floats(-3.1, 3.1))
def test_the_rotation_vector_of_the_flange_turns_with_the_base(turn: float) -> None:
    pose = flange_pose((turn, -math.pi / 2, 0.0, -math.pi / 2, 0.0, 0.0))
    assert math.hypot(*pose[:2]) == pytest.approx(0.10915 + 0.0823)
    assert math.sqrt(sum(value * value for value in pose[3:])) <= math.pi + 1e-9
