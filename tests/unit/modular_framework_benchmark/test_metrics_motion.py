# SPDX-License-Identifier: BSD-3-Clause
"""Figures of motions against closed forms and OMPL's own length."""

from __future__ import annotations

import math

import numpy as np
import pytest
from ompl import base, geometric

from modular_framework_benchmark.metrics.motion_figures import motion_duration, path_length, rms, smoothness

# The minimum-jerk motion x = 10 s^3 - 15 s^4 + 6 s^5 of length 1 in time 1: the integral of (60 - 360 s + 360 s^2)^2
# is 720, and its greatest speed is 1.875 (Flash and Hogan 1985).
MINIMUM_JERK = -math.log(720.0 / 1.875**2)


def minimum_jerk(duration_s: float, length: float, points: int = 1000) -> tuple[np.ndarray, np.ndarray]:
    share = np.linspace(0.0, 1.0, points)
    return share * duration_s, length * (10 * share**3 - 15 * share**4 + 6 * share**5)[:, None]


def test_the_length_of_a_path_is_what_ompl_says() -> None:
    points = np.random.default_rng(1).normal(size=(20, 3))
    space = base.RealVectorStateSpace(3)
    bounds = base.RealVectorBounds(3)
    bounds.setLow(-10.0)
    bounds.setHigh(10.0)
    space.setBounds(bounds)
    path = geometric.PathGeometric(base.SpaceInformation(space))
    for point in points:
        state = space.allocState()
        for axis in range(3):
            state[axis] = float(point[axis])
        path.append(state)
    assert path_length(points) == pytest.approx(path.length(), rel=1e-12)


def test_a_path_of_one_point_has_no_length_and_one_without_points_no_duration() -> None:
    assert path_length([[1.0, 2.0]]) == 0.0
    with pytest.raises(ValueError, match="give at least one time"):
        motion_duration([])


def test_the_smoothness_of_the_minimum_jerk_motion_is_its_closed_form() -> None:
    assert smoothness(*minimum_jerk(1.0, 1.0)) == pytest.approx(MINIMUM_JERK, abs=0.05)


@pytest.mark.parametrize(("duration_s", "length"), [(0.5, 1.0), (20.0, 1.0), (1.0, 0.01), (3.0, 7.0)])
def test_smoothness_does_not_depend_on_size_or_duration(duration_s: float, length: float) -> None:
    assert smoothness(*minimum_jerk(duration_s, length)) == pytest.approx(smoothness(*minimum_jerk(1.0, 1.0)), rel=1e-6)


def test_a_motion_that_trembles_is_less_smooth() -> None:
    times, positions = minimum_jerk(1.0, 1.0)
    trembling = positions + 0.001 * np.sin(60.0 * times)[:, None]
    steady, shaken = smoothness(times, positions), smoothness(times, trembling)
    assert steady is not None and shaken is not None
    assert shaken < steady - 1.0


def test_what_stands_still_or_has_few_points_has_no_smoothness() -> None:
    assert smoothness(np.arange(10.0), np.ones((10, 2))) is None
    assert smoothness([0.0, 1.0], [[0.0], [1.0]]) is None


@pytest.mark.parametrize(
    ("times", "positions", "message"),
    [([0.0, 1.0], [[0.0]], "2 times for 1 points"), ([0.0], [0.0], "one row per point")],
)
def test_arrays_that_do_not_fit_are_refused(times: list[float], positions: list[object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        smoothness(times, positions)


def test_rms_of_nothing_is_nothing() -> None:
    assert rms([]) is None
    assert rms([[3.0, -4.0]]) == pytest.approx(math.sqrt(12.5))
