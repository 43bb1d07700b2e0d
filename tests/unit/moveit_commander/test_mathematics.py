# SPDX-License-Identifier: BSD-3-Clause
"""Rotations, Jacobian, timing and regions of moveit_commander."""

from __future__ import annotations

import math

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, Quaternion, Transform
from hypothesis import given, settings
from hypothesis import strategies as st
from moveit_commander import conversions
from moveit_commander.allowed_collisions import set_allowed, set_default
from moveit_commander.chain_jacobian import jacobian
from moveit_commander.exception import MoveItCommanderException
from moveit_commander.group_joint_targets import link_and_approximate
from moveit_commander.group_motion import cartesian_options
from moveit_commander.joints import Joint
from moveit_commander.object_region import Region, inside
from moveit_commander.trajectory_timing import Limits, distinct, retime, unwound
from moveit_msgs.msg import AllowedCollisionEntry, AllowedCollisionMatrix, CollisionObject, Constraints
from scipy.spatial.transform import Rotation

ANGLE = st.floats(-3.1, 3.1)


@given(ANGLE, st.floats(-math.pi / 2.0, math.pi / 2.0), ANGLE)
@settings(max_examples=200, deadline=None)
def test_rpy_and_quaternion_are_the_same_rotation(roll: float, pitch: float, yaw: float) -> None:
    quaternion = conversions.quaternion_from_rpy(roll, pitch, yaw)
    wanted = Rotation.from_euler("xyz", [roll, pitch, yaw])
    assert np.allclose(Rotation.from_quat(quaternion).as_matrix(), wanted.as_matrix(), atol=1e-9)
    back = Rotation.from_euler("xyz", conversions.rpy_from_quaternion(quaternion))
    assert np.allclose(back.as_matrix(), wanted.as_matrix(), atol=1e-5)


@pytest.mark.parametrize("pitch", [math.pi / 2.0, -math.pi / 2.0])
def test_the_gimbal_lock_has_an_answer(pitch: float) -> None:
    wanted = Rotation.from_euler("xyz", [0.3, pitch, 0.8])
    found = Rotation.from_euler("xyz", conversions.rpy_from_quaternion(wanted.as_quat()))
    assert np.allclose(found.as_matrix(), wanted.as_matrix(), atol=1e-6)


def test_lists_and_messages_are_turned_into_each_other() -> None:
    numbers = [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0]
    assert conversions.pose_to_list(conversions.list_to_pose(numbers)) == numbers
    assert conversions.transform_to_list(conversions.list_to_transform(numbers)) == numbers
    assert conversions.list_to_pose([1.0, 2.0, 3.0, 0.0, 0.0, 0.0]) == conversions.list_to_pose(numbers)
    copy = Transform()
    conversions.msg_from_string(copy, conversions.msg_to_string(conversions.list_to_transform(numbers)))
    assert conversions.transform_to_list(copy) == numbers
    for wrong in (
        lambda: conversions.list_to_pose([1.0]),
        lambda: conversions.list_to_transform([1.0]),
        lambda: conversions.rpy_from_quaternion([0.0] * 4),
        lambda: conversions.rpy_from_quaternion([math.nan, 0.0, 0.0, 1.0]),
    ):
        with pytest.raises(MoveItCommanderException):
            wrong()


def test_the_jacobian_of_a_planar_arm_is_the_textbooks() -> None:
    chain = [
        Joint("first", "revolute", "base", "one", axis=(0, 0, 1)),
        Joint("second", "revolute", "one", "two", xyz=(2.0, 0.0, 0.0), axis=(0, 0, 1)),
        Joint("slide", "prismatic", "two", "three", axis=(1, 0, 0)),
    ]
    a, b = 0.3, 0.5
    matrix = jacobian(chain, {"first": a, "second": b, "slide": 0.7}, (0.3, 0.0, 0.0))
    tip = [2.0 * math.cos(a) + math.cos(a + b), 2.0 * math.sin(a) + math.sin(a + b)]
    assert np.allclose(matrix[:, 0], [-tip[1], tip[0], 0, 0, 0, 1])
    assert np.allclose(matrix[:, 1], [-math.sin(a + b), math.cos(a + b), 0, 0, 0, 1])
    assert np.allclose(matrix[:, 2], [math.cos(a + b), math.sin(a + b), 0, 0, 0, 0])


def limits(joints: int, velocity: float, acceleration: float) -> Limits:
    return Limits(*(np.full(joints, value) for value in (-np.inf, np.inf, velocity, acceleration)))


@given(st.integers(0, 2**31))
@settings(max_examples=10, deadline=None)
def test_a_retimed_path_keeps_its_points_and_the_velocity_limits(seed: int) -> None:
    generator = np.random.default_rng(seed)
    points = np.cumsum(generator.uniform(0.05, 0.3, (6, 3)) * generator.choice([-1.0, 1.0], 3), axis=0)
    timing = retime(points, limits(3, 1.0, 2.0))
    times, velocities, accelerations = timing.times, timing.velocities, timing.accelerations
    assert times[0] == 0.0 and (np.diff(times) > 0.0).all() and velocities.shape == accelerations.shape == (6, 3)
    assert np.abs(velocities).max() <= 1.0 + 1e-3 and np.abs(velocities[[0, -1]]).max() < 1e-6
    assert np.abs(accelerations).max() <= 2.0
    half = retime(points, limits(3, 0.5, 2.0)).times
    assert half[-1] > times[-1]


def test_repeated_points_are_left_out() -> None:
    assert list(distinct([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1e-9], [0.0, 0.0]])) == [0, 2, 4]


def test_a_joint_without_ends_that_jumps_by_a_turn_goes_on_turning() -> None:
    angles = np.linspace(2.0, 12.0, 21)  # beyond pi three times
    wrapped = np.arctan2(np.sin(angles), np.cos(angles))
    rows = unwound(np.stack([wrapped, wrapped], axis=1), [True, False])
    np.testing.assert_allclose(rows[:, 0], angles)
    np.testing.assert_allclose(rows[:, 1], wrapped)
    times = retime(unwound([[3.0], [-3.0]], [True]), limits(1, 1.0, 1.0)).times
    assert times[-1] == pytest.approx(2.0 * math.sqrt(2.0 * math.pi - 6.0), rel=0.1)  # a triangle of velocity


def test_a_region_holds_objects_by_all_their_shapes() -> None:
    turned = Pose(Point(1.0, 0.0, 0.0), Quaternion(0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)))
    item = CollisionObject(pose=turned, primitive_poses=[Pose(Point(1.0, 0.0, 0.0), Quaternion(0, 0, 0, 1))])
    assert inside(item, Region((0.9, 0.9, -0.1), (1.1, 1.1, 0.1)))
    assert not inside(item, Region((1.9, -0.1, -0.1), (2.1, 0.1, 0.1)))
    assert inside(CollisionObject(pose=turned), Region((0.9, -0.1, -0.1), (1.1, 0.1, 0.1)))


def test_a_collision_matrix_stays_symmetric() -> None:
    matrix = AllowedCollisionMatrix(
        entry_names=["a", "b"],
        entry_values=[AllowedCollisionEntry([False, False]), AllowedCollisionEntry([False, False])],
    )
    set_default(matrix, "a", True)
    set_default(matrix, "a", False)
    set_allowed(matrix, "new", "b")
    set_allowed(matrix, "b")
    rows = [list(entry.enabled) for entry in matrix.entry_values]
    assert rows == [[False, False, False], [False, False, True], [False, True, False]]
    assert dict(zip(matrix.default_entry_names, matrix.default_entry_values, strict=True)) == {"a": False, "b": True}
    with pytest.raises(MoveItCommanderException, match="'nobody' has no entry"):
        set_allowed(matrix, "a", "nobody")


def test_both_signatures_of_a_cartesian_path_are_understood() -> None:
    constraints = Constraints(name="upright")
    assert cartesian_options((), {}) == (0.0, True, Constraints())
    assert cartesian_options((5.0, False, constraints), {}) == (5.0, False, constraints)
    assert cartesian_options((False, constraints), {}) == (0.0, False, constraints)
    assert cartesian_options((0.0,), {"avoid_collisions": False}) == (0.0, False, Constraints())
    assert cartesian_options((), {"jump_threshold": 2.0}) == (2.0, True, Constraints())
    for options, named in (((True, None, 1), {}), ((True,), {"avoid_collisions": True}), ((), {"speed": 1})):
        with pytest.raises(TypeError, match="allowed"):
            cartesian_options(options, named)


def test_the_arguments_after_a_pose_are_distinguished_by_type() -> None:
    assert link_and_approximate("tool0", True) == link_and_approximate(True, "tool0") == ("tool0", True)
    assert link_and_approximate(None, None) == ("", False)
    with pytest.raises(MoveItCommanderException, match="Unexpected type"):
        link_and_approximate(3.5, None)
