# SPDX-License-Identifier: BSD-3-Clause
"""Goals become free states, the nearest first; where there is none, the reason says what to change."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from mobile_robots import robot, tool_in_cart

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.constraints.constraint_kinds import (
    FrameOnRobot,
    JointConstraint,
    OrientationConstraint,
    PositionConstraint,
)
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.regions import BoxSolid
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.kinematics.kinematics_settings import KinematicsSettings
from modular_framework_planning.planning_interface.goals import GoalResolver
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.planning_request import (
    ConstraintGoal,
    JointGoal,
    PlanningRequest,
    PoseGoal,
)
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_urdf.mimics import Mimic

GROUP, TIP = "arm_and_manipulator", "eg_manipulator"
DOWN = np.diag([1.0, -1.0, -1.0])
ABOVE = np.array([0.1, 0.5, 1.1])
Resolve = Callable[..., np.ndarray]
WORLD = FrameOnRobot("world", 0, pin.SE3.Identity())


@pytest.fixture(scope="module")
def scene(model: RobotModel) -> PlanningScene:
    positions = model.default_positions()
    positions[model.group(GROUP).indices] = [1.57, -1.57, 1.2, -1.2, -1.57, 0.0]
    return empty_scene(model, positions)


@pytest.fixture(scope="module")
def resolve(model: RobotModel, scene: PlanningScene) -> Resolve:
    def run(*goals: object, world: PlanningScene = scene, path: KinematicConstraints | None = None) -> np.ndarray:
        group = model.group(GROUP)
        checker = ExactCollisionChecker(world, group.indices)
        motion = MotionChecker(checker, group.indices, world.positions)
        found = GoalResolver(
            PlanningRequest(world, GROUP, goals),
            KinematicsPool(model),
            motion,
            np.random.default_rng(1),
            path_constraints=path,
        ).resolve()
        distances = np.linalg.norm(found - world.positions[group.indices], axis=1)
        assert (np.diff(distances) >= 0.0).all(), "nearest first"
        assert all(motion.state_is_free(values) for values in found)
        return found

    return run


def tip(model: RobotModel) -> FrameOnRobot:
    frame = model.pin_model.frames[model.frame_ids[TIP]]
    return FrameOnRobot(TIP, int(frame.parentJoint), frame.placement)


def pose_constraints(model: RobotModel, size: float, tolerances: tuple[float, float, float]) -> KinematicConstraints:
    region = ((BoxSolid(size, size, size), pin.SE3(np.eye(3), ABOVE)),)
    return KinematicConstraints(
        model,
        (),
        [PositionConstraint(tip(model), np.zeros(3), WORLD, region)],
        [OrientationConstraint(tip(model), WORLD, DOWN, np.array(tolerances))],
    )


def full_positions(model: RobotModel, values: np.ndarray) -> np.ndarray:
    positions = model.default_positions()
    positions[model.group(GROUP).indices] = values
    return positions


def with_block(scene: PlanningScene, at: np.ndarray, size: float) -> PlanningScene:
    return scene.with_object(
        CollisionObject("block", pin.SE3(np.eye(3), at), ((Box(size, size, size), pin.SE3.Identity()),))
    )


def test_a_tolerant_pose_is_met_where_the_exact_one_collides(
    model: RobotModel, scene: PlanningScene, resolve: Resolve
) -> None:
    loose = pose_constraints(model, 0.5, (0.2, 0.2, 7.0))
    goal = PoseGoal(TIP, pin.SE3(DOWN, ABOVE), loose)
    blocked = with_block(scene, ABOVE + (0.0, 0.0, 0.09), 0.06)  # where the palm would be
    with pytest.raises(PlanningError, match="'block'") as caught:
        resolve(PoseGoal(TIP, goal.target), world=blocked)
    assert caught.value.code is ErrorCode.GOAL_IN_COLLISION
    for values in resolve(goal, world=blocked):
        assert loose.are_satisfied(full_positions(model, values))


def test_a_free_rotation_makes_a_goal_nearer_than_the_exact_pose(
    model: RobotModel, scene: PlanningScene, resolve: Resolve
) -> None:
    start = scene.positions[model.group(GROUP).indices]
    exact = resolve(PoseGoal(TIP, pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 2.5) @ DOWN, ABOVE)))
    loose = pose_constraints(model, 0.01, (0.05, 0.05, 7.0))
    either = resolve(PoseGoal(TIP, pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 2.5) @ DOWN, ABOVE), loose))
    assert np.linalg.norm(either[0] - start) < np.linalg.norm(exact[0] - start) - 0.1


def test_any_mix_of_constraints_is_a_goal(model: RobotModel, resolve: Resolve) -> None:
    pan = int(model.group(GROUP).indices[0])
    poses = pose_constraints(model, 0.4, (0.3, 0.3, 7.0))
    mixed = KinematicConstraints(
        model, [JointConstraint("pan", pan, 1.3, 0.2, 0.2)], poses.positions, poses.orientations
    )
    found = resolve(ConstraintGoal(mixed))
    assert len(found) > 1
    assert all(mixed.are_satisfied(full_positions(model, values)) for values in found)


def test_goal_states_are_chosen_among_those_that_keep_the_path_constraints(model: RobotModel, resolve: Resolve) -> None:
    goal = PoseGoal(TIP, pin.SE3(DOWN, ABOVE))
    elbow = int(model.group(GROUP).indices[2])
    other_side = KinematicConstraints(model, [JointConstraint("elbow_joint", elbow, -1.5, 1.5, 1.5)])
    assert (resolve(goal)[:, 2] > 0.0).any()
    assert (resolve(goal, path=other_side)[:, 2] <= 1e-6).all()
    nowhere = KinematicConstraints(model, [JointConstraint("elbow_joint", elbow, 0.0, 0.01, 0.01)])
    with pytest.raises(PlanningError, match="path constraints: joint 'elbow_joint'") as caught:
        resolve(goal, path=nowhere)
    assert caught.value.code is ErrorCode.GOAL_VIOLATES_PATH_CONSTRAINTS


def test_reasons_distinguish_an_empty_region_from_one_that_only_collides(
    model: RobotModel, scene: PlanningScene, resolve: Resolve
) -> None:
    far = KinematicConstraints(
        model,
        (),
        [
            PositionConstraint(
                tip(model),
                np.zeros(3),
                WORLD,
                ((BoxSolid(0.1, 0.1, 0.1), pin.SE3(np.eye(3), np.array([0.0, 0.0, 9.0]))),),
            )
        ],
    )
    with pytest.raises(PlanningError, match="goal region was empty: .* m outside its region") as caught:
        resolve(ConstraintGoal(far))
    assert caught.value.code is ErrorCode.GOAL_CONSTRAINTS_VIOLATED
    point = KinematicConstraints(model, (), pose_constraints(model, 0.05, (0.1, 0.1, 0.1)).positions)
    with pytest.raises(PlanningError, match="all .* states .* touches object 'block'") as caught:
        resolve(ConstraintGoal(point), world=with_block(scene, ABOVE, 0.6))
    assert caught.value.code is ErrorCode.GOAL_IN_COLLISION
    with pytest.raises(PlanningError, match="out of reach") as caught:
        resolve(PoseGoal(TIP, pin.SE3(DOWN, np.array([0.0, 0.0, 9.0]))))
    assert caught.value.code is ErrorCode.NO_IK_SOLUTION
    with pytest.raises(PlanningError, match="joint 'elbow_joint' at 9.000000 is outside") as caught:
        resolve(JointGoal({"elbow_joint": 9.0}))
    assert caught.value.code is ErrorCode.GOAL_STATE_INVALID


def test_joint_goals_are_exact_where_they_can_be(resolve: Resolve, scene: PlanningScene, model: RobotModel) -> None:
    goal = JointGoal({"shoulder_pan_joint": 0.4}, {"shoulder_pan_joint": 0.5}, {"shoulder_pan_joint": 0.5})
    found = resolve(goal)
    assert found.shape == (1, 6) and found[0, 0] == 0.4
    at = model.link_transforms(full_positions(model, found[0]))["wrist_2_link"].translation
    moved = resolve(goal, world=with_block(scene, at, 0.1))
    assert 1e-3 < abs(moved[0, 0] - 0.4) <= 0.5


def test_of_several_goals_those_that_can_be_reached_count(resolve: Resolve) -> None:
    found = resolve(JointGoal({"elbow_joint": 9.0}), JointGoal({"elbow_joint": 1.0}), JointGoal({"elbow_joint": 1.1}))
    assert found[:, 2].tolist() == [1.1, 1.0], "the start is at 1.2"


def test_the_same_random_numbers_give_the_same_goal_states(model: RobotModel, resolve: Resolve) -> None:
    goal = ConstraintGoal(pose_constraints(model, 0.4, (0.3, 0.3, 7.0)))
    assert (resolve(goal) == resolve(goal)).all()


MIMICS = {"right": Mimic("left", -2.0, 0.1)}


def test_a_joint_that_mimics_asks_its_leader() -> None:
    goal = JointGoal({"right": 0.05}, {"right": 0.02}, {"right": 0.04}).without_mimic_joints(MIMICS)
    assert goal.positions == pytest.approx({"left": 0.025})
    assert (goal.below["left"], goal.above["left"]) == pytest.approx((0.02, 0.01)), "the multiplier turns them round"
    both = JointGoal({"left": 0.025, "right": 0.05}, {"left": 0.005}, {"left": 0.01}).without_mimic_joints(MIMICS)
    assert both.positions == pytest.approx({"left": 0.025})
    assert (both.below["left"], both.above["left"]) == pytest.approx((0.0, 0.0)), "the narrower range counts"
    with pytest.raises(PlanningError, match="'right' at 0.3000 requires 'left', which it mimics, at -0.1000"):
        JointGoal({"left": 0.025, "right": 0.3}).without_mimic_joints(MIMICS)


def test_position_only_ik_leaves_the_orientation_of_a_pose_goal_open() -> None:
    arm = robot("fixed")  # three joints: hardly any orientation can be reached
    there = tool_in_cart(0.5, 0.9, -0.7)[:3, 3]
    tool = FrameOnRobot("tool", arm.joint_index("elbow") + 1, pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.4])))
    offset = np.array([0.02, 0.0, 0.03])
    constraints = KinematicConstraints(
        arm,
        (),
        [PositionConstraint(tool, offset, WORLD, [(BoxSolid(0.001, 0.001, 0.001), pin.SE3(np.eye(3), there))])],
        [OrientationConstraint(tool, WORLD, DOWN, np.full(3, 0.01))],
    )
    goal = PoseGoal("tool", constraints.pose_target(arm.default_positions()), constraints)
    group, scene = arm.group("arm"), empty_scene(arm)
    checker = ExactCollisionChecker(scene, group.indices)
    motion = MotionChecker(checker, group.indices, scene.positions)

    def resolved(position_only: bool) -> np.ndarray:
        pool = KinematicsPool(arm, {"arm": KinematicsSettings(position_only=position_only)})
        request, rng = PlanningRequest(scene, "arm", (goal,)), np.random.default_rng(1)
        return GoalResolver(request, pool, motion, rng).resolve()

    for pan, lift, elbow in resolved(True):
        reached = tool_in_cart(pan, lift, elbow) @ [*offset, 1.0]
        np.testing.assert_allclose(reached[:3], there, atol=6e-4)
    with pytest.raises(PlanningError, match="no inverse kinematics"):
        resolved(False)
