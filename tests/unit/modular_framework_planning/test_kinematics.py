# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics: every solution is right, none is lost, and failures have a cause."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from pose_difference import pose_difference

from modular_framework_planning.errors import PlanningError
from modular_framework_planning.kinematics import compiled_kinematics
from modular_framework_planning.kinematics.chain_model import joint_tree
from modular_framework_planning.kinematics.compiled_kinematics import joint_placements, rotation_vector
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics, KinematicsPool
from modular_framework_planning.kinematics.kinematics_settings import NUMERIC, KinematicsSettings, settings_from
from modular_framework_planning.kinematics.solution_choice import clearest
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_testing.planning.independent_arms import (
    SEVEN_JOINT_SRDF,
    SEVEN_JOINT_URDF,
    SEVEN_JOINTS,
    pose_gap,
    seven_joint_flange,
    ur5_tool,
)

TIP = "eg_manipulator"


@pytest.fixture(scope="module")
def solver(model: RobotModel) -> InverseKinematics:
    return InverseKinematics(model, model.group("arm_and_manipulator"))


def random_positions(model: RobotModel, rng: np.random.Generator) -> np.ndarray:
    positions = model.default_positions()
    positions[model.group("arm_and_manipulator").indices] = rng.uniform(-np.pi, np.pi, 6)
    return positions


def test_every_solution_reaches_the_pose_and_the_state_it_came_from_is_among_them(
    model: RobotModel, solver: InverseKinematics
) -> None:
    rng = np.random.default_rng(1)
    for _ in range(60):
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
    model: RobotModel, solver: InverseKinematics
) -> None:
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
        found = numeric.solutions(TIP, target, model.default_positions(), timeout_s=0.5)
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
    model: RobotModel, solver: InverseKinematics
) -> None:
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


def test_solutions_agree_with_the_published_lengths_of_the_ur5(model: RobotModel, solver: InverseKinematics) -> None:
    rng = np.random.default_rng(6)
    base = model.link_transforms(model.default_positions())["base_link"]
    for _ in range(20):
        wanted = ur5_tool(rng.uniform(-np.pi, np.pi, 6))
        found = solver.solutions("tool0", base * pin.SE3(wanted), model.default_positions())
        assert found
        assert all(max(pose_gap(ur5_tool(item[solver.group.indices]), wanted)) < 1e-6 for item in found)


@pytest.mark.parametrize(
    "values",
    [
        (0.3, -1.2, 0.0, -1.4, -1.5, 0.2),
        (0.3, -1.2, 1.1, -1.4, 0.0, 0.2),
        (0.0, -np.pi / 2, 0.0, -np.pi / 2, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    ],
)
def test_stretched_and_aligned_postures_are_solved_too(
    model: RobotModel, solver: InverseKinematics, values: tuple[float, ...]
) -> None:
    positions = model.default_positions()
    positions[solver.group.indices] = values
    target = model.link_transforms(positions)[TIP]
    found = solver.solutions(TIP, target, positions)
    assert found and max(pose_difference(model.link_transforms(found[0])[TIP], target)) < 1e-6


def test_compiled_forward_kinematics_equals_the_library(model: RobotModel) -> None:
    rng = np.random.default_rng(7)
    tree, out = joint_tree(model), np.empty((len(model.joint_names), 3, 4))
    data = model.pin_model.createData()
    for _ in range(50):
        positions = rng.uniform(-3.0, 3.0, len(model.joint_names))
        joint_placements(tree, positions, out)
        pin.forwardKinematics(model.pin_model, data, positions)
        expected = np.array([data.oMi[number].homogeneous[:3] for number in range(1, model.pin_model.njoints)])
        assert np.abs(out - expected).max() < 1e-12


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, 3.1, np.pi - 1e-9, np.pi])
def test_rotation_vectors_are_right_from_nothing_to_half_a_turn(angle: float) -> None:
    for axis in (*np.eye(3), np.array([0.6, 0.0, 0.8]), np.array([-2.0, 1.0, 2.0]) / 3.0):
        out = np.empty(3)
        rotation_vector(np.eye(3, 4), np.ascontiguousarray(np.hstack([pin.exp3(angle * axis), np.zeros((3, 1))])), out)
        assert np.abs(pin.exp3(out) - pin.exp3(angle * axis)).max() < 1e-7
        assert np.linalg.norm(out) == pytest.approx(angle, abs=1e-7)


@pytest.fixture(scope="module")
def seven() -> RobotModel:
    return RobotModel(SEVEN_JOINT_URDF, SEVEN_JOINT_SRDF)


@pytest.mark.parametrize("method", ["", NUMERIC])
def test_seven_joints_are_solved_by_holding_one_and_numerically(seven: RobotModel, method: str) -> None:
    solver = InverseKinematics(seven, seven.group("arm"), KinematicsSettings(method, timeout_s=2.0))
    rng = np.random.default_rng(8)
    low, high = np.array([bounds for _, _, bounds in SEVEN_JOINTS]).T
    for _ in range(100):
        wanted = seven_joint_flange(rng.uniform(low, high))
        found = solver.solutions("flange", pin.SE3(wanted), seven.default_positions())
        assert found
        for item in found:
            assert max(pose_gap(seven_joint_flange(item), wanted)) < 1e-6
            assert not seven.bound_violations(item, range(7))


@pytest.mark.parametrize("method", ["", NUMERIC])
def test_redundancy_is_resolved_toward_the_seed(seven: RobotModel, method: str) -> None:
    solver = InverseKinematics(seven, seven.group("arm"), KinematicsSettings(method, timeout_s=2.0))
    rng = np.random.default_rng(9)
    low, high = np.array([bounds for _, _, bounds in SEVEN_JOINTS]).T
    for _ in range(30):
        seed = rng.uniform(low + 0.3, high - 0.3)
        same = solver.solutions("flange", pin.SE3(seven_joint_flange(seed)), seed)
        assert np.linalg.norm(same[0] - seed) < 1e-4, "a seed that is a solution is the nearest one"
        moved = solver.solutions("flange", pin.SE3(seven_joint_flange(seed + 0.02 * rng.uniform(-1.0, 1.0, 7))), seed)
        assert np.linalg.norm(moved[0] - seed) < 0.02 * np.sqrt(7.0) + 1e-3, "none further than the one it came from"


def test_a_joint_without_ends_is_given_the_turn_nearest_to_the_seed() -> None:
    urdf = SEVEN_JOINT_URDF.replace('name="joint1" type="revolute"', 'name="joint1" type="continuous"')
    turning = RobotModel(urdf, SEVEN_JOINT_SRDF)
    solver = InverseKinematics(turning, turning.group("arm"))
    seed = np.array([20.0, 0.3, 0.1, -1.5, 0.2, 1.6, 0.3])
    found = solver.solutions("flange", pin.SE3(seven_joint_flange(seed)), seed)
    assert np.linalg.norm(found[0] - seed) < 1e-4


def test_a_joint_outside_the_group_stays_where_the_seed_has_it(seven: RobotModel) -> None:
    srdf = SEVEN_JOINT_SRDF.replace('base_link="base"', 'base_link="link1"')
    part = RobotModel(SEVEN_JOINT_URDF, srdf)
    solver = InverseKinematics(part, part.group("arm"))
    assert len(solver.group.joints) == 6
    seed = np.array([1.1, 0.3, 0.1, -1.5, 0.2, 1.6, 0.3])
    found = solver.solutions("flange", pin.SE3(seven_joint_flange(seed)), seed)
    assert found and all(item[0] == 1.1 for item in found)
    assert max(pose_gap(seven_joint_flange(found[0]), seven_joint_flange(seed))) < 1e-6


@pytest.mark.parametrize("arm_of", ["model", "seven"])
def test_a_position_alone_is_reached_by_the_least_motion_found(arm_of: str, request: pytest.FixtureRequest) -> None:
    part = request.getfixturevalue(arm_of)
    group = part.group("arm" if arm_of == "seven" else "arm_and_manipulator")
    solver, rng, point = InverseKinematics(part, group), np.random.default_rng(5), np.array([0.05, -0.02, 0.1])
    nearer = 0
    for _ in range(30):
        ends = part.default_positions(), part.default_positions()
        for positions in ends:
            positions[group.indices] = rng.uniform(np.maximum(part.lower, -2.0), np.minimum(part.upper, 2.0))[
                group.indices
            ]
        seed, there = ends
        position = part.link_transforms(there)[group.tip_link].act(point)
        found = solver.position_solutions(group.tip_link, point, position, seed, 0.5)
        assert found, "the position was taken from a state"
        for positions in found:
            assert np.allclose(part.link_transforms(positions)[group.tip_link].act(point), position, atol=1e-6)
            assert not part.bound_violations(positions, group.indices)
        ways = [float(np.linalg.norm(positions - seed)) for positions in found]
        assert ways == sorted(ways)
        nearer += ways[0] < np.linalg.norm(there - seed)
    assert nearer >= 25, "the orientation is open, so nearer states than the one it came from are there"


def test_a_position_out_of_reach_has_no_solution(model: RobotModel, solver: InverseKinematics) -> None:
    seed = model.default_positions()
    assert not solver.position_solutions(TIP, np.zeros(3), np.array([0.0, 0.0, 4.0]), seed, 0.05)


def test_kinematics_yaml_is_read_and_its_faults_are_reported(model: RobotModel) -> None:
    read = settings_from(
        {
            "arm": {
                "kinematics_solver": "kdl_kinematics_plugin/KDLKinematicsPlugin",
                "kinematics_solver_search_resolution": 0.005,
                "kinematics_solver_timeout": 0.01,
                "kinematics_solver_attempts": 3,
                "position_only_ik": True,
            }
        }
    )
    assert read["arm"] == KinematicsSettings("kdl_kinematics_plugin/KDLKinematicsPlugin", 0.005, 0.01, 3, True)
    assert KinematicsPool(model, read).solver("arm").settings.attempts == 3
    for bad in (
        {"arm": 3},
        {"arm": {"kinematics_solver_timeout": "soon"}},
        {"arm": {"kinematics_solver_timeout": 0}},
        {"arm": {"kinematics_solver_search_resolution": -0.1}},
        {"arm": {"position_only_ik": "yes"}},
    ):
        with pytest.raises(PlanningError, match="kinematics.yaml"):
            settings_from(bad)


@pytest.mark.parametrize("name", ["numerik", "kdl_kinematics_plugin/KDLKinematicPlugin", "kdl/KDLKinematicsPlugin"])
def test_a_misspelt_solver_of_kinematics_yaml_is_refused_with_the_known_ones(name: str) -> None:
    with pytest.raises(PlanningError, match=f"'arm'.*'{name}'; allowed: numeric, kdl_kinematics_plugin/"):
        settings_from({"arm": {"kinematics_solver": name}})


@pytest.mark.parametrize("name", ["", "numeric", "my_arm/MyPlugin", "my_arm_arm_kinematics/IKFastKinematicsPlugin"])
def test_own_and_generated_plugins_may_stand_in_kinematics_yaml(name: str) -> None:
    assert settings_from({"arm": {"kinematics_solver": name}})["arm"].solver == name


def test_a_solver_names_the_method_that_solves(model: RobotModel, seven: RobotModel) -> None:
    def method(robot: RobotModel, name: str) -> str:
        return KinematicsPool(robot, settings_from({"arm": {"kinematics_solver": name}})).solver("arm").method

    assert method(model, "kdl_kinematics_plugin/KDLKinematicsPlugin") == "closed form"
    assert method(model, "numeric") == method(seven, "numeric") == "numeric"
    assert method(seven, "") == "closed form and search"


def test_of_about_equally_near_solutions_the_one_with_most_clearance_is_taken() -> None:
    seed = np.zeros(2)
    free = [np.array([0.30, 0.0]), np.array([0.35, 0.0]), np.array([0.9, 0.0])]
    clearances = {0.30: 0.01, 0.35: 0.05, 0.9: 0.5}
    assert clearest(free, seed, lambda values: clearances[float(values[0])]) is free[1]
    assert clearest([seed, *free], seed, lambda values: 0.0) is seed


def test_warming_up_compiles_every_loop_for_the_types_it_is_used_with(model: RobotModel, seven: RobotModel) -> None:
    compiled_kinematics.warm_up()
    loops = [
        getattr(compiled_kinematics, name)
        for name in ("polish", "search", "approach_seed", "unique_rows", "full_rotations", "joint_placements")
    ]
    before = [len(loop.signatures) for loop in loops]
    for robot, group in ((model, "arm"), (seven, "arm")):
        solver, seed = InverseKinematics(robot, robot.group(group)), robot.default_positions()
        tip = robot.group(group).tip_link
        assert solver.solutions(tip, robot.link_transforms(seed)[tip], seed)
    assert [len(loop.signatures) for loop in loops] == before
