# SPDX-License-Identifier: BSD-3-Clause
"""Passive joints of a group: goals, inverse kinematics and lines leave them where they are, as do trajectories."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("moveit_msgs.msg", reason="source the workspace: the messages are not built")

from geometry_msgs.msg import Quaternion  # noqa: E402
from moveit_msgs.msg import Constraints, JointConstraint, OrientationConstraint  # noqa: E402

from modular_framework_planning.cartesian.cartesian_path import straight_line  # noqa: E402
from modular_framework_planning.errors import ErrorCode, PlanningError  # noqa: E402
from modular_framework_planning.geometry.spatial import Transform  # noqa: E402
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool  # noqa: E402
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.messages.constraint_conversions import constraints_from_message  # noqa: E402
from modular_framework_planning.messages.conversions import goals_from_constraints  # noqa: E402
from modular_framework_planning.planners.ompl.planner import OmplPlanner  # noqa: E402
from modular_framework_planning.planners.pilz.command_planner import CommandPlanner  # noqa: E402
from modular_framework_planning.planners.stomp.planner import StompPlanner  # noqa: E402
from modular_framework_planning.planning_interface.planning_request import (  # noqa: E402
    PipelineSettings,
    PlanningRequest,
    PlanningResult,
    PoseGoal,
)
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline  # noqa: E402
from modular_framework_planning.planning_pipeline.plugins import make_adapters  # noqa: E402
from modular_framework_planning.planning_scene.planning_scene import PlanningScene, empty_scene  # noqa: E402
from modular_framework_planning.robot_model.robot_model import RobotModel  # noqa: E402

AXES = {"turn": "0 0 1", "lift": "0 1 0", "elbow": "0 1 0", "wrist": "0 1 0", "roll": "0 0 1"}
SPRING = "spring"  # between the flange and the palm
JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="0 0 {height}"/><axis xyz="{axis}"/><limit lower="{low}" upper="{high}" velocity="2" effort="9"/></joint>
<link name="{child}"/>"""


def urdf(order: Sequence[str] = (*AXES, SPRING)) -> str:
    """An arm whose joints have the given order, with a finger."""
    text, parent = '<robot name="sprung"><link name="base"/>', "base"
    for name in order:
        child = "palm" if name == order[-1] else f"{name}_link"
        own = {"name": name, "parent": parent, "child": child, "axis": AXES.get(name, "0 0 1")}
        if name == SPRING:
            text += JOINT.format(**own, kind="prismatic", height=0.03, low=-0.01, high=0.03)
        else:
            text += JOINT.format(**own, kind="revolute", height=0.25, low=-2.5, high=2.5)
        parent = child
    finger = {"name": "finger", "kind": "prismatic", "parent": "palm", "child": "tip", "axis": "1 0 0"}
    return text + JOINT.format(**finger, height=0.02, low=0.0, high=0.03) + "</robot>"


SRDF = f"""<robot name="sprung"><group name="arm"><chain base_link="base" tip_link="palm"/></group>
<passive_joint name="{SPRING}"/></robot>"""
MODEL = RobotModel(urdf(), SRDF)
MIDDLE = RobotModel(urdf(("turn", "lift", SPRING, "elbow", "wrist", "roll")), SRDF)
BENT = {"turn": 0.3, "lift": 0.5, "elbow": 0.9, "wrist": 0.4, "roll": -0.2, SPRING: 0.015}
LIMITS = {"max_trans_vel": 0.5, "max_trans_acc": 1.0, "max_trans_dec": -1.0, "max_rot_vel": 1.57}
PLANNERS = {
    "RRTConnect": lambda model, settings: OmplPlanner(),
    "STOMP": StompPlanner.configure,
    "LIN": lambda model, settings: CommandPlanner(LIMITS),
}


def scene_at(model: RobotModel = MODEL, /, **values: float) -> PlanningScene:
    return empty_scene(model, model.merge(model.default_positions(), {**BENT, **values}))


def palm(positions: np.ndarray, model: RobotModel = MODEL) -> Transform:
    return model.link_transforms(positions)["palm"]


def answered(
    scene: PlanningScene, goals: tuple[object, ...], planner: str = "RRTConnect", **request: object
) -> PlanningResult:
    """The answer of a pipeline, whose motion names no passive joint."""
    model, parameters = scene.model, PipelineSettings(seed=1)
    pipeline = PlanningPipeline(
        KinematicsPool(model), parameters, PLANNERS[planner](model, parameters), adapters=make_adapters()
    )
    answer = pipeline.plan(
        PlanningRequest(scene, "arm", goals, planner_id=planner, allowed_time_s=600.0, **request)  # type: ignore[arg-type]
    )
    assert answer.trajectory.joint_names == tuple(AXES) and answer.goal[model.index[SPRING]] == BENT[SPRING]
    return answer


def planned(scene: PlanningScene, goals: tuple[object, ...]) -> np.ndarray:
    """Joint positions at the end of a motion."""
    return answered(scene, goals).goal


@pytest.mark.parametrize(("wanted", "is_warned"), [(BENT[SPRING], False), (0.0, True)])
def test_a_joint_goal_may_name_a_passive_joint(
    wanted: float, is_warned: bool, caplog: pytest.LogCaptureFixture
) -> None:
    values = {**BENT, "turn": -0.5, SPRING: wanted}
    message = Constraints(joint_constraints=[JointConstraint(name, at, 1e-3, 1e-3, 1) for name, at in values.items()])
    goal = planned(scene_at(), goals_from_constraints(scene_at(), [message], "palm"))
    assert goal[MODEL.index["turn"]] == pytest.approx(-0.5, abs=2e-3)
    assert ("'spring' is +0.0150 from 0.0000" in caplog.text and "the joint is passive" in caplog.text) == is_warned


@pytest.mark.parametrize("model", [MODEL, MIDDLE], ids=["at the end", "in the middle"])
@settings(max_examples=25, deadline=None)
@given(spring=st.floats(-0.01, 0.03), values=st.tuples(*[st.floats(-1.2, 1.2)] * 5))
def test_ik_of_the_link_beyond_a_passive_joint_leaves_it_where_it_is(
    model: RobotModel, spring: float, values: tuple[float, ...]
) -> None:
    target = palm(scene_at(model, **dict(zip(AXES, values, strict=True)), **{SPRING: spring}).positions, model)
    seed = scene_at(model, **{SPRING: spring}).positions
    found = KinematicsPool(model).solver("arm").solutions("palm", target, seed, timeout_s=5.0)
    assert found and all(item[model.index[SPRING]] == seed[model.index[SPRING]] for item in found)
    assert np.abs(pin.log6(palm(found[0], model).actInv(target)).vector).max() < 1e-6


def test_the_reach_of_an_arm_includes_a_passive_joint_between_its_joints() -> None:
    solver = KinematicsPool(MIDDLE).solver("arm")
    stretched = scene_at(MIDDLE, **dict.fromkeys(AXES, 0.0), **{SPRING: 0.03}).positions
    length = palm(stretched, MIDDLE).translation[2] - 0.25  # above the first joint
    assert length == pytest.approx(4 * 0.25 + 0.03 + 0.03)
    assert length <= solver.reach < length + 0.05
    beyond = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.25 + length + 0.1]))
    assert "the arm reaches at most 1.060 m" in solver.explain_unreachable("palm", beyond, stretched)


@pytest.mark.parametrize("planner", PLANNERS)
def test_every_planner_moves_the_arm_around_a_passive_joint_in_the_middle(planner: str) -> None:
    scene = scene_at(MIDDLE)
    start = palm(scene.positions, MIDDLE)
    target = start * pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.05]))
    answer = answered(scene, (PoseGoal("palm", target),), planner)
    assert np.abs(pin.log6(palm(answer.goal, MIDDLE).actInv(target)).vector).max() < 1e-4
    if planner == "LIN":
        for row in answer.trajectory.positions:
            pose = start.actInv(palm(MIDDLE.merge(scene.positions, dict(zip(AXES, row, strict=True))), MIDDLE))
            assert np.abs(pose.translation[:2]).max() < 1e-4 and np.abs(pin.log3(pose.rotation)).max() < 1e-3


def test_path_constraints_on_the_link_beyond_a_passive_joint_are_kept() -> None:
    scene = scene_at(MIDDLE, lift=0.5, elbow=1.2, wrist=np.pi - 1.7)  # z of the palm points downwards
    goal = palm(scene_at(MIDDLE, turn=-0.6, lift=0.8, elbow=0.7, wrist=np.pi - 1.5).positions, MIDDLE)
    downwards = OrientationConstraint(link_name="palm", orientation=Quaternion(1.0, 0.0, 0.0, 0.0))
    downwards.header.frame_id = "base"
    downwards.absolute_x_axis_tolerance = downwards.absolute_y_axis_tolerance = 0.1
    downwards.absolute_z_axis_tolerance = 4.0
    message = Constraints(orientation_constraints=[downwards])
    kept = constraints_from_message(scene, message, "path", ErrorCode.INVALID_MOTION_PLAN, "palm")
    answer = answered(scene, (PoseGoal("palm", goal),), path_constraints=kept)
    for row in answer.trajectory.positions:
        pose = palm(MIDDLE.merge(scene.positions, dict(zip(AXES, row, strict=True))), MIDDLE)
        assert np.arccos(np.clip(-pose.rotation[2, 2], -1.0, 1.0)) < 0.15


def test_a_pose_goal_and_a_line_of_the_link_beyond_a_passive_joint_are_reached() -> None:
    scene = scene_at()
    target = palm(scene_at(elbow=1.1, roll=0.4).positions)
    assert np.abs(pin.log6(palm(planned(scene, (PoseGoal("palm", target),))).actInv(target)).vector).max() < 1e-5
    lower = palm(scene.positions)
    lower.translation += palm(scene.positions).rotation @ np.array([0.0, 0.0, -0.02])
    follower = PoseFollower(KinematicsPool(MODEL).solver("arm"), "palm", scene.positions)
    line = straight_line(follower, [lower], 0.005)
    assert line.fraction == 1.0
    end = scene.positions.copy()
    end[MODEL.group("arm").indices] = line.rows[-1]
    assert palm(end).isApprox(lower, 1e-6)


def test_a_link_beyond_an_active_joint_of_another_group_is_refused() -> None:
    with pytest.raises(PlanningError, match="'tip' is not rigidly fixed"):
        KinematicsPool(MODEL).solver("arm").tip_offset("tip", scene_at().positions)
