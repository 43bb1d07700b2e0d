# SPDX-License-Identifier: BSD-3-Clause
"""Conversions of rotations give what SciPy gives."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from modular_framework_urdf.rotations import (
    matrix_from_rpy,
    quaternion_from_matrix,
    quaternion_from_rpy,
    rpy_from_quaternion,
)

ANGLE = st.floats(-7.0, 7.0)
COORDINATE = st.floats(-1.0, 1.0).filter(lambda value: value == 0.0 or abs(value) > 1e-3)


@settings(max_examples=300, deadline=None)
@given(ANGLE, ANGLE, ANGLE)
def test_roll_pitch_and_yaw_are_turns_about_the_fixed_axes(roll: float, pitch: float, yaw: float) -> None:
    wanted = Rotation.from_euler("xyz", (roll, pitch, yaw))
    assert np.allclose(matrix_from_rpy(roll, pitch, yaw), wanted.as_matrix(), atol=1e-14)
    assert np.allclose(quaternion_from_rpy(roll, pitch, yaw), wanted.as_quat(), atol=1e-14)


@settings(max_examples=300, deadline=None)
@given(st.tuples(COORDINATE, COORDINATE, COORDINATE, COORDINATE).filter(any))
@example((1.0, 0.0, 0.0, 0.0))
@example((0.0, 1.0, 0.0, 0.0))
@example((0.0, 0.0, 1.0, 0.0))
@example((0.5, 0.5, -0.5, 0.5))
def test_the_quaternion_of_a_matrix_is_scipys(quaternion: tuple[float, float, float, float]) -> None:
    wanted = Rotation.from_quat(quaternion)
    found = np.array(quaternion_from_matrix(wanted.as_matrix().tolist()))
    assert np.linalg.norm(found) == pytest.approx(1.0, abs=1e-15)
    assert np.allclose(found * np.sign(found @ wanted.as_quat()), wanted.as_quat(), atol=1e-14)


@settings(max_examples=300, deadline=None)
@given(st.tuples(COORDINATE, COORDINATE, COORDINATE, COORDINATE).filter(any))
@example((0.0, 1.0, 0.0, 1.0))
@example((0.0, -1.0, 0.0, 1.0))
@example((0.5, 0.5, -0.5, 0.5))
@example((1.0, 0.0, 0.0, 0.0))
def test_the_angles_of_a_quaternion_of_any_length_are_scipys(quaternion: tuple[float, float, float, float]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a pitch at its end
        wanted = Rotation.from_quat(quaternion).as_euler("xyz")
    found = np.array(rpy_from_quaternion(quaternion))
    assert np.allclose(np.remainder(found - wanted + math.pi, 2 * math.pi), math.pi, atol=1e-9)
    assert abs(found[1]) <= math.pi / 2 + 1e-15 and np.abs(found).max() <= math.pi


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
def test_at_the_ends_of_the_pitch_the_yaw_is_zero_and_the_rotation_the_same(pitch: float) -> None:
    roll, found, yaw = rpy_from_quaternion(quaternion_from_rpy(0.3, pitch, 0.8))
    assert yaw == 0.0 and found == pytest.approx(pitch)
    assert np.allclose(matrix_from_rpy(roll, found, yaw), matrix_from_rpy(0.3, pitch, 0.8), atol=1e-7)


@pytest.mark.parametrize("quaternion", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0)])
def test_a_quaternion_without_length_is_refused(quaternion: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="the norm of a quaternion must be above 0"):
        rpy_from_quaternion(quaternion)
