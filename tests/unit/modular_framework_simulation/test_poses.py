# SPDX-License-Identifier: BSD-3-Clause
"""Rigid transforms agree with SciPy's, and undo each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from modular_framework_simulation.models.poses import Pose, normalised_quaternion
from modular_framework_urdf.rotations import rpy_from_quaternion

ANGLE = st.floats(-3.1, 3.1)
LENGTH = st.floats(-10.0, 10.0)
POSES = st.builds(Pose.from_xyz_rpy, st.tuples(LENGTH, LENGTH, LENGTH), st.tuples(ANGLE, st.floats(-1.5, 1.5), ANGLE))


def matrix(pose: Pose) -> np.ndarray:
    result = np.eye(4)
    result[:3, :3] = Rotation.from_quat(pose.quaternion).as_matrix()
    result[:3, 3] = pose.position
    return result


@given(ANGLE, st.floats(-1.5, 1.5), ANGLE)
def test_roll_pitch_yaw_are_turns_about_fixed_axes(roll: float, pitch: float, yaw: float) -> None:
    expected = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
    assert matrix(Pose.from_xyz_rpy((0, 0, 0), (roll, pitch, yaw)))[:3, :3] == pytest.approx(expected, abs=1e-9)


@given(POSES, POSES)
def test_a_product_is_the_product_of_the_matrices(a: Pose, b: Pose) -> None:
    assert matrix(a @ b) == pytest.approx(matrix(a) @ matrix(b), abs=1e-8)


@given(POSES)
def test_the_inverse_undoes_a_pose(pose: Pose) -> None:
    translation, rotation = (pose @ pose.inverse()).distance_to(Pose())
    assert translation < 1e-8
    assert rotation < 1e-5


@given(POSES)
def test_roll_pitch_yaw_of_a_quaternion_give_the_quaternion_back(pose: Pose) -> None:
    again = Pose.from_xyz_rpy(pose.position, rpy_from_quaternion(pose.quaternion))
    assert again.distance_to(pose)[1] < 1e-5


def test_pitch_straight_up_keeps_the_rotation() -> None:
    pose = Pose.from_xyz_rpy((0, 0, 0), (0.3, math.pi / 2, 0.7))
    again = Pose.from_xyz_rpy((0, 0, 0), rpy_from_quaternion(pose.quaternion))
    assert again.distance_to(pose)[1] < 1e-4


def test_an_unset_quaternion_is_the_identity_and_a_wrong_one_is_refused() -> None:
    assert normalised_quaternion((0, 0, 0, 0)) == (0, 0, 0, 1)
    with pytest.raises(ValueError, match="length 2"):
        normalised_quaternion((0, 0, 0, 2))
    with pytest.raises(ValueError, match="expected 1"):
        normalised_quaternion((0, 0, math.nan, 1))
