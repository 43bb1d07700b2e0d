# SPDX-License-Identifier: BSD-3-Clause
"""Groups of two arms, with a torso, of subgroups; passive joints; end effectors that several groups move."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from mobile_robots import shifted
from wide_robots import SRDF, URDF, robot, tool

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.constraints.constraint_kinds import (
    FrameOnRobot,
    OrientationConstraint,
    PositionConstraint,
)
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.errors import PlanningError
from modular_framework_planning.geometry.regions import SphereSolid
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planning_interface.planning_request import (
    ConstraintGoal,
    JointGoal,
    PipelineSettings,
    PlanningRequest,
    PlanningResult,
    PoseGoal,
)
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.end_effectors import choose_end_effector, hand_links
from modular_framework_testing.planning.independent_checker import IndependentChecker, sampled_states
from modular_framework_testing.planning.independent_checker import box as solid_box

ARM = ("pan", "lift", "elbow", "roll")
SIDES = ("left", "right")


def plan(request: PlanningRequest) -> PlanningResult:
    settings = PipelineSettings(seed=2, default_velocity_scaling_factor=1.0, default_acceleration_scaling_factor=1.0)
    return PipelineSpec(settings=settings).build(robot(), KinematicsPool(robot())).plan(request)


def named(positions: np.ndarray) -> dict[str, float]:
    return dict(zip(robot().joint_names, positions.tolist(), strict=True))


def arm(side: str, *values: float) -> dict[str, float]:
    return {f"{side}_{name}": value for name, value in zip(ARM, values, strict=True)}


@pytest.mark.parametrize(
    ("group", "joints", "tip"),
    [
        ("left", ["left_pan", "left_lift", "left_elbow", "left_roll"], "left_tool"),
        ("left_with_torso", ["hoist", "left_pan", "left_lift", "left_elbow", "left_roll"], "left_tool"),
        ("left_by_chain", ["hoist", "left_pan", "left_lift", "left_elbow", "left_roll"], "left_tool"),
        ("left_hand", ["left_finger"], ""),
        ("arms", [f"{side}_{name}" for side in SIDES for name in ARM], ""),
        ("body", ["hoist", *(f"{side}_{name}" for side in SIDES for name in ARM)], ""),
        ("listed", ["hoist", "head_pan"], "head"),
    ],
)
def test_a_group_moves_the_joints_that_its_members_name(group: str, joints: list[str], tip: str) -> None:
    found = robot().group(group)
    assert sorted(found.joints) == sorted(joints), "mimic and passive joints follow, they are not planned for"
    if tip:
        assert found.is_chain and found.tip_link == tip


@pytest.mark.parametrize("group", ["left_with_torso", "left_by_chain"])
def test_an_arm_with_a_torso_reaches_where_the_arm_alone_cannot(group: str) -> None:
    values = {"hoist": 0.35, **arm("left", 0.3, -0.9, 0.8, 0.2)}
    target, scene = tool("left", values), empty_scene(robot())
    pool = KinematicsPool(robot())
    assert not pool.solver("left").solutions("left_tool", pin.SE3(target), scene.positions)
    goal = plan(PlanningRequest(scene, group, (PoseGoal("left_tool", pin.SE3(target)),))).goal
    np.testing.assert_allclose(tool("left", named(goal)), target, atol=1e-5)


def crossing() -> tuple[PlanningScene, JointGoal]:
    """The arms reach forward; both are to turn to the left."""
    start = {**arm("left", -0.3, 0.0, 0.3, 0.0), **arm("right", -0.4, 0.0, 0.3, 0.0)}
    model = robot()
    goal = JointGoal({**arm("left", 0.4, 0.0, 0.3, 0.0), **arm("right", 0.3, 0.0, 0.3, 0.0)})
    return empty_scene(model, model.merge(model.default_positions(), start)), goal


def test_two_arms_move_at_the_same_time_and_do_not_touch_each_other() -> None:
    scene, goal = crossing()
    pillar, at = Box(0.06, 0.06, 1.2), np.array([0.65, 0.32, 0.8])  # in the way of the left arm
    scene = scene.with_object(CollisionObject("pillar", pin.SE3(np.eye(3), at), ((pillar, pin.SE3.Identity()),)))
    motion = plan(PlanningRequest(scene, "arms", (goal,), planner_id="", attempts=1, allowed_time_s=20.0)).trajectory
    checker = IndependentChecker(URDF, SRDF, str)
    checker.set_world([("pillar", solid_box(0.06, 0.06, 1.2), shifted(*at))])
    rest = named(scene.positions)
    straight = np.array([motion.positions[0], motion.positions[-1]])
    assert checker.touching_pairs(motion.joint_names, sampled_states(straight, 0.01), rest)
    assert not checker.touching_pairs(motion.joint_names, sampled_states(motion.positions, 0.01), rest)
    assert not checker.touching_pairs(motion.joint_names, motion.positions_at(motion.sample_times(0.005)), rest)
    for side in SIDES:
        columns = [motion.joint_names.index(f"{side}_{name}") for name in ARM]
        assert np.ptp(motion.positions[:, columns], axis=0).max() > 0.5


def test_arms_that_touch_each_other_are_found_as_a_second_checker_finds_them() -> None:
    model, rng, checker = robot(), np.random.default_rng(5), IndependentChecker(URDF, SRDF, str)
    group, scene, found = model.group("arms"), empty_scene(robot()), []
    verdicts = ExactCollisionChecker(scene, group.indices)
    for _ in range(400):
        positions = model.default_positions()
        positions[group.indices] = rng.uniform(-0.5, 0.5, len(group.joints))
        for side, inward in (("left", -1.0), ("right", 1.0)):
            positions[model.index[f"{side}_pan"]] = inward * rng.uniform(0.0, 1.0)
        touching = checker.collisions(named(positions))
        assert verdicts.is_free(positions) == (not touching), touching
        found += touching
    assert sum({body.split("_")[0] for body in pair} == set(SIDES) for pair in found) > 10


def pose_of(side: str, target: np.ndarray) -> tuple[PositionConstraint, OrientationConstraint]:
    model = robot()
    frame = model.pin_model.frames[model.frame_ids[f"{side}_tool"]]
    link = FrameOnRobot(f"{side}_tool", int(frame.parentJoint), frame.placement)
    world = FrameOnRobot("foot", 0, pin.SE3.Identity())
    region = (SphereSolid(1e-4), pin.SE3(np.eye(3), target[:3, 3]))
    return (
        PositionConstraint(link, np.zeros(3), world, (region,)),
        OrientationConstraint(link, world, target[:3, :3], np.full(3, 1e-3)),
    )


@pytest.mark.parametrize("group", ["arms", "body"])
def test_each_arm_of_a_group_gets_a_pose_of_its_own(group: str) -> None:
    values = {**arm("left", 0.4, 0.5, 0.4, 0.3), **arm("right", -0.5, -0.4, 0.9, -0.2)}
    targets = {side: tool(side, values) for side in SIDES}
    pairs = [pose_of(side, targets[side]) for side in SIDES]
    goal = ConstraintGoal(KinematicConstraints(robot(), (), [p for p, _ in pairs], [o for _, o in pairs]))
    reached = named(
        plan(PlanningRequest(empty_scene(robot()), group, (goal,), planner_id="", attempts=1, allowed_time_s=20.0)).goal
    )
    for side in SIDES:
        found = tool(side, reached)
        np.testing.assert_allclose(found[:3, 3], targets[side][:3, 3], atol=2e-4)
        np.testing.assert_allclose(found[:3, :3], targets[side][:3, :3], atol=2e-3)


def test_a_motion_of_one_arm_leaves_the_other_arm_and_passive_joints_where_they_are() -> None:
    model, start = robot(), {"right_lift": 0.7, "left_pad": 0.2, "right_pad": -0.1, "left_finger": 0.03}
    scene = empty_scene(model, model.merge(model.default_positions(), start))
    answer = plan(PlanningRequest(scene, "left", (JointGoal({"left_pan": 1.0}),)))
    assert {name: named(answer.goal)[name] for name in start} == pytest.approx(start)
    assert named(answer.goal)["left_thumb"] == pytest.approx(0.03)
    assert answer.trajectory.joint_names == robot().group("left").joints


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("group", ["{}", "{}_with_torso", "{}_by_chain"])
def test_every_group_that_moves_a_gripper_can_use_it(side: str, group: str) -> None:
    chosen, effector = choose_end_effector(robot(), group.format(side), "")
    assert (chosen.name, effector.name) == (group.format(side), f"{side}_gripper")
    assert set(hand_links(robot(), effector)) == {f"{side}_{part}_link" for part in ("finger", "thumb", "pad")}


@pytest.mark.parametrize("side", SIDES)
def test_of_the_grippers_of_two_arms_one_is_named(side: str) -> None:
    chosen, effector = choose_end_effector(robot(), "arms", f"{side}_gripper")
    assert (chosen.name, effector.group) == (side, f"{side}_hand")
    with pytest.raises(PlanningError, match="left_gripper, right_gripper"):
        choose_end_effector(robot(), "arms", "")
