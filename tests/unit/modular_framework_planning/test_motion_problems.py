# SPDX-License-Identifier: BSD-3-Clause
"""Problems in YAML files are planned exactly as written, or refused; no name or key is ignored."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from modular_framework_planning.errors import ModelError
from modular_framework_planning.planning_interface.motion_problems import MotionProblem, read_problem
from modular_framework_planning.planning_interface.planning_request import JointGoal
from modular_framework_planning.robot_model.robot_model import RobotModel

LINK = "<link name='{}'><collision><geometry><sphere radius='0.02'/></geometry></collision></link>"
JOINT = """<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/><origin xyz='0.2 0 0'/>
<axis xyz='0 0 1'/><limit lower='-2' upper='2' effort='1' velocity='1'/></joint>"""
JOINTS = (
    ("shoulder", "revolute", "base", "upper"),
    ("elbow", "revolute", "upper", "lower"),
    ("left_finger", "prismatic", "lower", "finger"),
    ("camera_joint", "fixed", "base", "camera"),
)
URDF = (
    "<robot name='arm'>"
    + "".join(LINK.format(name) for name in ("base", "upper", "lower", "finger", "camera"))
    + "".join(JOINT.format(name=a, kind=b, parent=c, child=d) for a, b, c, d in JOINTS)
    + "</robot>"
)
SRDF = """<robot name='arm'><group name='arm'><joint name='shoulder'/><joint name='elbow'/></group>
<group name='hand'><joint name='left_finger'/></group></robot>"""
REQUEST: dict[str, Any] = {
    "group_name": "arm",
    "start_state": {"joint_state": {"name": ["shoulder", "elbow"], "position": [0.1, 0.2]}},
    "goal_constraints": [{"joint_constraints": [{"joint_name": "elbow", "position": 1.0}]}],
}
SCENE: dict[str, Any] = {"world": {"collision_objects": []}}


def problem_of(
    folder: Path, changes: dict[str, Any], scene: dict[str, Any] | None = None, group: str = ""
) -> MotionProblem:
    """Returns the problem of a request with some changed keys."""
    (folder / "scene0001.yaml").write_text(yaml.safe_dump(SCENE | (scene or {})))
    (folder / "request0001.yaml").write_text(yaml.safe_dump(REQUEST | changes))
    model = RobotModel(URDF, SRDF)
    return read_problem(model, folder / "scene0001.yaml", folder / "request0001.yaml", 1.0, group)


def state(names: str, **further: Any) -> dict[str, Any]:
    """Returns a start state with a position of 0.3 for each name."""
    joints = names.split()
    return {"start_state": {"joint_state": {"name": joints, "position": [0.3] * len(joints)}, **further}}


def test_start_goal_and_tolerances_are_those_of_the_file(tmp_path: Path) -> None:
    constraint = {"joint_name": "elbow", "position": 1, "tolerance_above": 0.2, "tolerance_below": 0.1, "weight": 1.0}
    request = problem_of(tmp_path, {"goal_constraints": [{"joint_constraints": [constraint]}]}).request
    assert request.goals == (JointGoal({"elbow": 1.0}, {"elbow": 0.1}, {"elbow": 0.2}),)
    np.testing.assert_allclose(request.scene.positions, [0.1, 0.2, 0.0])


def test_a_joint_without_a_position_in_the_request_has_its_position_of_the_scene(tmp_path: Path) -> None:
    robot_state = {"joint_state": {"name": ["left_finger", "elbow"], "position": [0.05, -1.0]}}
    request = problem_of(tmp_path, state("shoulder"), {"robot_state": robot_state}).request
    np.testing.assert_allclose(request.scene.positions, [0.3, -1.0, 0.05])


@pytest.mark.parametrize("names", ["shoulder elbow", "shoulder elbow camera_joint", "shoulder elbow robotiq_knuckle"])
def test_joints_of_a_gripper_that_the_model_does_not_have_are_accepted(names: str, tmp_path: Path) -> None:
    assert problem_of(tmp_path, state(names)).request.scene.positions[1] == 0.3


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        (
            state("shoulder elbo"),
            "joint 'elbo' is unknown; allowed: shoulder, elbow, left_finger; did you mean 'elbow'",
        ),
        (state("shoulder elbow left_fingr"), "joint 'left_fingr' is unknown; .*did you mean 'left_finger'"),
        (state("shoulder robotiq_knuckle"), "joint 'robotiq_knuckle' is unknown"),
        (state("shoulder elbow", attached_collision_objects=[{"link_name": "lower"}]), "attached_collision_objects is"),
        (state("shoulder elbow", multi_dof_joint_state={"joint_names": ["drive"]}), "joint 'drive' is unknown"),
        ({"start_state": {"joint_state": {"name": ["shoulder"], "position": []}}}, "1 names and 0 positions"),
        ({"start_state": None}, "start_state is None; give a mapping"),
        ({"group_name": "arn"}, "there is no planning group 'arn'; allowed: arm, hand; did you mean 'arm'"),
        ({"goal_constraints": [{"joint_constraints": []}]}, r"goal_constraints\[0\] has no joint_constraints"),
        ({"goal_constraints": [{"joint_constrants": []}]}, "'joint_constrants' is unknown.*mean 'joint_constraints'"),
        ({"goal_constraints": [{"joint_constraints": [{"joint_name": "left_finger", "position": 0}]}]}, "not in group"),
        ({"goal_constraints": [{"joint_constraints": [{"joint_name": "elbow"}]}]}, "position is None; give a finite"),
        ({"path_constraints": {"name": "level", "joint_constraints": [1]}}, "path_constraints is not supported"),
        ({"max_cartesian_speed": 0.1}, "max_cartesian_speed is not supported"),
    ],
)
def test_a_request_that_would_be_read_in_part_is_refused(changes: dict[str, Any], fault: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=rf"request0001\.yaml: .*{fault}"):
        problem_of(tmp_path, changes)


@pytest.mark.parametrize(
    ("scene", "fault"),
    [
        ({"wrld": {}}, "the key 'wrld' is unknown; .*did you mean 'world'"),
        ({"world": {"collision_objects": [{"id": "a", "primitives": [], "meshes": [{"vertices": [1]}]}]}}, "meshes is"),
        ({"world": {"collision_objects": [{"id": "a", "primitve": []}]}}, "'primitve' is unknown.*mean 'primitives'"),
        ({"world": {"collision_objects": {}}}, "world/collision_objects is {}; give a list"),
        ({"robot_state": {"joint_state": {"name": ["elbo"], "position": [1.0]}}}, "joint 'elbo' is unknown"),
        ({"link_padding": [{"link_name": "upper", "padding": 0.1}]}, "link_padding is not supported"),
    ],
)
def test_a_scene_that_would_be_read_in_part_is_refused(scene: dict[str, Any], fault: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=rf"scene0001\.yaml: .*{fault}"):
        problem_of(tmp_path, {}, scene)


def test_empty_keys_of_a_whole_message_are_accepted(tmp_path: Path) -> None:
    message = {
        "path_constraints": {"name": "", "joint_constraints": []},
        "max_cartesian_speed": 0.0,
        "workspace_parameters": {"min_corner": [-1, -1, -1], "max_corner": [1, 1, 1]},
        "planner_id": "RRT",
    }
    assert problem_of(tmp_path, message).request.group == "arm"


def test_the_group_of_the_experiment_replaces_that_of_the_request(tmp_path: Path) -> None:
    goal = {"goal_constraints": [{"joint_constraints": [{"joint_name": "left_finger", "position": 0.1}]}]}
    changes = {"group_name": "somewhere else", **state("left_finger"), **goal}
    assert problem_of(tmp_path, changes, group="hand").request.group == "hand"
