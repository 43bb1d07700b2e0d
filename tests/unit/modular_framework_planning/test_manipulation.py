# SPDX-License-Identifier: BSD-3-Clause
"""Grippers are found in the SRDF, straight motions are read in the frame they are given in, and short ones refused."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.manipulation_messages import Hand, posture, translation
from modular_framework_planning.pick_place.manipulation import Translation, allow_contacts
from modular_framework_planning.planning_scene.planning_scene import PlanningScene, empty_scene
from modular_framework_planning.robot_model.end_effectors import choose_end_effector, hand_links
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_urdf.mimics import Mimic

EFFECTOR = "ezgripper_finger_1_ee"
HAND = Hand(
    "ee_link",
    ("ezgripper_palm_link",),
    frozenset({"ezgripper_knuckle_palm_L1_1"}),
    {"ezgripper_knuckle_palm_L1_2": Mimic("ezgripper_knuckle_palm_L1_1", 2.0, 0.1)},
)


@pytest.fixture
def scene(model: RobotModel) -> PlanningScene:
    return empty_scene(model)


@pytest.mark.parametrize(
    ("group", "name", "arm"),
    [
        ("arm", "", "arm"),
        ("arm", EFFECTOR, "arm"),
        ("arm_and_manipulator", "", "arm_and_manipulator"),
        ("", EFFECTOR, "arm"),
    ],
)
def test_the_end_effector_of_a_group_is_found(model: RobotModel, group: str, name: str, arm: str) -> None:
    found, effector = choose_end_effector(model, group, name)
    assert found.name == arm and effector.name == EFFECTOR and effector.parent_link == "ee_link"


@pytest.mark.parametrize(
    ("group", "name", "word"),
    [
        ("", "", "group_name"),
        ("nobody", "", "nobody"),
        ("arm", "nobody", "nobody"),
        ("ezgripper", "", "0 end effectors"),
    ],
)
def test_a_choice_that_is_not_clear_is_refused(model: RobotModel, group: str, name: str, word: str) -> None:
    with pytest.raises(PlanningError, match=word) as error:
        choose_end_effector(model, group, name)
    assert error.value.code == ErrorCode.INVALID_GROUP_NAME


def test_the_palm_belongs_to_the_hand_and_the_flange_does_not(model: RobotModel) -> None:
    links = hand_links(model, choose_end_effector(model, "arm", "")[1])
    assert "ezgripper_palm_link" in links and "ezgripper_finger_L2_2" in links
    assert "ee_link" not in links and "wrist_3_link" not in links


def moving(x: float, y: float, z: float, frame: str, desired: float = 0.1, least: float = 0.05) -> Any:
    vector = SimpleNamespace(x=x, y=y, z=z)
    direction = SimpleNamespace(header=SimpleNamespace(frame_id=frame), vector=vector)
    return SimpleNamespace(direction=direction, desired_distance=desired, min_distance=least)


def test_a_direction_turns_with_the_hand_only_in_a_frame_fixed_to_it(scene: PlanningScene) -> None:
    pose = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.4, 1.2), np.array([0.1, 0.2, 0.3]))
    in_world = translation(scene, moving(0, 0, -2, "world"), "ee_link", "approach")
    assert not in_world.in_tip and np.allclose(in_world.translated_pose(pose, 0.1).translation, [0.1, 0.2, 0.2])
    in_hand = translation(scene, moving(3, 0, 0, "ee_link"), "ee_link", "approach")
    assert in_hand.in_tip
    assert np.allclose(in_hand.translated_pose(pose, -0.1).translation, pose.translation - 0.1 * pose.rotation[:, 0])
    same = scene.frame_transform("eg_manipulator").rotation.T @ scene.frame_transform("ee_link").rotation[:, 0]
    in_tip = translation(scene, moving(*same, "eg_manipulator"), "ee_link", "approach")
    assert in_tip.in_tip and np.allclose(in_tip.direction, [1, 0, 0], atol=1e-9)


def test_no_direction_is_fine_only_for_no_distance(scene: PlanningScene) -> None:
    assert translation(scene, moving(0, 0, 0, "", 0.0, 0.0), "ee_link", "retreat").desired_distance_m == 0.0
    assert translation(scene, moving(0, 0, 1, "world", 0.0, 0.2), "ee_link", "retreat").desired_distance_m == 0.2
    for bad in (
        moving(0, 0, 0, "world"),
        moving(0, 0, np.nan, "world"),
        moving(0, 0, 1, "world", -1.0, 0.0),
        moving(0, 0, 1, "world", np.inf, 0.0),
        moving(0, 0, 1, "world", 0.1, -0.1),
    ):
        with pytest.raises(PlanningError, match="retreat"):
            translation(scene, bad, "ee_link", "retreat")


def test_the_last_point_of_a_posture_counts() -> None:
    joint = "ezgripper_knuckle_palm_L1_1"
    points = [SimpleNamespace(positions=[0.1]), SimpleNamespace(positions=[0.2])]
    assert posture(SimpleNamespace(joint_names=[joint], points=points), HAND, "grasp") == {joint: 0.2}
    assert posture(SimpleNamespace(joint_names=[], points=[]), HAND, "grasp") == {}
    both = [joint, *HAND.mimics]
    two = [SimpleNamespace(positions=[0.2, 0.4])]
    assert posture(SimpleNamespace(joint_names=both, points=two), HAND, "grasp") == {joint: 0.2}
    assert posture(
        SimpleNamespace(joint_names=both[1:], points=[SimpleNamespace(positions=[0.5])]), HAND, "grasp"
    ) == pytest.approx({joint: 0.2}), "0.5 is twice 0.2, and 0.1"
    for names, given in ((["elbow_joint"], points), ([joint], []), ([joint, joint], points)):
        with pytest.raises(PlanningError, match="grasp"):
            posture(SimpleNamespace(joint_names=names, points=given), HAND, "grasp")


def test_allowing_changes_these_pairs_alone(scene: PlanningScene) -> None:
    changed = allow_contacts(scene, ["ezgripper_palm_link"], ["block", "table"])
    assert changed.acm.allows("ezgripper_palm_link", "table") and changed.acm.allows("block", "ezgripper_palm_link")
    assert not changed.acm.allows("forearm_link", "block") and not scene.acm.allows("ezgripper_palm_link", "block")


def test_a_translation_goes_both_ways() -> None:
    way = Translation(np.array([0.0, 1.0, 0.0]), False, 0.2, 0.1)
    assert np.allclose(way.translated_pose(pin.SE3.Identity(), -0.2).translation, [0, -0.2, 0])
