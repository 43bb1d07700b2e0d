# SPDX-License-Identifier: BSD-3-Clause
"""The robot model of moveit_commander, on a small robot written for it."""

from __future__ import annotations

import math
import random

import pytest
from geometry_msgs.msg import Quaternion, Transform, Vector3
from moveit_commander.exception import MoveItCommanderException, RobotModelError
from moveit_commander.joints import ASSUMED_ROOT_JOINT
from moveit_commander.robot import Joint, Link, RobotCommander
from moveit_commander.robot_model import RobotModel, group_values
from moveit_commander.robot_state import base_transform, base_values

URDF = """<robot name="tiny">
  <link name="base"/><link name="one"/><link name="two"/><link name="flange"/><link name="left"/><link name="right"/>
  <joint name="b_elbow" type="continuous"><parent link="one"/><child link="two"/><axis xyz="0 0 1"/></joint>
  <joint name="a_shoulder" type="revolute"><parent link="base"/><child link="one"/><origin xyz="0 0 1"/>
    <limit lower="0.5" upper="1.5" velocity="2" effort="1"/></joint>
  <joint name="c_mount" type="fixed"><parent link="two"/><child link="flange"/></joint>
  <joint name="d_left" type="prismatic"><parent link="flange"/><child link="left"/>
    <limit lower="0" upper="0.04" velocity="1" effort="1"/></joint>
  <joint name="e_right" type="prismatic"><parent link="flange"/><child link="right"/>
    <limit lower="0" upper="0.1" velocity="1" effort="1"/><mimic joint="d_left" multiplier="2" offset="0.01"/></joint>
</robot>"""
SRDF = """<robot name="tiny">
  <group name="arm"><chain base_link="base" tip_link="flange"/></group>
  <group name="hand"><joint name="d_left"/><link name="right"/></group>
  <group name="all"><group name="arm"/><group name="hand"/></group>
  <group_state name="up" group="arm">
    <joint name="a_shoulder" value="1.0"/><joint name="b_elbow" value="0"/></group_state>
  <end_effector name="gripper" parent_link="flange" group="hand"/>
  VIRTUAL
</robot>"""


@pytest.fixture
def model() -> RobotModel:
    return RobotModel(URDF, SRDF.replace("VIRTUAL", ""), {"b_elbow": {"has_velocity_limits": True, "max_velocity": 3}})


def test_joints_come_depth_first_from_the_root(model: RobotModel) -> None:
    assert list(model.joints) == [ASSUMED_ROOT_JOINT, "a_shoulder", "b_elbow", "c_mount", "d_left", "e_right"]
    assert model.links == ("base", "one", "two", "flange", "left", "right")
    assert model.planning_frame == model.root_link == "base"


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_the_planning_frame_of_a_robot_that_moves_is_the_one_it_moves_in(kind: str) -> None:
    virtual = f'<virtual_joint name="drive" type="{kind}" parent_frame="odom" child_link="base"/>'
    model = RobotModel(URDF, SRDF.replace("VIRTUAL", virtual))
    assert (model.planning_frame, model.root_link) == ("odom", "base")
    assert model.base is not None and model.base.name == "drive"


def test_the_root_link_is_the_planning_frame_below_a_virtual_joint_too() -> None:
    virtual = '<virtual_joint name="floor" type="fixed" parent_frame="map" child_link="base"/>'
    model = RobotModel(URDF, SRDF.replace("VIRTUAL", virtual))
    assert model.planning_frame == "base" and next(iter(model.joints)) == "floor"


def test_groups_are_chains_links_and_other_groups(model: RobotModel) -> None:
    arm, hand, both = (model.group(name) for name in ("arm", "hand", "all"))
    assert (
        arm.is_chain
        and arm.tip == "flange"
        and [joint.name for joint in arm.active_joints] == ["a_shoulder", "b_elbow"]
    )
    assert not hand.is_chain and hand.tip == ""
    assert [joint.name for joint in hand.variables] == ["d_left", "e_right"]
    assert [joint.name for joint in hand.active_joints] == ["d_left"]
    assert both.links == ("one", "two", "flange", "left", "right")
    assert arm.end_effector == hand.end_effector == "gripper"
    assert arm.states["up"] == {"a_shoulder": 1.0, "b_elbow": 0.0}


def test_a_group_of_two_branches_below_a_root_that_is_named_as_its_frame_is_no_chain() -> None:
    urdf = """<robot name="two"><link name="world"/><link name="l"/><link name="r"/>
    <joint name="left" type="revolute"><parent link="world"/><child link="l"/><limit lower="-1" upper="1"/></joint>
    <joint name="right" type="revolute"><parent link="world"/><child link="r"/><limit lower="-1" upper="1"/></joint>
    </robot>"""
    srdf = """<robot name="two"><virtual_joint name="base" type="fixed" parent_frame="world" child_link="world"/>
    <group name="both"><joint name="left"/><joint name="right"/></group></robot>"""
    model = RobotModel(urdf, srdf)
    assert not model.group("both").is_chain
    with pytest.raises(RobotModelError, match="'l' is not below link 'r'"):
        model.chain("r", "l")


def test_limits_come_from_urdf_and_joint_limits(model: RobotModel) -> None:
    shoulder, elbow = model.joints["a_shoulder"], model.joints["b_elbow"]
    assert (shoulder.lower, shoulder.upper, shoulder.velocity, shoulder.default) == (0.5, 1.5, 2.0, 1.0)
    assert (elbow.lower, elbow.upper, elbow.velocity) == (-math.pi, math.pi, 3.0)
    assert shoulder.admits(1.5) and shoulder.admits(1.6, 0.2) and not shoulder.admits(1.6)
    assert not shoulder.admits(math.nan) and elbow.admits(7.0)
    assert shoulder.bounded(9.0) == 1.5 and elbow.bounded(7.0) == pytest.approx(7.0 - 2.0 * math.pi)


def test_mimic_joints_follow(model: RobotModel) -> None:
    values = model.complete({"d_left": 0.02, "stranger": 1.0})
    assert values == pytest.approx({"d_left": 0.02, "e_right": 0.05})
    assert model.random_values(model.group("hand"), random.Random(1)).keys() == {"d_left", "e_right"}


def test_mimic_joints_follow_through_others_and_a_fixed_one_follows_none() -> None:
    chain = URDF.replace('<mimic joint="d_left" multiplier="2"', '<mimic joint="a_shoulder" multiplier="2"')
    chain = chain.replace(
        '<joint name="d_left" type="prismatic">',
        '<joint name="d_left" type="prismatic"><mimic joint="e_right" multiplier="3"/>',
    )
    found = RobotModel(chain, SRDF.replace("VIRTUAL", ""))
    assert found.complete({"a_shoulder": 0.5}) == pytest.approx({"a_shoulder": 0.5, "e_right": 1.01, "d_left": 3.03})
    mount = '<joint name="c_mount" type="fixed">'
    fixed = URDF.replace(mount, f'{mount}<mimic joint="d_left"/>')
    assert fixed != URDF
    assert "c_mount" not in RobotModel(fixed, SRDF.replace("VIRTUAL", "")).complete({"d_left": 0.02})


def test_lists_name_every_variable_or_every_active_joint(model: RobotModel) -> None:
    hand = model.group("hand")
    assert group_values(hand, [0.01, 0.03]) == {"d_left": 0.01, "e_right": 0.03}
    assert group_values(hand, [0.01]) == {"d_left": 0.01}
    with pytest.raises(MoveItCommanderException, match="got 3 joint values; 2 are needed"):
        group_values(hand, [1, 2, 3])


@pytest.mark.parametrize(
    ("urdf", "srdf", "words"),
    [
        ("no xml", SRDF, "URDF:1: not an XML document"),
        (URDF, "no xml", "SRDF:1: not an XML document"),
        (
            URDF.replace('<link name="base"/>', '<link name="base"/><link name="alone"/>'),
            SRDF,
            "2 links have no parent",
        ),
        (URDF.replace('lower="0.5"', 'lower="low"'), SRDF, "joint 'a_shoulder'"),
        (
            URDF.replace('<mimic joint="d_left"', '<mimic joint="e_right"'),
            SRDF,
            "mimics itself through e_right -> e_right",
        ),
        (URDF.replace('<mimic joint="d_left"', '<mimic joint="knee"'), SRDF, "'knee', which is not a movable joint"),
        (URDF, SRDF.replace('tip_link="flange"', 'tip_link="nowhere"'), "'nowhere' is not below link 'base'"),
        (URDF, SRDF.replace('<link name="right"/>', '<link name="nowhere"/>'), "names the link 'nowhere'"),
        (
            URDF,
            SRDF.replace('<group name="hand"/></group>', '<group name="nobody"/></group>'),
            "unknown group 'nobody'",
        ),
        (URDF, SRDF.replace('<group name="hand"/></group>', '<group name="all"/></group>'), "contains itself"),
    ],
)
def test_faulty_descriptions_are_refused_with_a_reason(urdf: str, srdf: str, words: str) -> None:
    with pytest.raises(RobotModelError, match=words):
        RobotModel(urdf, srdf.replace("VIRTUAL", ""))


def test_an_unknown_group_is_named_with_those_there_are(model: RobotModel) -> None:
    with pytest.raises(RuntimeError, match="no group named 'leg'.*all, arm, hand"):
        model.group("leg")


def test_a_subclass_chooses_what_its_joints_and_links_are(model: RobotModel) -> None:
    class MyJoint(Joint):
        pass

    class MyLink(Link):
        pass

    class MyCommander(RobotCommander):
        Joint = MyJoint
        Link = MyLink

        def __init__(self) -> None:
            self._model = model

    robot = MyCommander()
    assert isinstance(robot.get_joint("b_elbow"), MyJoint) and isinstance(robot.get_link("base"), MyLink)


def with_base(kind: str, states: str = "") -> RobotModel:
    """The robot on a base that moves, with a group of that base and its arm."""
    virtual = f'<virtual_joint name="drive" type="{kind}" parent_frame="odom" child_link="base"/>'
    group = f'<group name="mobile"><joint name="drive"/><group name="arm"/></group>{states}'
    return RobotModel(URDF, SRDF.replace("VIRTUAL", virtual + group))


@pytest.mark.parametrize(
    "kind, names",
    [
        ("planar", ["drive/x", "drive/y", "drive/theta"]),
        ("floating", [f"drive/{n}" for n in ("trans_x", "trans_y", "trans_z", "rot_x", "rot_y", "rot_z", "rot_w")]),
    ],
)
def test_a_base_that_moves_is_one_active_joint_of_several_variables(kind: str, names: list[str]) -> None:
    model = with_base(kind)
    mobile = model.group("mobile")
    assert [joint.name for joint in mobile.active_joints] == ["drive", "a_shoulder", "b_elbow"]
    assert [variable.name for variable in mobile.variables] == [*names, "a_shoulder", "b_elbow"]
    assert [variable.name for variable in model.group("arm").variables] == ["a_shoulder", "b_elbow"]
    placed = [model.defaults()[name] for name in names]
    assert placed == [0.0] * (len(names) - 1) + [1.0 if kind == "floating" else 0.0]
    drawn = model.random_values(mobile, random.Random(1))
    assert list(drawn) == [*names, "a_shoulder", "b_elbow"] and drawn[names[0]] == 0.0, "no bound, no draw"
    turn = [drawn[name] for name in names if "/rot_" in name or "theta" in name]
    assert any(turn) and (kind == "planar" or math.hypot(*turn) == pytest.approx(1.0))
    assert mobile.is_chain and mobile.tip == "flange"


def test_a_state_of_a_group_places_the_base_by_its_variables() -> None:
    state = '<group_state name="dock" group="mobile"><joint name="drive" value="1 -2 0.5"/></group_state>'
    expected = {"drive/x": 1.0, "drive/y": -2.0, "drive/theta": 0.5}
    assert with_base("planar", state).group("mobile").states["dock"] == expected
    with pytest.raises(RobotModelError, match="3 numbers for the floating virtual joint 'drive'.*give 7"):
        with_base("floating", state)


def test_limits_of_the_base_are_those_of_its_variables() -> None:
    virtual = '<virtual_joint name="drive" type="planar" parent_frame="odom" child_link="base"/>'
    entry = {"has_position_limits": True, "min_position": -3.0, "max_position": 4.0}
    for limits in ({"drive/x": entry}, {"drive": {"x": entry}}):
        x, y, theta = RobotModel(URDF, SRDF.replace("VIRTUAL", virtual), limits).joints["drive"].parts
        assert (x.lower, x.upper, x.admits(4.5)) == (-3.0, 4.0, False)
        assert y.admits(1e6) and theta.bounded(7.0) == pytest.approx(7.0 - 2.0 * math.pi)


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_a_transform_of_the_base_and_its_variables_say_the_same(kind: str) -> None:
    model = with_base(kind)
    turn = Quaternion(0.0, 0.0, math.sin(0.4), math.cos(0.4)) if kind == "planar" else Quaternion(0.5, -0.5, 0.1, 0.7)
    length = math.hypot(turn.x, turn.y, turn.z, turn.w)
    values = base_values(model, Transform(Vector3(1.0, -2.0, 0.0), turn))
    back = base_transform(model, values)
    assert [back.translation.x, back.translation.y, back.translation.z] == [1.0, -2.0, 0.0]
    assert [back.rotation.x, back.rotation.y, back.rotation.z, back.rotation.w] == pytest.approx(
        [turn.x / length, turn.y / length, turn.z / length, turn.w / length]
    )
