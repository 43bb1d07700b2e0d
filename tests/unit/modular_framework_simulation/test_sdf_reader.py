# SPDX-License-Identifier: BSD-3-Clause
"""World and model files are read as SDF defines them, and faults are pointed at by file, line and element."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.sdf_reader import read_model_text, read_world
from modular_framework_simulation.models.sdf_resources import Resources

TETRAHEDRON = "\n".join(["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1", "f 1 3 2", "f 1 2 4", "f 2 3 4", "f 1 4 3"])


def model(body: str, version: str = "1.6") -> specs.Model:
    return read_model_text(f"<sdf version='{version}'><model name='m'>\n{body}\n</model></sdf>", "text", Resources())


def shape(text: str) -> specs.Geometry:
    link = f"<link name='l'><collision name='c'><geometry>{text}</geometry></collision></link>"
    return model(link).links[0].collisions[0].geometry


@pytest.fixture
def model_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "models" / "block"
    folder.mkdir(parents=True)
    (folder / "mesh.obj").write_text(TETRAHEDRON)
    (folder / "old.sdf").write_text("not read")
    (folder / "new.sdf").write_text(
        "<sdf version='1.6'><model name='block'><pose>9 9 9 0 0 0</pose><link name='link'><collision name='c'>"
        "<geometry><mesh><uri>model://block/mesh.obj</uri><scale>2 2 2</scale></mesh>"
        "</geometry></collision></link></model></sdf>"
    )
    (folder / "model.config").write_text(
        "<model><sdf version='1.4'>old.sdf</sdf><sdf version='1.6'>new.sdf</sdf></model>"
    )
    return folder.parent


def world(tmp_path: Path, body: str, *folders: Path) -> specs.World:
    path = tmp_path / "test.world"
    path.write_text(f"<sdf version='1.6'>\n<world name='w'>\n{body}\n</world></sdf>")
    return read_world(path, Resources(folders))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<box><size>1 2 3</size></box>", specs.Box((1, 2, 3))),
        ("<cylinder><radius>0.5</radius><length>2</length></cylinder>", specs.Cylinder(0.5, 2)),
        ("<sphere><radius>0.1</radius></sphere>", specs.Sphere(0.1)),
        ("<plane><normal>0 0 2</normal><size>5 5</size></plane>", specs.Plane((0, 0, 1), (5, 5))),
    ],
)
def test_each_shape_is_read(text: str, expected: specs.Geometry) -> None:
    assert shape(text) == expected


def test_an_include_finds_the_newest_description_and_takes_name_pose_and_static(
    tmp_path: Path, model_folder: Path
) -> None:
    text = (
        "<include><uri>model://block</uri><name>b1</name><pose>1 2 3 0 0 1.5</pose><static>true</static></include>"
        "<include><uri>model://block</uri></include>"
    )
    first, second = world(tmp_path, text, model_folder).models
    assert (first.name, first.static, first.pose.position) == ("b1", True, (1, 2, 3))
    assert (second.name, second.static, second.pose.position) == ("block", False, (9, 9, 9))
    mesh = first.links[0].collisions[0].geometry
    assert mesh == specs.Mesh(model_folder / "block" / "mesh.obj", (2, 2, 2))


def test_gravity_defaults_to_that_of_sdf_and_can_be_set(tmp_path: Path) -> None:
    assert world(tmp_path, "").gravity == (0, 0, -9.8)
    assert world(tmp_path, "<gravity>0 0 -1.6</gravity>").gravity == (0, 0, -1.6)


def test_what_means_nothing_here_is_read_over_and_listed(tmp_path: Path) -> None:
    read = world(
        tmp_path,
        "<light name='sun' type='point'/>\n<plugin name='x'/><physics><max_step_size>0.004</max_step_size></physics>",
    )
    assert [entry.split(": ")[1] for entry in read.ignored] == ["<plugin>"]
    assert read.step_s == 0.004


def test_poses_relative_to_other_frames_are_resolved() -> None:
    text = """<frame name='f' attached_to='a'><pose>1 0 0 0 0 0</pose></frame>
        <link name='a'><pose>0 0 1 0 0 1.5707963267948966</pose></link>
        <link name='b'><pose relative_to='f'>1 0 0 0 0 0</pose></link>
        <joint name='j' type='fixed'><parent>a</parent><child>b</child></joint>"""
    link = model(text, "1.7").links[1]
    assert link.pose.position == pytest.approx((0, 2, 1))


def test_friction_of_bullet_counts_in_both_directions_where_ode_has_none() -> None:
    text = """<link name='a'><collision name='c'><geometry><sphere><radius>1</radius></sphere></geometry><surface>
        <friction><bullet><friction>0.7</friction><friction2>0.6</friction2></bullet></friction></surface></collision>
        </link>"""
    read = model(text)
    assert read.links[0].collisions[0].friction == specs.Friction(0.7, mu2=0.6)
    assert not any("friction" in note for note in read.notes)


def test_friction_inertia_and_joints_are_read() -> None:
    text = """<link name='a'><inertial><mass>2</mass><pose>0 0 0.1 0 0 0</pose>
          <inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.15</izz></inertia></inertial>
          <collision name='c'><geometry><sphere><radius>1</radius></sphere></geometry><surface><friction>
          <ode><mu>0.4</mu></ode><torsional><coefficient>0.02</coefficient></torsional>
          <bullet><rolling_friction>0.003</rolling_friction></bullet></friction></surface></collision></link>
        <link name='b'/>
        <joint name='hinge' type='revolute'><parent>a</parent><child>b</child>
          <axis><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>2</upper></limit></axis></joint>"""
    read = model(text)
    assert read.links[0].inertial is not None
    assert read.links[0].inertial.mass == 2
    assert read.links[0].collisions[0].friction == specs.Friction(0.4, 0.02, 0.003)
    hinge = read.joints[0]
    assert (hinge.axis, hinge.lower, hinge.upper) == ((0, 1, 0), -1, 2)


def test_a_joint_without_limits_turns_without_end() -> None:
    text = """<link name='a'/><link name='b'/><joint name='j' type='continuous'><parent>a</parent><child>b</child>
        <axis><xyz>1 0 0</xyz></axis></joint>"""
    assert math.isinf(model(text).joints[0].upper)


@pytest.mark.parametrize(
    ("body", "line", "said"),
    [
        ("<link name='l'>\n<pose>1 2 3</pose></link>", 3, ["<pose>", "'1 2 3'", "expected 6"]),
        ("<link name='l'><collision name='c'>\n<geometry><cone/></geometry></collision></link>", 3, ["<cone>", "box"]),
        ("<link name='l'>\n<collision><geometry/></collision></link>", 3, ["<collision>", "no name"]),
        ("<link name='l'><inertial>\n<mass>-1</mass></inertial></link>", 3, ["<mass>", "-1", "greater than 0"]),
        ("<link name='a'/>\n<link name='a'/>", 3, ["the name of another link"]),
        ("\n<model name='inner'/>", 3, ["<model name='inner'>", "no <link>"]),
        ("", 1, ["no <link>"]),
        (
            "<link name='a'/><link name='b'/>\n<joint name='j' type='screw'><parent>a</parent><child>b</child></joint>",
            3,
            ["'screw'", "fixed, revolute, continuous, prismatic"],
        ),
        (
            "<link name='a'/>\n<joint name='j' type='fixed'><parent>a</parent><child>c</child></joint>",
            3,
            ["<child>", "'c' is not a link", "allowed: a"],
        ),
        ("<link name='a'><pose relative_to='nowhere'>0 0 0 0 0 0</pose></link>", 1, ["'nowhere'", "allowed"]),
        (
            "<frame name='f'><pose relative_to='g'>0 0 0 0 0 0</pose></frame>"
            "<frame name='g'><pose relative_to='f'>0 0 0 0 0 0</pose></frame>"
            "\n<link name='a'><pose relative_to='f'>0 0 0 0 0 0</pose></link>",
            2,
            ["depends on itself"],
        ),
        (
            "<link name='l'><collision name='c'><geometry>"
            "\n<box><size>1 1e30 1</size></box></geometry></collision></link>",
            3,
            ["<size>", "1e30", "at most 10000 m"],
        ),
        (
            "<link name='l'><collision name='c'><geometry>"
            "\n<box><size>0 1 1</size></box></geometry></collision></link>",
            3,
            ["<size>", "greater than 0"],
        ),
        (
            "<link name='l'><collision name='c'><geometry>"
            "\n<mesh><uri>x.stl</uri></mesh></geometry></collision></link>",
            3,
            ["<uri>", "'x.stl' does not exist"],
        ),
    ],
)
def test_a_fault_is_pointed_at(body: str, line: int, said: list[str]) -> None:
    with pytest.raises(DescriptionError) as caught:
        model(body)
    message = str(caught.value)
    assert message.startswith(f"text:{line}: ")
    for words in said:
        assert words in message


def test_a_static_model_may_have_loose_links() -> None:
    assert len(model("<static>true</static><link name='a'/><link name='b'/>").links) == 2


def test_broken_documents_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match=r"text:1: .*well-formed"):
        read_model_text("<sdf version='1.6'><model>", "text", Resources())
    with pytest.raises(DescriptionError, match=r"'2\.0'; allowed: 1\.0 to 1\.11"):
        read_model_text("<sdf version='2.0'/>", "text", Resources())
    with pytest.raises(DescriptionError, match="contains no <model>"):
        read_model_text("<sdf version='1.6'/>", "text", Resources())
    with pytest.raises(DescriptionError, match="allowed: <sdf"):
        read_model_text("<robot/>", "text", Resources())
    with pytest.raises(DescriptionError, match="cannot be read"):
        read_world(tmp_path / "missing.world", Resources())


def test_a_missing_model_is_refused(tmp_path: Path, model_folder: Path) -> None:
    with pytest.raises(DescriptionError, match="'model://nothing' does not exist"):
        world(tmp_path, "<include><uri>model://nothing</uri></include>", model_folder)
    with pytest.raises(DescriptionError, match="allowed: model://, package://, file://"):
        world(tmp_path, "<include><uri>http://x/y</uri></include>")


def test_a_model_that_includes_itself_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "models" / "echo"
    folder.mkdir(parents=True)
    (folder / "model.sdf").write_text("<sdf version='1.6'><include><uri>model://echo</uri></include></sdf>")
    with pytest.raises(DescriptionError, match="break the circle"):
        world(tmp_path, "<include><uri>model://echo</uri></include>", tmp_path / "models")
