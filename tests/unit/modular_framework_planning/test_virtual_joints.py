# SPDX-License-Identifier: BSD-3-Clause
"""A planar or floating virtual joint places the robot: in messages, in kinematics, in collision checks and in plans."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mobile_robots import SRDF, URDF, from_quaternion, robot, tool_in_cart, turned

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.errors import ErrorCode, ModelError, PlanningError
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planning_interface.motion_problems import read_problem
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
    PoseGoal,
)
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.planning_scene.planning_scene import AttachedObject, CollisionObject, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_testing.planning.independent_checker import IndependentChecker
from modular_framework_testing.planning.independent_checker import box as solid_box

pytest.importorskip("moveit_msgs.msg", reason="source the workspace: the messages are not built")

from geometry_msgs.msg import Quaternion, Transform, Vector3  # noqa: E402
from moveit_msgs.msg import RobotState  # noqa: E402
from std_msgs.msg import Header  # noqa: E402

from modular_framework_planning.messages.conversions import scene_with_state, state_message  # noqa: E402
from modular_framework_planning.messages.multi_dof import multi_dof_trajectory  # noqa: E402
from modular_framework_planning.messages.scene_difference import difference_message  # noqa: E402
from modular_framework_planning.messages.scene_messages import apply_scene  # noqa: E402
from modular_framework_planning.trajectory_processing.trajectory import Trajectory  # noqa: E402

ARM = ("pan", "lift", "elbow")
angles = st.floats(-3.1, 3.1)
lengths = st.floats(-5.0, 5.0)
quaternions = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1)


def message_of(position: np.ndarray, quaternion: np.ndarray, name: str = "drive", frame: str = "") -> RobotState:
    state = RobotState(is_diff=True)
    state.multi_dof_joint_state.header = Header(frame_id=frame)
    state.multi_dof_joint_state.joint_names = [name]
    unit = np.asarray(quaternion, float) / np.linalg.norm(quaternion)
    state.multi_dof_joint_state.transforms = [Transform(Vector3(*map(float, position)), Quaternion(*unit.tolist()))]
    return state


def matrix_of(transform: Transform) -> np.ndarray:
    t, q = transform.translation, transform.rotation
    return from_quaternion(np.array([t.x, t.y, t.z]), np.array([q.x, q.y, q.z, q.w]))


def six(twist: object) -> list[float]:
    return [getattr(getattr(twist, part), axis) for part in ("linear", "angular") for axis in "xyz"]


def about_z(angle: float) -> np.ndarray:
    return np.array([0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)])


def arm_at(model: RobotModel, pan: float, lift: float, elbow: float) -> np.ndarray:
    return model.merge(model.default_positions(), dict(zip(ARM, (pan, lift, elbow), strict=True)))


@pytest.mark.parametrize(("kind", "frame"), [("fixed", "cart"), ("planar", "odom"), ("floating", "odom")])
def test_the_planning_frame_is_the_frame_the_base_moves_in(kind: str, frame: str) -> None:
    assert robot(kind).planning_frame == frame
    assert state_message(empty_scene(robot(kind))).joint_state.name == list(ARM)


@settings(max_examples=60, deadline=None)
@given(st.tuples(lengths, lengths, lengths), quaternions, angles, st.floats(-1.9, 1.9), st.floats(-2.4, 2.4))
def test_every_link_follows_a_floating_base(
    position: tuple[float, ...], quaternion: tuple[float, ...], pan: float, lift: float, elbow: float
) -> None:
    model, base = robot("floating"), from_quaternion(np.array(position), np.array(quaternion))
    scene = scene_with_state(
        empty_scene(model, arm_at(model, pan, lift, elbow)), message_of(np.array(position), np.array(quaternion))
    )
    found = model.link_transforms(scene.positions)
    np.testing.assert_allclose(found["cart"].homogeneous, base, atol=1e-9)
    np.testing.assert_allclose(found["tool"].homogeneous, base @ tool_in_cart(pan, lift, elbow), atol=1e-9)
    np.testing.assert_allclose(matrix_of(state_message(scene).multi_dof_joint_state.transforms[0]), base, atol=1e-9)


@pytest.mark.parametrize("pitch", [-np.pi / 2, np.pi / 2])
@pytest.mark.parametrize("yaw", [-2.0, 0.0, 1.0])
def test_a_base_that_points_straight_up_or_down_is_placed_too(pitch: float, yaw: float) -> None:
    model, base = robot("floating"), turned("z", yaw) @ turned("y", pitch) @ turned("x", 0.7)
    positions = model.with_base(model.default_positions(), pin.SE3(base))
    np.testing.assert_allclose(model.link_transforms(positions)["cart"].homogeneous, base, atol=1e-7)


def test_of_a_planar_base_only_position_and_heading_count() -> None:
    model, tilted = robot("planar"), turned("z", 0.5) @ turned("x", 0.2)
    tilted[:3, 3] = 1.0, 2.0, 3.0
    found = model.link_transforms(model.with_base(model.default_positions(), pin.SE3(tilted)))["cart"].homogeneous
    flat = turned("z", np.arctan2(tilted[1, 0], tilted[0, 0]))
    flat[:3, 3] = 1.0, 2.0, 0.0
    np.testing.assert_allclose(found, flat, atol=1e-12)


def test_a_placement_may_be_given_in_any_known_frame() -> None:
    scene = empty_scene(robot("planar")).with_fixed_frames({"dock": pin.SE3(turned("z", np.pi / 2))})
    placed = scene_with_state(scene, message_of([1.0, 0.0, 0.0], about_z(0.0), frame="dock"))
    np.testing.assert_allclose(placed.frame_transform("cart").homogeneous[:3, 3], [0.0, 1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda state: state.multi_dof_joint_state.joint_names.append("wheel"), "1 transforms"),
        (lambda state: state.multi_dof_joint_state.joint_names.__setitem__(0, "drvie"), "drive"),
        (lambda state: setattr(state.multi_dof_joint_state.transforms[0].translation, "x", np.nan), "finite"),
        (lambda state: setattr(state.multi_dof_joint_state.header, "frame_id", "odmo"), "odmo"),
    ],
)
def test_a_placement_that_cannot_be_used_is_refused_with_the_reason(change: object, words: str) -> None:
    state = message_of([0.0, 0.0, 0.0], about_z(0.0))
    change(state)
    with pytest.raises(PlanningError, match=words):
        scene_with_state(empty_scene(robot("planar")), state)


def test_a_fixed_virtual_joint_may_be_named_and_changes_nothing() -> None:
    scene = empty_scene(robot("fixed"))
    assert np.array_equal(scene_with_state(scene, message_of([1.0, 0.0, 0.0], about_z(0.0))).positions, scene.positions)


def test_a_state_that_only_places_the_base_drops_held_objects_as_any_full_state_does() -> None:
    held = AttachedObject(
        CollisionObject("cup", pin.SE3.Identity(), ((Box(0.1, 0.1, 0.1), pin.SE3.Identity()),)), "tool", frozenset()
    )
    scene, state = empty_scene(robot("planar")).with_attached(held), message_of([1.0, 0.0, 0.0], about_z(0.0))
    assert list(scene_with_state(scene, state).attached) == ["cup"]
    state.is_diff = False
    assert not scene_with_state(scene, state).attached


def test_a_held_object_moves_with_the_base() -> None:
    model = robot("planar")
    grip = pin.SE3(turned("x", 0.3))
    held = AttachedObject(
        CollisionObject("cup", grip, ((Box(0.1, 0.1, 0.1), pin.SE3.Identity()),)), "tool", frozenset({"fore"})
    )
    scene = empty_scene(model, arm_at(model, 0.2, 0.3, 0.4)).with_attached(held)
    moved = scene_with_state(scene, message_of([2.0, -1.0, 0.0], about_z(1.2)))
    base = from_quaternion(np.array([2.0, -1.0, 0.0]), about_z(1.2))
    expected = base @ tool_in_cart(0.2, 0.3, 0.4) @ turned("x", 0.3)
    np.testing.assert_allclose(moved.attached_pose("cup").homogeneous, expected, atol=1e-9)
    np.testing.assert_allclose(moved.frame_transform("cup").homogeneous, expected, atol=1e-9)


def test_a_client_that_follows_scene_changes_sees_the_base_move() -> None:
    before = empty_scene(robot("floating"))
    after = scene_with_state(before, message_of([1.0, 2.0, 3.0], np.array([0.1, 0.2, 0.3, 0.9])))
    copy = apply_scene(before, difference_message(before, after))
    np.testing.assert_allclose(copy.positions, after.positions, atol=1e-9)
    assert difference_message(after, copy) is None


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_collision_verdicts_follow_the_base_as_a_second_checker_says(kind: str) -> None:
    model, rng = robot(kind), np.random.default_rng(4)
    poses = [(name, rng.uniform(-0.8, 0.8, 3)) for name in "abcd"]
    scene, checker = empty_scene(model), IndependentChecker(URDF, SRDF.format(kind=kind), str)
    for name, at in poses:
        body = CollisionObject(name, pin.SE3(np.eye(3), at), ((Box(0.4, 0.3, 0.2), pin.SE3.Identity()),))
        scene = scene.with_object(body)
    checker.set_world(
        [(name, solid_box(0.4, 0.3, 0.2), from_quaternion(at, about_z(0.0))) for name, at in poses], base_moves=True
    )
    every = ExactCollisionChecker(scene)
    verdicts = []
    for _ in range(300):
        positions = rng.uniform(np.maximum(model.lower, -0.8), np.minimum(model.upper, 0.8))
        verdicts.append(every.is_free(positions))
        named = dict(zip(model.joint_names, positions.tolist(), strict=True))
        assert verdicts[-1] == (not checker.collisions(named)), named
    assert 20 < sum(verdicts) < 280


def test_a_base_that_stands_on_an_object_does_not_keep_the_arm_from_moving() -> None:
    model = robot("planar")
    floor = CollisionObject(
        "floor", pin.SE3(np.eye(3), np.array([0, 0, -0.04])), ((Box(4, 4, 0.1), pin.SE3.Identity()),)
    )
    scene = empty_scene(model).with_object(floor)
    arm, everything = model.group("arm").indices, range(len(model.joint_names))
    assert ExactCollisionChecker(scene, arm).is_free(scene.positions)
    assert not ExactCollisionChecker(scene, arm).fixed_contacts(scene.positions)
    assert not ExactCollisionChecker(scene, everything).is_free(scene.positions)
    assert not ExactCollisionChecker(scene, model.group("base").indices).is_free(scene.positions)


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_an_arm_on_a_placed_base_plans_round_what_is_in_its_way(kind: str) -> None:
    model = robot(kind)
    wall, at = Box(0.1, 0.1, 1.5), np.array([1.0 + 0.1, 2.0 + 0.5, 0.5])  # half a metre from the pan axis
    scene = empty_scene(model).with_object(
        CollisionObject("wall", pin.SE3(np.eye(3), at), ((wall, pin.SE3.Identity()),))
    )
    scene = scene_with_state(scene, message_of([1.0, 2.0, 0.0], about_z(0.0)))
    scene = scene.with_positions(model.merge(scene.positions, {"pan": 0.8, "lift": 1.2, "elbow": 0.3}))
    goal = JointGoal({"pan": 2.4, "lift": 1.2, "elbow": 0.3})
    pipeline = PipelineSpec(settings=PipelineSettings(seed=1)).build(model, KinematicsPool(model))
    answer = pipeline.plan(PlanningRequest(scene, "arm", (goal,), allowed_time_s=10.0))
    checker = IndependentChecker(URDF, SRDF.format(kind=kind), str)
    checker.set_world([("wall", solid_box(0.1, 0.1, 1.5), from_quaternion(at, about_z(0.0)))])
    rest = dict(zip(model.joint_names, answer.start.tolist(), strict=True))
    straight = np.array([[0.8, 1.2, 0.3], [2.4, 1.2, 0.3]])
    assert checker.colliding_states(ARM, straight, rest) > 0
    assert checker.colliding_states(ARM, answer.trajectory.positions, rest) == 0
    np.testing.assert_allclose(answer.goal[model.base_indices], scene.positions[model.base_indices])


def test_a_pose_goal_is_reached_where_it_is_in_the_planning_frame() -> None:
    model = robot("planar")
    scene = scene_with_state(empty_scene(model), message_of([3.0, -2.0, 0.0], about_z(2.0)))
    base = from_quaternion(np.array([3.0, -2.0, 0.0]), about_z(2.0))
    target = base @ tool_in_cart(0.4, 0.9, -0.5)
    found = KinematicsPool(model).solver("arm").solutions("tool", pin.SE3(target), scene.positions)
    assert found
    for positions in found:
        pan, lift, elbow = (positions[model.index[name]] for name in ARM)
        np.testing.assert_allclose(base @ tool_in_cart(pan, lift, elbow), target, atol=1e-5)
    pipeline = PipelineSpec(settings=PipelineSettings(seed=1)).build(model, KinematicsPool(model))
    answer = pipeline.plan(PlanningRequest(scene, "arm", (PoseGoal("tool", pin.SE3(target)),)))
    np.testing.assert_allclose(model.link_transforms(answer.goal)["tool"].homogeneous, target, atol=1e-5)


def test_the_twists_of_a_trajectory_are_the_rates_of_its_poses() -> None:
    model = robot("floating")
    rng, times = np.random.default_rng(2), np.linspace(0.0, 1.0, 1001)
    amplitude, phase = rng.uniform(0.2, 0.9, 6), rng.uniform(0.0, 3.0, 6)
    wave = times[:, None] + phase
    motion = Trajectory(
        model.base.variables, times, amplitude * np.sin(wave), amplitude * np.cos(wave), -amplitude * np.sin(wave)
    )
    points = multi_dof_trajectory(model, motion).points
    matrices = np.array([matrix_of(point.transforms[0]) for point in points])
    step = times[1]
    velocities, accelerations = (
        np.array([six(getattr(point, name)[0]) for point in points]) for name in ("velocities", "accelerations")
    )
    rates = (matrices[2:] - matrices[:-2]) / (2.0 * step)
    spins = rates[:, :3, :3] @ matrices[1:-1, :3, :3].transpose(0, 2, 1)  # angular velocity as a skew matrix
    measured = np.stack([*rates[:, :3, 3].T, spins[:, 2, 1], spins[:, 0, 2], spins[:, 1, 0]], axis=1)
    np.testing.assert_allclose(velocities[1:-1], measured, atol=1e-4)
    np.testing.assert_allclose(accelerations[1:-1], (velocities[2:] - velocities[:-2]) / (2.0 * step), atol=1e-4)


@pytest.mark.parametrize(
    ("joint", "words"),
    [
        ('type="ball" parent_frame="odom" child_link="cart"', "fixed, planar and floating"),
        ('type="planar" parent_frame="tool" child_link="cart"', "'tool'.*must not be empty or a link of the robot"),
        ('type="floating" parent_frame="" child_link="cart"', "must not be empty"),
    ],
)
def test_a_virtual_joint_that_cannot_be_used_is_refused(joint: str, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        RobotModel(URDF, f'<robot name="cart"><virtual_joint name="drive" {joint}/></robot>')


def test_a_virtual_joint_of_another_link_is_noted_and_left_out() -> None:
    joint = '<virtual_joint name="drive" type="planar" parent_frame="odom" child_link="tool"/>'
    model = RobotModel(URDF, f'<robot name="cart">{joint}</robot>')
    assert model.planning_frame == "cart" and "'drive'" in model.document.notes[0]


def test_limits_of_the_base_are_read_as_yaml_and_the_parameter_server_hold_them() -> None:
    entry = {"has_velocity_limits": True, "max_velocity": 0.25}
    for limits in ({"drive/theta": entry}, {"drive": {"theta": entry}}):
        model = RobotModel(URDF, SRDF.format(kind="planar"), limits)
        assert model.max_velocity[model.index["drive/theta"]] == 0.25


SCENE = """robot_state:
  multi_dof_joint_state:
    {joint_names: [drive], transforms: [{translation: [0, 5, 0], rotation: [0, 0, 0, 1]}]}
world:
  collision_objects:
    - id: crate
      header: {frame_id: cart}
      primitives: [{type: box, dimensions: [0.1, 0.1, 0.1]}]
      primitive_poses: [{position: [1, 0, 0], orientation: [0, 0, 0, 1]}]
"""
REQUEST = """start_state:
  joint_state: {name: [pan], position: [0.5]}
  multi_dof_joint_state:
    {joint_names: [drive], transforms: [{translation: [2, 3, 0], rotation: [0, 0, 0.6, 0.8]}]}
goal_constraints: [{joint_constraints: [{joint_name: pan, position: 1.0}]}]
group_name: arm
"""


def test_problems_kept_as_yaml_place_the_base(tmp_path: Path) -> None:
    (tmp_path / "scene0001.yaml").write_text(SCENE)
    (tmp_path / "request0001.yaml").write_text(REQUEST)
    model = robot("planar")
    problem = read_problem(model, tmp_path / "scene0001.yaml", tmp_path / "request0001.yaml", 1.0)
    scene = problem.request.scene
    _, pose = scene.objects["crate"].shapes[0]
    np.testing.assert_allclose((scene.objects["crate"].pose * pose).translation, [1.0, 5.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(scene.positions[model.base_indices], [2.0, 3.0, 2.0 * np.arcsin(0.6)])


def test_an_unknown_joint_of_a_goal_is_refused_by_name() -> None:
    model = robot("planar")
    pipeline = PipelineSpec(settings=PipelineSettings(seed=1)).build(model, KinematicsPool(model))
    with pytest.raises(PlanningError) as caught:
        pipeline.plan(PlanningRequest(empty_scene(model), "arm", (JointGoal({"drive/x": 1.0}),)))
    assert caught.value.code == ErrorCode.INVALID_GOAL_CONSTRAINTS and "drive/x" in caught.value.reason
