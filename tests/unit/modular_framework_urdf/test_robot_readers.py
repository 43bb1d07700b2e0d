# SPDX-License-Identifier: BSD-3-Clause
"""The readers of URDF and SRDF: what they find, and that every fault says its line."""

from __future__ import annotations

import numpy as np
import pytest

from modular_framework_urdf.mimics import Mimic
from modular_framework_urdf.robot import (
    Box,
    Cylinder,
    Limit,
    LocatedText,
    MeshFile,
    SafetyController,
    Sphere,
    UnknownShape,
)
from modular_framework_urdf.srdf_reader import VARIABLES, EndEffector, VirtualJoint, read_srdf
from modular_framework_urdf.urdf_reader import AttributeFault, read_urdf
from modular_framework_urdf.xml_text import XmlError

URDF = """<?xml version="1.0" encoding="latin-1"?>
<robot name="r" xmlns="http://www.ros.org"><!-- a comment -->
<link name="base"><visual><geometry><box size="1 2 3"/></geometry></visual>
<collision><origin xyz="0 0 1" rpy="0 0 1.5707963267948966"/><geometry><mesh filename="a.stl"/></geometry></collision>
<collision><geometry><sphere radius="2"/></geometry></collision></link>
<link name="arm"><collision><geometry><cylinder radius="0.1" length="0.4"/></geometry></collision>
<collision><geometry><torus/></geometry></collision></link><link name="tool"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 2 0"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="2"/><safety_controller soft_upper_limit="0.5" k_velocity="3"/></joint>
<joint name="mount" type="fixed"><parent link="arm"/><child link="tool"/><mimic joint="turn" offset="0.1"/></joint>
<transmission name="t"><type> transmission_interface/SimpleTransmission </type><joint name="turn">
<hardwareInterface>PositionJointInterface</hardwareInterface></joint>
<actuator name="m"><mechanicalReduction>50</mechanicalReduction></actuator></transmission></robot>"""


def test_a_urdf_is_read_whole() -> None:
    robot = read_urdf(URDF)
    assert (robot.name, [link.name for link in robot.links]) == ("r", ["base", "arm", "tool"])
    assert robot.root_links() == ["base"]
    base, arm, _ = robot.links
    assert base.visuals[0].shapes == (Box((1.0, 2.0, 3.0)),)
    assert [item.shapes for item in base.collisions] == [(MeshFile("a.stl", (1.0, 1.0, 1.0)),), (Sphere(2.0),)]
    assert [item.shapes for item in arm.collisions] == [(Cylinder(0.1, 0.4),), (UnknownShape("torus"),)]
    assert base.collisions[0].origin.matrix() == pytest.approx(
        np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]])
    )
    turn, mount = robot.joints
    assert (turn.parent, turn.child, turn.axis, turn.line) == ("base", "arm", (0.0, 0.0, 1.0), 8)
    assert turn.limit == Limit(-1.0, 1.0, None, 2.0) and turn.safety == SafetyController(None, 0.5, None, 3.0)
    assert mount.mimic == Mimic("turn", 1.0, 0.1) and list(robot.movable_joints()) == [turn]
    (transmission,) = robot.transmissions
    assert transmission.kind == "transmission_interface/SimpleTransmission" and transmission.line == 11
    assert transmission.joints[0].interfaces == (LocatedText("PositionJointInterface", 12),)
    assert transmission.actuators[0].reduction == LocatedText("50", 13) and transmission.joints[0].offset is None


@pytest.mark.parametrize(
    ("found", "wrong", "fault"),
    [
        (
            'velocity="2"',
            'velocity="fast"',
            "r.urdf:9: <limit> of joint 'turn': velocity is 'fast'; expected a number;",
        ),
        ('lower="-1"', 'lower="nan"', "r.urdf:9: <limit> of joint 'turn': lower is 'nan'"),
        (
            'rpy="0 0 1.5707963267948966"',
            'rpy="0 0"',
            "r.urdf:4: <origin> of collision shape of link 'base': rpy is '0 0'; expected three numbers",
        ),
        ('xyz="0 2 0"', 'xyz="0 inf 0"', "r.urdf:8: <origin> of joint 'turn': xyz is '0 inf 0'"),
        ('radius="2"', 'radius="two"', "r.urdf:5: <sphere> of collision shape of link 'base': radius is 'two'"),
    ],
)
def test_a_fault_of_a_urdf_says_its_line_and_what_is_allowed(found: str, wrong: str, fault: str) -> None:
    with pytest.raises(AttributeFault) as caught:
        read_urdf(URDF.replace(found, wrong), "r.urdf")
    assert str(caught.value).startswith(fault)


def test_links_in_a_loop_are_named_with_the_joint_that_closes_it() -> None:
    joints = (("a", "base", "l1"), ("b", "l3", "l2"), ("c", "l2", "l3"))
    text = "".join(f'\n<link name="{name}"/>' for name in ("base", "l1", "l2", "l3"))
    for name, parent, child in joints:
        text += f'\n<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'
    with pytest.raises(XmlError) as caught:
        read_urdf(f'<robot name="r">{text}</robot>', "r.urdf")
    fault, _, remedy = str(caught.value).partition("; ")
    assert fault in (
        "r.urdf:7: joint 'b' closes a loop of links: l3 -> l2 -> l3",
        "r.urdf:8: joint 'c' closes a loop of links: l2 -> l3 -> l2",
    )
    assert remedy == "allowed: a tree; correct the parent of one of its joints"
    assert [joint.name for joint in read_urdf('<robot name="r"><joint name="a" type="fixed"/></robot>').joints] == ["a"]


SRDF = """<robot name="r"><group name="arm"><!-- a comment --><joint name="b"/><chain base_link="x" tip_link="y"/>
<joint name="a"/></group><group name="all"><group name="arm"/><link name="tool"/></group>
<group_state name="home" group="arm"><joint name="b" value="0.5 "/></group_state>
<end_effector name="hand" parent_link="y" group="tool"/>
<virtual_joint name="v" type="fixed" parent_frame="world" child_link="x"/><passive_joint name="p"/>
<disable_default_collisions link="cable"/><enable_collisions link1="cable" link2="x"/>
<disable_collisions link1="x" link2="y" reason="Adjacent"/></robot>"""


def test_an_srdf_is_read_whole() -> None:
    robot = read_srdf(SRDF)
    arm, everything = robot.groups["arm"], robot.groups["all"]
    assert [member.kind for member in arm.members] == ["joint", "chain", "joint"]
    assert (arm.joints, arm.chains, arm.links, arm.subgroups) == (("b", "a"), (("x", "y"),), (), ())
    assert (everything.subgroups, everything.links) == (("arm",), ("tool",))
    assert robot.group_states == {"arm": {"home": {"b": 0.5}}}
    assert robot.end_effectors == (EndEffector("hand", "tool", "y", ""),)
    assert robot.virtual_joints == (VirtualJoint("v", "fixed", "world", "x"),)
    assert (robot.passive_joints, robot.touching_links) == ({"p"}, ("cable",))
    assert robot.enabled_pairs == {frozenset({"cable", "x"})}
    assert robot.disabled_pairs == {frozenset({"x", "y"}): "Adjacent"}


@pytest.mark.parametrize(
    ("kind", "value", "expected"),
    [
        ("planar", "1 -2 0.5", {"v/x": 1.0, "v/y": -2.0, "v/theta": 0.5}),
        (
            "floating",
            " 1 2 3  0 0 0.6 0.8",
            {f"v/{name}": value for name, value in zip(VARIABLES["floating"], (1, 2, 3, 0, 0, 0.6, 0.8), strict=True)},
        ),
        ("fixed", "0", {}),
    ],
)
def test_a_state_holds_the_variables_of_a_virtual_joint(kind: str, value: str, expected: dict[str, float]) -> None:
    placed = SRDF.replace('value="0.5 "/>', f'value="0.5 "/><joint name="v" value="{value}"/>')
    robot = read_srdf(placed.replace('type="fixed"', f'type="{kind}"'))
    assert robot.group_states == {"arm": {"home": {"b": 0.5, **expected}}}
    assert robot.virtual_joints[0].variables == tuple(expected)


@pytest.mark.parametrize(("kind", "given", "needed"), [("planar", 7, 3), ("floating", 3, 7)])
def test_a_virtual_joint_needs_one_number_for_each_variable(kind: str, given: int, needed: int) -> None:
    placed = SRDF.replace('value="0.5 "/>', f'value="0.5 "/><joint name="v" value="{"0 " * given}"/>')
    with pytest.raises(XmlError) as caught:
        read_srdf(placed.replace('type="fixed"', f'type="{kind}"'))
    said = str(caught.value)
    assert said.startswith(f"SRDF:3: a group_state contains {given} numbers for the {kind} virtual joint 'v'")
    assert f"give {needed}, separated by spaces: {' '.join(VARIABLES[kind])}" in said


@pytest.mark.parametrize(
    ("found", "wrong", "fault"),
    [
        (' base_link="x"', "", "SRDF:1: <chain> {'tip_link': 'y'} has no attribute 'base_link'; add it"),
        ('"0.5 "', '"high"', "SRDF:3: a group_state contains a value that is not a number ('high' for joint 'b')"),
        ('"0.5 "', '" "', "SRDF:3: a group_state contains a value that is not a number (' ' for joint 'b')"),
        ('"0.5 "', '""', "SRDF:3: a group_state contains a value that is not a number ('' for joint 'b')"),
    ],
)
def test_a_fault_of_an_srdf_says_its_line(found: str, wrong: str, fault: str) -> None:
    with pytest.raises(XmlError) as caught:
        read_srdf(SRDF.replace(found, wrong))
    assert str(caught.value).startswith(fault)
