# SPDX-License-Identifier: BSD-3-Clause
"""A URDF object is read with its looks, its drives, and what its <gazebo> elements say."""

from __future__ import annotations

import math

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.urdf_extensions import misspelt_extensions
from modular_framework_simulation.models.urdf_model import read_urdf_model
from modular_framework_simulation.models.xml_nodes import parse_xml

INERTIAL = """<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"""
BOX = "<geometry><box size='1 1 1'/></geometry>"


def read(body: str) -> specs.Model:
    return read_urdf_model(f"<robot name='r'>{body}</robot>", "text", Resources())


def test_links_are_seen_in_their_materials() -> None:
    text = f"""<material name='sky'><color rgba='0 0.5 1 1'/></material>
        <link name='a'>{INERTIAL}<visual>{BOX}<material name='sky'/></visual>
        <visual><origin xyz='1 0 0'/>{BOX}<material name='x'><color rgba='1 0 0 0.5'/></material></visual>
        <visual>{BOX}</visual></link><link name='b'>{INERTIAL}<visual>{BOX}<material name='sky'/></visual></link>
        <joint name='j' type='fixed'><parent link='a'/><child link='b'/></joint>
        <gazebo reference='b'><material>Gazebo/Green</material></gazebo>"""
    a, b = read(text).links
    assert [each.colour for each in a.visuals] == [(0, 0.5, 1, 1), (1, 0, 0, 0.5), specs.GREY]
    assert a.visuals[1].pose.position == (1, 0, 0)
    assert b.visuals[0].colour == (0, 1, 0, 1)


def test_what_gazebo_elements_say_about_links_is_read() -> None:
    text = f"""<link name='a'>{INERTIAL}<collision>{BOX}</collision></link>
        <gazebo reference='a'><mu1>0.3</mu1><mu2>-1</mu2><kp>1e6</kp><kd>10</kd><minDepth>0.001</minDepth>
        <maxVel>0.1</maxVel><selfCollide>true</selfCollide><turnGravityOff>true</turnGravityOff>
        <dampingFactor>0.02</dampingFactor></gazebo><gazebo><static>true</static></gazebo>"""
    model = read(text)
    link = model.links[0]
    assert link.collisions[0].friction == specs.Friction(0.3, mu2=specs.UNLIMITED_FRICTION)
    assert link.collisions[0].contact == specs.SurfaceContact(1e6, 10, 0.1, 0.001)
    assert (link.self_collide, link.gravity, link.velocity_decay) == (True, False, specs.VelocityDecay(0.02, 0.02))
    assert model.static
    assert model.notes == ()


def test_joints_have_drives_and_dynamics() -> None:
    text = f"""<link name='a'>{INERTIAL}</link><link name='b'>{INERTIAL}</link>
        <joint name='j' type='revolute'><parent link='a'/><child link='b'/><axis xyz='0 0 2'/>
        <limit lower='-1' upper='2' effort='3' velocity='4'/><dynamics damping='0.5' friction='0.1'/></joint>
        <gazebo reference='j'><springStiffness>7</springStiffness><springReference>0.25</springReference>
        <preserveFixedJoint>true</preserveFixedJoint></gazebo>"""
    joint = read(text).joints[0]
    assert (joint.axis, joint.lower, joint.upper, joint.effort, joint.velocity) == ((0, 0, 1), -1, 2, 3, 4)
    assert joint.dynamics == specs.JointDynamics(0.5, 0.1, 0.25, 7)
    endless = read(text.replace("'revolute'", "'continuous'")).joints[0]
    assert (endless.lower, endless.upper) == (-math.inf, math.inf)


def test_what_has_no_effect_is_named() -> None:
    text = f"""<link name='a'>{INERTIAL}</link><link name='b'/><transmission name='t'/>
        <joint name='j' type='continuous'><parent link='a'/><child link='b'/><mimic joint='k'/></joint>

        <gazebo reference='c'><mu1>1</mu1></gazebo><gazebo reference='b'><material>Plaid</material></gazebo>
        <link name='d'><visual>{BOX}</visual></link><joint name='k' type='fixed'><parent link='a'/><child link='d'/>
        </joint><gazebo reference='d'><material>Plaid</material></gazebo>"""
    notes = "\n".join(read(text).notes)
    for said in (
        "<transmission name='t'>: has no effect",
        "refers to 'c', which is not a link or joint",
        "<mimic>: has no effect",
        "<link name='b'>: has no <inertial>",
        "'Plaid' is not a known material",
    ):
        assert said in notes


def test_misspelt_elements_and_references_are_found_and_foreign_ones_are_not() -> None:
    links = "<link name='upper_arm'/><link name='lower_arm'/>"
    right = "<gazebo reference='upper_arm'><selfCollide>1</selfCollide><my_tag/><enable_wind/></gazebo>"
    foreign = "<gazebo reference='camera'/><gazebo><plugin name='p' filename='x'><selfColide/></plugin></gazebo>"
    assert misspelt_extensions(parse_xml(f"<robot name='r'>{links}{right}{foreign}</robot>", "t")) == []
    wrong = "<gazebo reference='uper_arm'><selfColide>1</selfColide></gazebo>"
    assert misspelt_extensions(parse_xml(f"<robot name='r'>{links}{wrong}</robot>", "t")) == [
        "t:1: <gazebo>: there is no link or joint 'uper_arm'; did you mean 'upper_arm'?",
        "t:1: <selfColide>: <gazebo> has no <selfColide>; did you mean 'selfCollide'?",
    ]
