# SPDX-License-Identifier: BSD-3-Clause
"""Passive joints of a group: goals, inverse kinematics and lines leave them where they are, as do trajectories."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("moveit_msgs.msg", reason="source the workspace: the messages are not built")

from moveit_msgs.msg import Constraints, JointConstraint  # noqa: E402

from modular_framework_planning.cartesian.cartesian_path import straight_line  # noqa: E402
from modular_framework_planning.errors import PlanningError  # noqa: E402
from modular_framework_planning.geometry.spatial import Transform  # noqa: E402
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool  # noqa: E402
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.messages.conversions import goals_from_constraints  # noqa: E402
from modular_framework_planning.planners.ompl.planner import OmplPlanner  # noqa: E402
from modular_framework_planning.planning_interface.planning_request import (  # noqa: E402
    PipelineSettings,
    PlanningRequest,
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


def urdf() -> str:
    text, parent = '<robot name="sprung"><link name="base"/>', "base"
    for name, axis in AXES.items():
        text += JOINT.format(
            name=name, kind="revolute", parent=parent, child=f"{name}_link", height=0.25, axis=axis, low=-2.5, high=2.5
        )
        parent = f"{name}_link"
    spring = {"name": SPRING, "kind": "prismatic", "parent": parent, "child": "palm", "axis": "0 0 1"}
    text += JOINT.format(**spring, height=0.03, low=-0.01, high=0.03)
    finger = {"name": "finger", "kind": "prismatic", "parent": "palm", "child": "tip", "axis": "1 0 0"}
    return text + JOINT.format(**finger, height=0.02, low=0.0, high=0.03) + "</robot>"


SRDF = f"""<robot name="sprung"><group name="arm"><chain base_link="base" tip_link="palm"/></group>
<passive_joint name="{SPRING}"/></robot>"""
MODEL = RobotModel(urdf(), SRDF)
BENT = {"turn": 0.3, "lift": 0.5, "elbow": 0.9, "wrist": 0.4, "roll": -0.2, SPRING: 0.015}


def scene_at(**values: float) -> PlanningScene:
    return empty_scene(MODEL, MODEL.merge(MODEL.default_positions(), {**BENT, **values}))


def palm(positions: np.ndarray) -> Transform:
    return MODEL.link_transforms(positions)["palm"]


def planned(scene: PlanningScene, goals: tuple[object, ...]) -> np.ndarray:
    """Joint positions of a motion, and that it names no passive joint."""
    pipeline = PlanningPipeline(
        KinematicsPool(MODEL), PipelineSettings(seed=1), OmplPlanner(), adapters=make_adapters()
    )
    answer = pipeline.plan(PlanningRequest(scene, "arm", goals, planner_id="RRTConnect", allowed_time_s=30.0))
    assert answer.trajectory.joint_names == tuple(AXES) and answer.goal[MODEL.index[SPRING]] == BENT[SPRING]
    return answer.goal


@pytest.mark.parametrize(("wanted", "is_warned"), [(BENT[SPRING], False), (0.0, True)])
def test_a_joint_goal_may_name_a_passive_joint(
    wanted: float, is_warned: bool, caplog: pytest.LogCaptureFixture
) -> None:
    values = {**BENT, "turn": -0.5, SPRING: wanted}
    message = Constraints(joint_constraints=[JointConstraint(name, at, 1e-3, 1e-3, 1) for name, at in values.items()])
    goal = planned(scene_at(), goals_from_constraints(scene_at(), [message], "palm"))
    assert goal[MODEL.index["turn"]] == pytest.approx(-0.5, abs=2e-3)
    assert ("'spring' is +0.0150 from 0.0000" in caplog.text and "the joint is passive" in caplog.text) == is_warned


@settings(max_examples=25, deadline=None)
@given(st.floats(-0.01, 0.03), st.tuples(*[st.floats(-1.2, 1.2)] * 5))
def test_ik_of_the_link_beyond_a_passive_joint_leaves_it_where_it_is(spring: float, values: tuple[float, ...]) -> None:
    target = palm(scene_at(**dict(zip(AXES, values, strict=True)), **{SPRING: spring}).positions)
    seed = scene_at(**{SPRING: spring}).positions
    found = KinematicsPool(MODEL).solver("arm").solutions("palm", target, seed, timeout_s=5.0)
    assert found and all(item[MODEL.index[SPRING]] == seed[MODEL.index[SPRING]] for item in found)
    assert np.abs(pin.log6(palm(found[0]).actInv(target)).vector).max() < 1e-6


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
