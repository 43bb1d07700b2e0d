# SPDX-License-Identifier: BSD-3-Clause
"""Planning groups are resolved to the joints of the robot, and faulty members are named."""

from __future__ import annotations

import pytest

from modular_framework_urdf.planning_groups import GroupError, KinematicTree
from modular_framework_urdf.srdf_reader import read_srdf

TREE = KinematicTree({"mount": ("base", "l1"), "a": ("l1", "l2"), "b": ("l2", "tip"), "finger": ("l2", "pad")})
SRDF = """<robot name="r"><virtual_joint name="world_joint" type="planar" parent_frame="odom" child_link="base"/>
<group name="arm"><chain base_link="base" tip_link="tip"/></group>
<group name="hand"><link name="pad"/><link name="base"/></group>
<group name="all"><joint name="world_joint"/><group name="hand"/><group name="arm"/><joint name="a"/></group>
<group name="wrong">{}</group></robot>"""


@pytest.mark.parametrize(
    ("group", "joints"),
    [
        ("arm", ["mount", "a", "b"]),
        ("hand", ["finger"]),
        ("all", ["world_joint", "finger", "mount", "a", "b"]),
    ],
)
def test_a_group_has_the_joints_of_its_members_in_order_and_each_once(group: str, joints: list[str]) -> None:
    assert TREE.group_joints(group, read_srdf(SRDF)) == joints


@pytest.mark.parametrize(
    ("member", "words"),
    [
        ('<joint name="c"/>', "group 'wrong' names the joint 'c'"),
        ('<link name="palm"/>', "group 'wrong' names the link 'palm'"),
        ('<chain base_link="tip" tip_link="base"/>', "link 'base' is not below link 'tip'"),
        ('<group name="legs"/>', "group 'wrong' contains the unknown group 'legs'; known: all, arm, hand, wrong"),
        ('<group name="wrong"/>', "group 'wrong' contains itself"),
    ],
)
def test_a_member_that_does_not_exist_is_named(member: str, words: str) -> None:
    with pytest.raises(GroupError, match=words):
        TREE.group_joints("wrong", read_srdf(SRDF.format(member)))


def test_a_frame_above_itself_ends_a_chain() -> None:
    with pytest.raises(GroupError, match="'base' is not below link 'map'"):
        KinematicTree({"virtual": ("base", "base")}).chain("map", "base")


def test_a_cycle_of_joints_ends_a_chain() -> None:
    circle = KinematicTree({"a": ("l1", "l2"), "b": ("l2", "l3"), "c": ("l3", "l1")})
    assert circle.chain("l1", "l3") == ["a", "b"]
    with pytest.raises(GroupError, match="'l1' is not below link 'base'"):
        circle.chain("base", "l1")
