# SPDX-License-Identifier: BSD-3-Clause
"""Groups with a planar or floating joint: planned in the workspace, timed, returned as multi-DOF trajectories."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from mobile_robots import SRDF, URDF, from_quaternion, robot, shifted, tool_in_cart, turned

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
    PlanningResult,
    PoseGoal,
    Workspace,
)
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_testing.planning.independent_checker import IndependentChecker, sampled_states
from modular_framework_testing.planning.independent_checker import box as solid_box

pytest.importorskip("moveit_msgs.msg", reason="source the workspace: the messages are not built")

from moveit_msgs.msg import Constraints, JointConstraint  # noqa: E402

from modular_framework_planning.messages.conversions import goals_from_constraints, trajectory_message  # noqa: E402

WALL, WALL_AT = (0.2, 3.0, 4.0), (0.0, 0.5, 0.0)  # y from -1 to 2
ROOM = Workspace(np.array([-2.0, -3.0, 0.0]), np.array([2.0, 2.0, 0.5]))  # a way round at the right end only
NARROW = Workspace(np.array([-2.0, -1.0, 0.0]), np.array([2.0, 2.0, 0.5]))
STAND = {
    "planar": {"drive/x": -1.5},
    "floating": {"drive/trans_x": -1.5, "drive/trans_z": 0.2, "lift": 0.3},
}
THERE = {
    "planar": {"drive/x": 1.5, "drive/y": 0.5, "drive/theta": 2.0},
    "floating": {
        "drive/trans_x": 1.5,
        "drive/trans_y": 0.5,
        "drive/trans_z": 0.3,
        "drive/yaw": 2.0,
        "drive/pitch": 0.4,
        "drive/roll": -0.5,
    },
}


def walled(model: RobotModel, kind: str) -> PlanningScene:
    pose = pin.SE3(np.eye(3), np.array(WALL_AT))
    scene = empty_scene(model).with_object(CollisionObject("wall", pose, ((Box(*WALL), pin.SE3.Identity()),)))
    return scene.with_positions(model.merge(scene.positions, STAND[kind]))


def plan(model: RobotModel, request: PlanningRequest) -> PlanningResult:
    settings = PipelineSettings(seed=2, default_velocity_scaling_factor=1.0, default_acceleration_scaling_factor=1.0)
    return PipelineSpec(settings=settings).build(model, KinematicsPool(model)).plan(request)


def matrices(message: object) -> np.ndarray:
    """Poses of the base at the points of a multi-DOF trajectory."""
    rows = []
    for point in message.multi_dof_joint_trajectory.points:
        t, q = point.transforms[0].translation, point.transforms[0].rotation
        rows.append(from_quaternion(np.array([t.x, t.y, t.z]), np.array([q.x, q.y, q.z, q.w])))
    return np.array(rows)


@pytest.mark.parametrize("group", ["base", "all"])
@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_a_base_drives_round_a_wall_without_touching_it_and_stays_in_the_workspace(kind: str, group: str) -> None:
    model = robot(kind)
    scene = walled(model, kind)
    goal = THERE[kind] | ({"pan": 1.0, "elbow": 0.5} if group == "all" else {})
    answer = plan(
        model,
        PlanningRequest(
            scene, group, (JointGoal(goal),), planner_id="", attempts=1, allowed_time_s=20.0, workspace=ROOM
        ),
    )
    motion, names = answer.trajectory, answer.trajectory.joint_names
    for axis, name in enumerate(model.base.translations):
        way = motion.positions[:, names.index(name)]
        assert way.min() >= ROOM.lower[axis] - 1e-6 and way.max() <= ROOM.upper[axis] + 1e-6, name
    for name, value in goal.items():
        assert motion.positions[-1, names.index(name)] == pytest.approx(value)
    checker = IndependentChecker(URDF, SRDF.format(kind=kind), str)
    checker.set_world([("wall", solid_box(*WALL), shifted(*WALL_AT))], base_moves=True)
    rest = dict(zip(model.joint_names, scene.positions.tolist(), strict=True))
    straight = np.array([motion.positions[0], motion.positions[-1]])
    assert checker.touching_pairs(names, sampled_states(straight, 0.01), rest)
    assert not checker.touching_pairs(names, sampled_states(motion.positions, 0.01), rest)
    assert not checker.touching_pairs(names, motion.positions_at(motion.sample_times(0.002)), rest)
    indices = [model.index[name] for name in names]
    assert (np.abs(motion.velocities) <= model.max_velocity[indices] + 1e-6).all()
    assert (np.abs(motion.accelerations) <= model.max_acceleration[indices] + 1e-6).all()
    _check_message(model, answer, group)


def _check_message(model: RobotModel, answer: PlanningResult, group: str) -> None:
    """The message has the base as transforms, the rest as joints, both at the same times."""
    message = trajectory_message(answer.trajectory, model)
    assert message.multi_dof_joint_trajectory.joint_names == ["drive"]
    assert message.multi_dof_joint_trajectory.header.frame_id == "odom"
    assert message.joint_trajectory.joint_names == (["pan", "lift", "elbow"] if group == "all" else [])
    times = [point.time_from_start.to_sec() for point in message.multi_dof_joint_trajectory.points]
    np.testing.assert_allclose(times, answer.trajectory.times, atol=1e-9)
    if group == "all":
        assert [point.time_from_start.to_sec() for point in message.joint_trajectory.points] == times
    found = matrices(message)
    for number in (0, len(times) // 2, -1):
        positions = answer.start.copy()
        positions[[model.index[name] for name in answer.trajectory.joint_names]] = answer.trajectory.positions[number]
        np.testing.assert_allclose(found[number], model.link_transforms(positions)["cart"].homogeneous, atol=1e-9)


def test_a_way_that_leaves_the_workspace_is_no_way() -> None:
    model = robot("planar")
    scene, goal = walled(model, "planar"), JointGoal(THERE["planar"])
    with pytest.raises(PlanningError) as caught:
        plan(
            model,
            PlanningRequest(scene, "base", (goal,), planner_id="", attempts=1, allowed_time_s=1.0, workspace=NARROW),
        )
    assert caught.value.code in (ErrorCode.TIMED_OUT, ErrorCode.PLANNING_FAILED)


def test_without_a_workspace_the_default_one_bounds_the_base() -> None:
    model, goal = robot("planar"), JointGoal({"drive/x": 4.0})
    assert plan(model, PlanningRequest(empty_scene(model), "base", (goal,))).goal[0] == pytest.approx(4.0)
    with pytest.raises(PlanningError, match=r"drive/x.*\[-5.0*, 5.0*\].*workspace_parameters") as caught:
        plan(model, PlanningRequest(empty_scene(model), "base", (JointGoal({"drive/x": 5.5}),)))
    assert caught.value.code == ErrorCode.GOAL_STATE_INVALID


def test_a_start_outside_the_workspace_is_refused() -> None:
    model = robot("planar")
    scene = empty_scene(model)
    scene = scene.with_positions(model.merge(scene.positions, {"drive/y": 4.0}))
    with pytest.raises(PlanningError, match="drive/y") as caught:
        plan(model, PlanningRequest(scene, "base", (JointGoal({"drive/y": 1.0}),), workspace=ROOM))
    assert caught.value.code == ErrorCode.START_STATE_INVALID


def test_a_workspace_does_not_bound_groups_without_the_base() -> None:
    model = robot("planar")
    scene = empty_scene(model)
    scene = scene.with_positions(model.merge(scene.positions, {"drive/y": 40.0}))
    answer = plan(model, PlanningRequest(scene, "arm", (JointGoal({"pan": 1.0}),), workspace=ROOM))
    assert answer.goal[model.index["drive/y"]] == 40.0


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_a_base_and_its_arm_together_reach_a_pose_within_the_workspace(kind: str) -> None:
    model = robot(kind)
    base = shifted(1.2, -2.0, 0.0 if kind == "planar" else 0.3) @ turned("z", 1.0)
    target = base @ tool_in_cart(0.3, 0.9, -0.4)
    request = PlanningRequest(
        walled(model, kind),
        "all",
        (PoseGoal("tool", pin.SE3(target)),),
        planner_id="",
        attempts=1,
        allowed_time_s=20.0,
        workspace=ROOM,
    )
    goal = plan(model, request).goal
    np.testing.assert_allclose(model.link_transforms(goal)["tool"].homogeneous, target, atol=1e-5)
    for axis, name in enumerate(model.base.translations):
        assert ROOM.lower[axis] <= goal[model.index[name]] <= ROOM.upper[axis]


def test_a_pose_far_away_is_solved_where_nothing_bounds_the_base() -> None:
    model = robot("planar")
    target = shifted(60.0, -25.0, 0.0) @ turned("z", 2.5) @ tool_in_cart(0.0, 0.4, 0.6)
    found = KinematicsPool(model).solver("all").solutions("tool", pin.SE3(target), model.default_positions())
    assert found
    np.testing.assert_allclose(model.link_transforms(found[0])["tool"].homogeneous, target, atol=1e-5)


def constraint(name: str, value: float) -> JointConstraint:
    return JointConstraint(joint_name=name, position=value, tolerance_above=1e-3, tolerance_below=1e-3, weight=1.0)


def test_goals_that_moveits_clients_write_of_a_floating_base_mean_its_rotation() -> None:
    model, turn = robot("floating"), turned("z", 2.0) @ turned("y", 0.4) @ turned("x", -0.5)
    quaternion = pin.Quaternion(turn[:3, :3]).coeffs()
    names = ("trans_x", "trans_y", "trans_z", "rot_x", "rot_y", "rot_z", "rot_w")
    items = [
        constraint(f"drive/{name}", value) for name, value in zip(names, (1.0, -1.0, 0.2, *quaternion), strict=True)
    ]
    scene = empty_scene(model)
    (goal,) = goals_from_constraints(scene, [Constraints(joint_constraints=items)], "")
    reached = plan(model, PlanningRequest(scene, "base", (goal,))).goal
    expected = shifted(1.0, -1.0, 0.2) @ turn
    np.testing.assert_allclose(model.link_transforms(reached)["cart"].homogeneous, expected, atol=1e-6)
    with pytest.raises(PlanningError, match=r"rot_x only.*drive/yaw"):
        goals_from_constraints(scene, [Constraints(joint_constraints=items[:4])], "")


def test_a_heading_is_reached_by_the_short_way_round() -> None:
    model = robot("planar")
    scene = empty_scene(model)
    scene = scene.with_positions(model.merge(scene.positions, {"drive/theta": 3.0}))
    answer = plan(model, PlanningRequest(scene, "base", (JointGoal({"drive/theta": -3.0}),)))
    way = answer.trajectory.positions[:, answer.trajectory.joint_names.index("drive/theta")]
    assert abs(way[-1] - way[0]) == pytest.approx(2.0 * np.pi - 6.0) and np.ptp(way) < 0.3


def test_a_joint_without_ends_goes_the_long_way_round_where_the_short_one_is_blocked() -> None:
    model = robot("fixed")
    pole, pole_at = (0.1, 0.1, 2.0), (0.1 + 0.4 * np.cos(1.6), 0.4 * np.sin(1.6), 0.0)
    lid, lid_at = (1.4, 1.4, 0.1), (0.1, 0.0, 0.46)  # keeps the arm level, so that it cannot fold to pass the pole
    scene = empty_scene(model)
    for name, size, at in (("pole", pole, pole_at), ("lid", lid, lid_at)):
        pose = pin.SE3(np.eye(3), np.array(at))
        scene = scene.with_object(CollisionObject(name, pose, ((Box(*size), pin.SE3.Identity()),)))
    reach = {"lift": 1.5, "elbow": 0.3}
    scene = scene.with_positions(model.merge(scene.positions, {"pan": 0.8, **reach}))
    answer = plan(
        model,
        PlanningRequest(
            scene, "arm", (JointGoal({"pan": 2.4, **reach}),), planner_id="", attempts=1, allowed_time_s=4.0
        ),
    )
    way = answer.trajectory.positions[:, answer.trajectory.joint_names.index("pan")]
    assert way[-1] == pytest.approx(2.4 - 2.0 * np.pi)
    checker = IndependentChecker(URDF, SRDF.format(kind="fixed"), str)
    checker.set_world([("pole", solid_box(*pole), shifted(*pole_at)), ("lid", solid_box(*lid), shifted(*lid_at))])
    rest = dict(zip(model.joint_names, scene.positions.tolist(), strict=True))
    assert not checker.touching_pairs(
        answer.trajectory.joint_names, sampled_states(answer.trajectory.positions, 0.01), rest
    )
