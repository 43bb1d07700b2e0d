# SPDX-License-Identifier: BSD-3-Clause
"""With the wrist centre on the first axis, the first joint is free; the solution near the seed is found."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from pose_difference import pose_difference

from modular_framework_planning.kinematics.inverse_kinematics import CLOSED_FORM, InverseKinematics
from modular_framework_planning.robot_model.robot_model import RobotModel

JOINTS = (  # origin [m] in the previous link, and axis
    ("0 0 0.3", "0 0 1"),
    ("{offset} 0 0.1", "0 1 0"),
    ("0 0 0.45", "0 1 0"),
    ("0.1 0 0", "1 0 0"),
    ("0.3 0 0", "0 1 0"),
    ("0 0 0", "1 0 0"),
)
UPPER, FORE = 0.45, 0.4  # lengths of the upper arm and from the elbow to the wrist centre [m]


def arm(offset: float) -> RobotModel:
    """An arm with a spherical wrist, whose second axis is at an offset from the first [m]."""
    parts = ['<robot name="six"><link name="link0"/>']
    for number, (origin, axis) in enumerate(JOINTS, 1):
        parts.append(
            f'<link name="link{number}"/><joint name="joint{number}" type="revolute"><parent link="link{number - 1}"/>'
            f'<child link="link{number}"/><origin xyz="{origin.format(offset=offset)}"/><axis xyz="{axis}"/>'
            '<limit lower="-3" upper="3" velocity="2" effort="10"/></joint>'
        )
    parts.append(
        '<link name="tool"/><joint name="flange" type="fixed"><parent link="link6"/><child link="tool"/>'
        '<origin xyz="0.08 0.02 0" rpy="0.1 0.2 0.3"/></joint></robot>'
    )
    srdf = '<robot name="six"><group name="arm"><chain base_link="link0" tip_link="tool"/></group></robot>'
    return RobotModel("".join(parts), srdf)


def with_wrist_at(rng: np.random.Generator, offset: float, distance: float) -> np.ndarray:
    """Joint values with the wrist centre at a distance from the first axis [m]."""
    values = rng.uniform(-2.5, 2.5, 6)
    values[1] = rng.uniform(0.1, 0.6)
    reach = (distance - offset - UPPER * np.sin(values[1])) / FORE
    values[2] = np.arccos(reach) - values[1]
    values[4] = rng.uniform(0.3, 2.5) * rng.choice([-1.0, 1.0])  # no singular wrist
    return values


def pose_of(model: RobotModel, positions: np.ndarray) -> pin.SE3:
    data = model.pin_model.createData()
    pin.framesForwardKinematics(model.pin_model, data, positions)
    return data.oMf[model.frame_ids["tool"]].copy()


@pytest.mark.parametrize("offset", [0.0, 0.08])
@pytest.mark.parametrize("distance", [0.0, 1e-9, 1e-6, 1e-3])
def test_the_nearest_solution_to_a_posture_with_a_singular_shoulder_is_the_posture(
    offset: float, distance: float
) -> None:
    model, rng = arm(offset), np.random.default_rng(1)
    solver = InverseKinematics(model, model.group("arm"))
    assert solver.method == CLOSED_FORM
    for _ in range(20):
        positions = with_wrist_at(rng, offset, distance)
        target = pose_of(model, positions)
        found = solver.solutions("tool", target, positions)
        assert found and np.abs(found[0] - positions).max() < 1e-4, positions
        assert not solver.is_complete("tool", target, positions)
        for item in found:
            assert max(pose_difference(pose_of(model, item), target)) < 1e-6
            assert not model.bound_violations(item, solver.group.indices)


def test_a_posture_with_the_wrist_beside_the_first_axis_has_a_complete_set_of_solutions() -> None:
    model, rng = arm(0.08), np.random.default_rng(1)
    solver = InverseKinematics(model, model.group("arm"))
    positions = with_wrist_at(rng, 0.08, 0.1)
    assert solver.is_complete("tool", pose_of(model, positions), positions)
