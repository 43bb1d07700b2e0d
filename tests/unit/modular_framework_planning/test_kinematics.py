# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics: every solution is right, none is lost, and failures have a cause."""
from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from modular_framework_planning.errors import PlanningError
from modular_framework_planning.kinematics import NUMERIC, InverseKinematics, KinematicsSettings
from modular_framework_planning.robot_model import RobotModel
from modular_framework_planning.spatial import pose_difference

TIP = "eg_manipulator"


@pytest.fixture(scope="module")
def solver(model: RobotModel) -> InverseKinematics:
    return InverseKinematics(model, model.group("arm_and_manipulator"))


def random_positions(model: RobotModel, rng: np.random.Generator) -> np.ndarray:
    positions = model.default_positions()
    positions[model.group("arm_and_manipulator").indices] = rng.uniform(-np.pi, np.pi, 6)
    return positions


def test_every_solution_reaches_the_pose_and_the_state_it_came_from_is_among_them(
        model: RobotModel, solver: InverseKinematics) -> None:
    rng = np.random.default_rng(1)
    assert solver.is_analytic
    for _ in range(200):
        positions = random_positions(model, rng)
        target = model.link_transforms(positions)[TIP]
        found = solver.solutions(TIP, target, positions)
        for item in found:
            data = model.pin_model.createData()
            pin.framesForwardKinematics(model.pin_model, data, item)
            distance, angle = pose_difference(data.oMf[model.frame_ids[TIP]], target)
            assert distance < 1e-6 and angle < 1e-6
            assert not model.bound_violations(item, solver.group.indices)
        assert np.abs(found[0] - positions).max() < 1e-4, "the nearest solution to the seed is the seed itself"


def test_solutions_come_nearest_first_and_include_whole_turns_within_bounds(
        model: RobotModel, solver: InverseKinematics) -> None:
    positions = model.default_positions()
    positions[solver.group.indices] = [0.3, -1.2, 1.1, -1.4, -1.5, 0.2]
    found = solver.solutions(TIP, model.link_transforms(positions)[TIP], positions)
    distances = [np.linalg.norm(item - positions) for item in found]
    assert distances == pytest.approx(sorted(distances))
    turned = positions.copy()
    turned[solver.group.indices[5]] -= 2 * np.pi
    assert any(np.abs(item - turned).max() < 1e-4 for item in found)


def test_numeric_search_solves_what_the_closed_form_solves(model: RobotModel, solver: InverseKinematics) -> None:
    numeric = InverseKinematics(model, model.group("arm_and_manipulator"), KinematicsSettings(NUMERIC))
    rng = np.random.default_rng(2)
    for _ in range(20):
        target = model.link_transforms(random_positions(model, rng))[TIP]
        found = numeric.solutions(TIP, target, model.default_positions(), 0.5)
        assert found
        distance, angle = pose_difference(model.link_transforms(found[0])[TIP], target)
        assert distance < 1e-6 and angle < 1e-6


def test_measured_gripper_joints_stay_as_they_are(model: RobotModel, solver: InverseKinematics) -> None:
    positions = model.default_positions()
    passive = model.index["ezgripper_knuckle_L1_L2_1"]
    positions[passive] = 0.7
    found = solver.solutions(TIP, model.link_transforms(positions)[TIP], positions)
    assert found and all(item[passive] == 0.7 for item in found)


def test_a_pose_too_far_away_is_called_out_of_reach_with_the_distance(
        model: RobotModel, solver: InverseKinematics) -> None:
    target = pin.SE3(np.eye(3), np.array([3.0, 0.0, 1.0]))
    assert solver.solutions(TIP, target, model.default_positions()) == []
    text = solver.explain_unreachable(TIP, target, model.default_positions())
    assert "out of reach" in text and f"{solver.reach:.3f} m" in text


def test_a_tip_that_moves_relative_to_the_chain_is_refused(model: RobotModel, solver: InverseKinematics) -> None:
    with pytest.raises(PlanningError, match="not rigidly fixed"):
        solver.solutions("forearm_link", pin.SE3.Identity(), model.default_positions())
    with pytest.raises(PlanningError, match="does not exist; known:"):
        solver.solutions("no_such_link", pin.SE3.Identity(), model.default_positions())


def test_a_group_that_is_no_chain_is_refused(model: RobotModel) -> None:
    with pytest.raises(PlanningError, match="known: .*arm_and_manipulator"):
        model.group("nobody")
