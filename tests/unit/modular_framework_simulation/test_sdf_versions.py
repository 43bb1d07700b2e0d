# SPDX-License-Identifier: BSD-3-Clause
"""What a file means follows from its own version of SDF: frames, axes, gravity, models inside models, saved states."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.sdf_reader import read_model_text, read_world
from modular_framework_simulation.models.sdf_resources import Resources, folders_of, model_folders

HALF_TURN = "1.5707963267948966"
INERTIAL = "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>"


def model(body: str, version: str = "1.7", attributes: str = "") -> specs.Model:
    text = f"<sdf version='{version}'><model name='m' {attributes}>\n{body}\n</model></sdf>"
    return read_model_text(text, "text", Resources())


def world(folder: Path, body: str, version: str = "1.7", *models: Path) -> specs.World:
    path = folder / "test.world"
    path.write_text(f"<sdf version='{version}'>\n<world name='w'>\n{body}\n</world></sdf>")
    return read_world(path, Resources(models))


def hinge(axis: str, version: str) -> specs.Joint:
    """A hinge whose link is turned by 90 degrees about x: its y axis is the z axis of the model."""
    text = f"""<link name='a'/><link name='b'><pose>0 0 0 {HALF_TURN} 0 0</pose></link>
        <joint name='j' type='revolute'><parent>a</parent><child>b</child><axis>{axis}</axis></joint>"""
    return model(text, version).joints[0]


@pytest.mark.parametrize(
    ("version", "axis", "in_joint"),
    [
        ("1.3", "<xyz>0 0 1</xyz>", (0, 1, 0)),
        ("1.4", "<xyz>0 0 1</xyz>", (0, 1, 0)),
        ("1.5", "<xyz>0 0 1</xyz>", (0, 0, 1)),
        ("1.6", "<xyz>0 0 1</xyz><use_parent_model_frame>1</use_parent_model_frame>", (0, 1, 0)),
        ("1.6", "<xyz>0 0 1</xyz><use_parent_model_frame>0</use_parent_model_frame>", (0, 0, 1)),
        ("1.7", "<xyz expressed_in='__model__'>0 0 1</xyz>", (0, 1, 0)),
        ("1.7", "<xyz expressed_in='a'>0 0 1</xyz>", (0, 1, 0)),
        ("1.9", "<xyz>0 0 1</xyz>", (0, 0, 1)),
        ("1.9", "<xyz>0 0 8</xyz>", (0, 0, 1)),
    ],
)
def test_an_axis_is_in_the_frame_its_version_says(
    version: str, axis: str, in_joint: tuple[float, float, float]
) -> None:
    assert hinge(axis, version).axis == pytest.approx(in_joint, abs=1e-12)


def test_limits_from_1e16_on_are_none_and_drives_and_dynamics_are_read() -> None:
    axis = """<xyz>0 0 1</xyz>
        <limit><lower>-1e16</lower><upper>2</upper><effort>-1</effort><velocity>3</velocity></limit><dynamics><damping>0.5</damping><friction>0.25</friction><spring_reference>-1</spring_reference>
        <spring_stiffness>7</spring_stiffness></dynamics>"""
    joint = hinge(axis, "1.6")
    assert (joint.lower, joint.upper, joint.effort, joint.velocity) == (-math.inf, 2, math.inf, 3)
    assert joint.dynamics == specs.JointDynamics(0.5, 0.25, -1, 7)


def test_surfaces_and_damping_are_read() -> None:
    text = """<link name='a'><gravity>0</gravity><kinematic>1</kinematic><self_collide>true</self_collide>
        <velocity_decay><linear>0.1</linear><angular>0.2</angular></velocity_decay>
        <collision name='c'><geometry><sphere><radius>1</radius></sphere></geometry><surface>
        <friction><ode><mu>-1</mu><mu2>0.5</mu2></ode></friction>
        <bounce><restitution_coefficient>0.8</restitution_coefficient><threshold>0</threshold></bounce>
        <contact><collide_bitmask>0x02</collide_bitmask><ode><kp>1e6</kp><kd>100</kd><max_vel>0.1</max_vel>
        <min_depth>0.001</min_depth></ode></contact></surface></collision></link>"""
    link = model(text).links[0]
    shape = link.collisions[0]
    assert (link.gravity, link.kinematic, link.self_collide) == (False, True, True)
    assert link.velocity_decay == specs.VelocityDecay(0.1, 0.2)
    assert shape.friction == specs.Friction(specs.UNLIMITED_FRICTION, mu2=0.5)
    assert shape.bounce == specs.Bounce(0.8, 0)
    assert shape.contact == specs.SurfaceContact(1e6, 100, 0.1, 0.001, False, 2)


def test_poses_in_degrees_as_quaternions_and_without_numbers_are_read() -> None:
    text = """<link name='a'><pose degrees='true'>0 0 0 0 0 90</pose></link>
        <link name='b'><pose rotation_format='quat_xyzw'>1 2 3  0 0 0.7071067811865476 0.7071067811865476</pose></link>
        <link name='c'><pose/></link>"""
    a, b, c = model(text, "1.9").links
    quarter = pytest.approx((0, 0, math.sqrt(0.5), math.sqrt(0.5)))
    assert a.pose.quaternion == quarter
    assert b.pose.quaternion == quarter
    assert (b.pose.position, c.pose.position) == ((1, 2, 3), (0, 0, 0))


def test_shapes_may_stand_in_other_frames() -> None:
    text = """<frame name='f'><pose>0 0 5 0 0 0</pose></frame><link name='a'><pose>0 0 1 0 0 0</pose>
        <collision name='c'><pose relative_to='f'>0 0 1 0 0 0</pose><geometry><sphere><radius>1</radius></sphere>
        </geometry></collision></link>"""
    assert model(text).links[0].collisions[0].pose.position == (0, 0, 5)


def test_a_joint_may_have_the_name_of_a_link_and_attach_to_frames() -> None:
    text = """<link name='a'/><link name='b'><pose>0 0 2 0 0 0</pose></link>
        <frame name='f' attached_to='b'><pose>1 0 0 0 0 0</pose></frame>
        <joint name='b' type='fixed'><parent>a</parent><child>f</child></joint>"""
    joint = model(text).joints[0]
    assert (joint.child, joint.pose.position) == ("b", (1, 0, 0))


def test_a_model_in_a_model_keeps_its_names_and_frames() -> None:
    text = f"""<link name='base'/>
        <model name='inner' placement_frame='tip'><pose relative_to='base'>0 0 1 0 0 {HALF_TURN}</pose>
          <link name='arm'/><link name='tip'><pose>1 0 0 0 0 0</pose></link>
          <joint name='j' type='fixed'><parent>arm</parent><child>tip</child></joint></model>
        <joint name='hold' type='fixed'><parent>base</parent><child>inner::arm</child></joint>"""
    read = model(text)
    assert [link.name for link in read.links] == ["base", "inner::arm", "inner::tip"]
    assert read.links[2].pose.position == pytest.approx((0, 0, 1))
    assert read.links[1].pose.position == pytest.approx((0, -1, 1))
    assert [(j.name, j.parent, j.child) for j in read.joints] == [
        ("hold", "base", "inner::arm"),
        ("inner::j", "inner::arm", "inner::tip"),
    ]


def test_a_static_model_in_one_that_moves_is_fastened_to_the_world() -> None:
    read = model("<link name='a'/><model name='post'><static>true</static><link name='l'/></model>")
    assert [(j.kind, j.parent, j.child) for j in read.joints] == [(specs.JointType.FIXED, "world", "post::l")]


def test_models_of_a_world_may_be_placed_by_each_other(tmp_path: Path) -> None:
    text = f"""<frame name='desk'><pose>1 0 0 0 0 {HALF_TURN}</pose></frame>
        <model name='a'><pose relative_to='desk'>1 0 0 0 0 0</pose><link name='l'/></model>
        <model name='b'><pose relative_to='a'>1 0 0 0 0 0</pose><link name='l'/></model>"""
    a, b = world(tmp_path, text).models
    assert a.pose.position == pytest.approx((1, 1, 0))
    assert b.pose.position == pytest.approx((1, 2, 0))


def test_gravity_stands_where_the_version_has_it(tmp_path: Path) -> None:
    text = "<physics type='ode'><gravity>0 0 -1</gravity></physics>"
    assert world(tmp_path, text, "1.5").gravity == (0, 0, -1)
    assert world(tmp_path, text, "1.6").gravity == (0, 0, -9.8)


def test_a_light_is_no_model_and_stops_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "models" / "sun"
    folder.mkdir(parents=True)
    (folder / "model.config").write_text("<model><sdf version='1.5'>model.sdf</sdf></model>")
    (folder / "model.sdf").write_text("<sdf version='1.5'><light name='sun' type='directional'/></sdf>")
    read = world(tmp_path, "<include><uri>model://sun</uri></include>", "1.5", folder.parent)
    assert read.models == ()
    assert "<include>" in read.ignored[0]
    with pytest.raises(DescriptionError, match="only a light or an actor"):
        read_model_text("<sdf version='1.5'><light name='sun'/></sdf>", "text", Resources())


def test_the_frame_of_an_old_pose_may_name_nothing_and_otherwise_counts() -> None:
    for name, x in (("nothing_known", 0.3), ("b", 1.3)):
        links = f"<link name='a'><pose frame='{name}'>0.3 0 0 0 0 0</pose></link>"
        text = f"{links}<link name='b'><pose>1 0 0 0 0 0</pose></link>"
        assert model(text, "1.6").links[0].pose.position == pytest.approx((x, 0, 0))
    with pytest.raises(DescriptionError, match="relative to 'nothing_known'"):
        model("<link name='a'><pose relative_to='nothing_known'>0.3 0 0 0 0 0</pose></link>")


def test_a_saved_world_is_read_as_it_was_saved(tmp_path: Path) -> None:
    text = """<model name='a'><pose>9 9 9 0 0 0</pose><link name='l'/></model>
        <state world_name='w'><model name='a'><pose>1 2 3 0 0 0</pose><scale>1 1 1</scale>
        <link name='l'><pose>1 2 4 0 0 0</pose></link></model></state>"""
    read = world(tmp_path, text, "1.6").models[0]
    assert (read.pose.position, read.links[0].pose.position) == ((1, 2, 3), (0, 0, 1))
    with pytest.raises(DescriptionError, match="got '0 1 1'; allowed: numbers greater than 0"):
        world(tmp_path, text.replace("1 1 1", "0 1 1"), "1.6")
    with pytest.raises(DescriptionError, match="adds or removes models"):
        world(tmp_path, "<state><deletions><name>a</name></deletions></state>", "1.6")


def test_a_saved_scale_changes_shapes_and_neither_their_poses_nor_the_mass_as_in_gazebo(tmp_path: Path) -> None:
    """The rules are those of SetScale in Gazebo 11: BoxShape, CylinderShape, SphereShape and MeshShape."""
    (tmp_path / "m.stl").write_text("solid m\nendsolid m\n")
    shapes = {
        "box": "<box><size>0.1 0.2 0.3</size></box>",
        "cylinder": "<cylinder><radius>0.1</radius><length>0.4</length></cylinder>",
        "sphere": "<sphere><radius>0.1</radius></sphere>",
        "mesh": f"<mesh><uri>{tmp_path / 'm.stl'}</uri><scale>0.001 0.001 0.001</scale></mesh>",
    }
    elements = "".join(
        f"<{tag} name='{name}'><pose>0 0 1 0 0 0</pose><geometry>{shape}</geometry></{tag}>"
        for tag in ("collision", "visual")
        for name, shape in shapes.items()
    )
    inertial = "<inertial><mass>3</mass></inertial>"
    text = f"""<model name='a'><link name='l'>{inertial}{elements}</link></model><state world_name='w'>
        <model name='a'><pose>1 0 0 0 0 0</pose><scale>2 3 4</scale></model></state>"""
    (link,) = world(tmp_path, text, "1.6").models[0].links
    for found in (link.collisions, link.visuals):
        box, cylinder, sphere, mesh = (each.geometry for each in found)
        assert box == specs.Box(pytest.approx((0.2, 0.6, 1.2)))
        assert cylinder == specs.Cylinder(pytest.approx(0.3), pytest.approx(1.6))
        assert sphere == specs.Sphere(pytest.approx(0.4))
        assert mesh.scale == (2.0, 3.0, 4.0)
        assert {each.pose.position for each in found} == {(0, 0, 1)}
    assert link.inertial.mass == 3.0


@pytest.mark.parametrize("start", ["\n\n", "\ufeff", " ", "<!-- licence\n of two lines -->\n"])
def test_what_stands_before_the_declaration_does_no_harm(start: str) -> None:
    text = f"{start}<?xml version='1.0'?>\n<sdf version='1.6'><model name='m'><link name='a'/>\n<link/></model></sdf>"
    with pytest.raises(DescriptionError, match=f"^text:{3 + start.count(chr(10))}: <link>: has no name"):
        read_model_text(text, "text", Resources())


def test_a_world_in_another_encoding_is_read(tmp_path: Path) -> None:
    path = tmp_path / "test.world"
    text = "<?xml version='1.0' encoding='iso-8859-1'?><sdf version='1.6'><world name='B\u00fcro'/></sdf>"
    path.write_bytes(text.encode("iso-8859-1"))
    assert read_world(path, Resources()).name == "B\u00fcro"


def test_folders_come_from_gazebos_variables_and_three_slashes_are_as_good_as_two(tmp_path: Path) -> None:
    block = tmp_path / "found" / "block"
    block.mkdir(parents=True)
    (block / "model.sdf").write_text("<sdf version='1.6'><model name='block'><link name='l'/></model></sdf>")
    environment = {"GAZEBO_MODEL_PATH": f"/nowhere::{block.parent}", "GAZEBO_RESOURCE_PATH": str(tmp_path)}
    resources = Resources(
        model_folders((), environment), resource_folders=folders_of(environment, "GAZEBO_RESOURCE_PATH")
    )
    for uri in ("model://block", "model:///block", "file://found/block", "https://fuel.x.org/1.0/y/models/Block"):
        text = f"<sdf version='1.6'><world name='w'><include><uri>{uri}</uri></include></world></sdf>"
        assert read_model_text(text, "text", resources).name == "block"


def test_inertias_that_no_body_has_are_replaced_with_a_word() -> None:
    text = """<link name='l'><inertial><mass>6</mass><inertia><ixx>0</ixx><iyy>0</iyy><izz>0</izz></inertia></inertial>
        <collision name='c'><geometry><box><size>1 1 1</size></box></geometry></collision></link>"""
    read = model(text)
    assert read.links[0].inertial is not None
    assert read.links[0].inertial.inertia == pytest.approx((1, 0, 0, 1, 0, 1))
    assert "with a mass of 6 kg" in read.notes[0]
    assert model(f"<static>1</static>{text}").notes == ()


def test_an_inertia_is_computed_where_the_file_asks_for_it() -> None:
    text = """<link name='l'><inertial auto='true'/><collision name='a'><density>6</density><pose>0 0 1 0 0 0</pose>
        <geometry><box><size>1 1 1</size></box></geometry></collision></link>"""
    inertial = model(text, "1.11").links[0].inertial
    assert inertial is not None
    assert (inertial.mass, inertial.pose.position) == (6, (0, 0, 1))
    assert inertial.inertia == pytest.approx((1, 0, 0, 1, 0, 1))


def test_what_has_no_effect_is_named_once_a_model() -> None:
    text = f"""<link name='a'>{INERTIAL}<bogus/><bogus/></link>
        <allow_auto_disable>0</allow_auto_disable>"""
    notes = model(text).notes
    assert [note.partition(": ")[2] for note in notes] == [
        "<bogus>: SDF defines no <bogus> in <link>",
        "<allow_auto_disable>: has no effect",
    ]


def test_the_mesh_of_something_seen_may_be_missing_but_not_of_something_touched(tmp_path: Path) -> None:
    mesh = "<geometry><mesh><uri>model://gone/a.dae</uri></mesh></geometry>"
    read = model(f"<link name='l'>{INERTIAL}<visual name='v'>{mesh}</visual></link>")
    assert read.links[0].visuals == ()
    assert "is not drawn: text:2: <uri>: 'model://gone/a.dae' does not exist" in read.notes[0]
    with pytest.raises(DescriptionError, match="does not exist"):
        model(f"<link name='l'><collision name='c'>{mesh}</collision></link>")


def test_a_capsule_is_a_cylinder_with_two_balls() -> None:
    shape = "<geometry><capsule><radius>1</radius><length>4</length></capsule></geometry>"
    shapes = model(f"<link name='l'><collision name='c'>{shape}</collision></link>").links[0].collisions
    assert [each.geometry for each in shapes] == [specs.Cylinder(1, 4), specs.Sphere(1), specs.Sphere(1)]
    assert [each.pose.position[2] for each in shapes] == [0, 2, -2]


WORLD_1_0 = """<gazebo version="1.0"><world name="old">
  <physics type="ode" update_rate="1000"><gravity xyz="0 0 -3.7"/></physics>
  <model name="arm" static="false"><origin pose="0 0 2.1 0.5 0 0"/>
    <link name="bar" self_collide="true" gravity="false" kinematic="false"><origin pose="0 0 0.1 0 0 0"/>
      <inertial mass="10"><origin pose="0 0 -0.5 0 0 0"/><inertia ixx="1" ixy="0" ixz="0" iyy="2" iyz="0" izz="3"/>
      </inertial>
      <visual name="v" cast_shadows="true" transparency="0.5"><geometry><box size="1 2 3"/></geometry>
        <material script="Gazebo/Green"/></visual>
      <collision name="c"><origin pose="0 0 -0.4 0 0 0"/><geometry><cylinder radius="0.1" length="1.5"/></geometry>
        <surface><friction><ode mu="0.5" mu2="0.2" fdir1="1 0 0"/></friction>
          <bounce restitution_coefficient="0.3" threshold="1"/>
          <contact><ode kp="1e5" kd="1e3" max_vel="100" min_depth="0.0001"/></contact></surface></collision></link>
    <joint name="hinge" type="revolute"><parent link="world"/><child link="bar"/><origin pose="0 0 0.2 0 0 0"/>
      <axis xyz="0 1 0"><limit lower="-1" upper="2" effort="30" velocity="4"/><dynamics damping="1.5" friction="0.1"/>
      </axis></joint>
    <plugin name="p" filename="libsomething.so"><link mass="3"/></plugin></model>
  <model name="floor" static="true"><link name="l"><collision name="c"><geometry><plane normal="0 0 1"/></geometry>
    </collision></link></model>
</world></gazebo>"""


def test_values_in_attributes_of_sdf_1_0_are_read(tmp_path: Path) -> None:
    path = tmp_path / "old.world"
    path.write_text(WORLD_1_0)
    world = read_world(path, Resources())
    assert world.gravity == (0, 0, -3.7)
    arm, floor = world.models
    assert (arm.static, floor.static) == (False, True)
    assert arm.pose.position == (0, 0, 2.1)
    bar, shape, hinge = arm.links[0], arm.links[0].collisions[0], arm.joints[0]
    assert (bar.gravity, bar.self_collide, bar.pose.position) == (False, True, (0, 0, 0.1))
    assert bar.inertial is not None
    assert (bar.inertial.mass, bar.inertial.inertia) == (10, (1, 0, 0, 2, 0, 3))
    assert bar.inertial.pose.position == (0, 0, -0.5)
    assert (shape.geometry, shape.pose.position) == (specs.Cylinder(0.1, 1.5), (0, 0, -0.4))
    assert shape.friction == specs.Friction(0.5, mu2=0.2)
    assert shape.bounce == specs.Bounce(0.3, 1.0)
    assert (shape.contact.kp, shape.contact.kd) == (1e5, 1e3)
    assert bar.visuals[0].colour == (0, 1, 0, 0.5)
    assert (hinge.parent, hinge.child, hinge.lower, hinge.upper, hinge.effort) == ("world", "bar", -1, 2, 30)
    assert (hinge.dynamics.damping, hinge.dynamics.friction) == (1.5, 0.1)
    assert hinge.pose.position == pytest.approx((0, 0, 0.2))


def test_a_fault_in_a_file_of_sdf_1_0_is_named_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "old.world"
    path.write_text(WORLD_1_0.replace('radius="0.1"', 'radius="-0.1"'))
    with pytest.raises(DescriptionError, match=r"old\.world:9: <radius>: got '-0.1'"):
        read_world(path, Resources())


def test_the_filename_of_a_mesh_is_its_address_in_old_files(tmp_path: Path) -> None:
    (tmp_path / "plate.stl").write_bytes(b"solid")
    text = """<sdf version='1.3'><model name='m'><link name='a'><collision name='c'><geometry><mesh>
        <filename>{}</filename></mesh></geometry></collision></link></model></sdf>"""
    read = read_model_text(text.format(tmp_path / "plate.stl"), "test", Resources())
    assert read.links[0].collisions[0].geometry == specs.Mesh(tmp_path / "plate.stl")
    with pytest.raises(DescriptionError, match=r"'chair3/model/chair\.stl' does not exist"):
        read_model_text(text.format("chair3/model/chair.stl"), "test", Resources())


def test_models_of_one_name_get_numbers_in_old_files_and_are_refused_in_new_ones(tmp_path: Path) -> None:
    one = "<model name='box'><pose>{} 0 0 0 0 0</pose><static>1</static><link name='l'/></model>\n"
    body = one.format(1) + one.format(2) + one.format(3).replace("'box'", "'box_0'") + one.format(4)
    read = world(tmp_path, body, "1.5")
    assert {model.name: model.pose.position[0] for model in read.models} == {
        "box": 1,
        "box_0": 2,
        "box_0_0": 3,
        "box_1": 4,
    }
    assert any("is a second model 'box'; the model is renamed to 'box_1'" in note for note in read.models[3].notes)
    with pytest.raises(DescriptionError, match=r"test\.world:4: <model name='box'>: is a second model 'box'"):
        world(tmp_path, body, "1.7")


def test_a_negative_correcting_velocity_is_none() -> None:
    contact = "<surface><contact><ode><max_vel>-1</max_vel></ode></contact></surface>"
    shape = f"<collision name='c'><geometry><sphere><radius>1</radius></sphere></geometry>{contact}</collision>"
    assert model(f"<link name='a'>{shape}</link>").links[0].collisions[0].contact.max_vel is None
