# SPDX-License-Identifier: BSD-3-Clause
"""Broken and hostile worlds, models and meshes are refused with file, line and reason, none ends anything."""

from __future__ import annotations

from pathlib import Path

import pytest

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.sdf_reader import read_model_text, read_world
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.urdf_model import read_urdf_model
from modular_framework_simulation.physics.body_urdf import model_to_urdf
from modular_framework_simulation.viewer.glb_files import bodies_of_visuals

BOMB = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 30}">' for n in range(1, 12))
LINK = "<link name='a'/><link name='b'/>"


def geometry(text: str) -> str:
    return f"<link name='a'><collision name='c'>\n<geometry>{text}</geometry></collision></link>"


def joint(text: str, kind: str = "revolute", parent: str = "a", child: str = "b") -> str:
    ends = f"<parent>{parent}</parent><child>{child}</child>"
    return f"{LINK}\n<joint name='j' type='{kind}'>{ends}{text}</joint>"


IN_A_MODEL = {
    "text that is no XML": ("<link name='a'", 3, "not well-formed"),
    "an attribute without quotes": ("\n<link name=a/>", 3, "not well-formed"),
    "no links at all": ("<plugin name='p'/>", 1, "has no <link>"),
    "a link without a name": ("\n<link/>", 3, "has no name"),
    "two links of one name": ("<link name='a'/>\n<link name='a'/>", 3, "the name of another link"),
    "two joints of one name": (joint("", "ball") + "\n<joint name='j' type='ball'><parent>a</parent>"
        "<child>b</child></joint>", 4, "the name of another joint"),
    "a pose of five numbers": ("<link name='a'>\n<pose>1 2 3 4 5</pose></link>", 3, "expected 6 finite"),
    "a pose that is not a number": ("<link name='a'>\n<pose>0 0 nan 0 0 0</pose></link>", 3, "expected 6 finite"),
    "a pose without end": ("<link name='a'>\n<pose>0 0 1e999 0 0 0</pose></link>", 3, "expected 6 finite"),
    "a pose beyond the moon": ("<link name='a'>\n<pose>1e9 0 0 0 0 0</pose></link>", 3, "numbers up to 1,000,000"),
    "an angle without sense": ("<link name='a'>\n<pose>0 0 0 1e300 0 0</pose></link>", 3, "numbers up to 1,000,000"),
    "a mass of a planet": ("<link name='a'><inertial>\n<mass>1e30</mass></inertial></link>", 3, "1e-09 to 1e+09 kg"),
    "a mass of an atom": ("<link name='a'><inertial>\n<mass>1e-300</mass></inertial></link>", 3, "1e-09 to 1e+09 kg"),
    "a moment of a planet": (
        "<link name='a'><inertial>\n<inertia><ixx>1e30</ixx></inertia></inertial></link>", 3, "moment 1e+30 kg m^2"),
    "an axis without end": (joint("<axis><xyz>1.7e308 1.7e308 0</xyz></axis>"), 3, "expected a direction"),
    "a quaternion of length 0.1": (
        "<link name='a'>\n<pose rotation_format='quat_xyzw'>0 0 0 0 0 0 0.1</pose></link>", 3, "expected 1"),
    "a pose relative to nothing": ("<link name='a'><pose relative_to='x'>0 0 0 0 0 0</pose></link>", 1, "'x'"),
    "frames in a circle": (
        "\n<link name='a'><pose relative_to='b'>0 0 0 0 0 0</pose></link>"
        "<link name='b'><pose relative_to='a'>0 0 0 0 0 0</pose></link>", 3, "depends on itself"),
    "frames in a circle that nothing uses": (
        f"{LINK}\n<frame name='f'><pose relative_to='g'>1 0 0 0 0 0</pose></frame>"
        "<frame name='g'><pose relative_to='f'>1 0 0 0 0 0</pose></frame>", 3, "depends on itself"),
    "frames attached in a circle": (
        f"{LINK}<frame name='f' attached_to='g'/><frame name='g' attached_to='f'/>"
        "<joint name='j' type='fixed'><parent>a</parent><child>f</child></joint>", 2, "depends on itself"),
    "frames attached in a circle that have poses elsewhere": (
        f"{LINK}<frame name='f' attached_to='g'><pose relative_to='a'>1 0 0 0 0 0</pose></frame>"
        "<frame name='g' attached_to='f'><pose relative_to='a'>1 0 0 0 0 0</pose></frame>", 1, "attached to itself"),
    "a frame attached to nothing": (
        f"{LINK}<frame name='f' attached_to='h'><pose relative_to='a'>1 0 0 0 0 0</pose></frame>", 1, "'h'; allowed: "),
    "xacro": ("<link name='a'/>\n<xacro:body/>", 3, "is xacro"),
    "a name of xacro": ("\n<link name='${prefix}a'/>", 3, "is xacro"),
    "a mass of 0": ("<link name='a'><inertial>\n<mass>0</mass></inertial></link>", 3, "greater than 0"),
    "a box of length 0": (geometry("<box><size>1 0 1</size></box>"), 3, "greater than 0"),
    "a box as large as the sea": (geometry("<box><size>1 1e9 1</size></box>"), 3, "at most 10000 m"),
    "a sphere of negative radius": (geometry("<sphere><radius>-1</radius></sphere>"), 3, "greater than 0"),
    "two shapes in one": (geometry("<box><size>1 1 1</size></box><sphere><radius>1</radius></sphere>"), 3, "exactly"),
    "a heightmap": (geometry("<heightmap><uri>a.png</uri></heightmap>"), 3, "<heightmap>"),
    "a plane without a direction": (geometry("<plane><normal>0 0 0</normal></plane>"), 3, "length 0"),
    "a mesh from the network": (geometry("<mesh><uri>ftp://x/a.stl</uri></mesh>"), 3, "allowed: model://"),
    "a mesh that is no mesh": (geometry("<mesh><uri>/etc/hostname</uri></mesh>"), 3, "allowed: .stl"),
    "a mesh without a size": (geometry(f"<mesh><uri>{__file__}</uri><scale>1 1 1</scale></mesh>"), 3, "allowed: .stl"),
    "a friction that is a word": (
        geometry("<box><size>1 1 1</size></box>").replace("</collision>", "<surface><friction><ode><mu>slippery</mu>"
        "</ode></friction></surface></collision>"), 3, "expected 1 finite"),
    "a bounce of 2": (
        geometry("<box><size>1 1 1</size></box>").replace("</collision>", "<surface><bounce><restitution_coefficient>2"
        "</restitution_coefficient></bounce></surface></collision>"), 3, "allowed: 0 to 1"),
    "a screw": (joint("", "screw"), 3, "'screw'; allowed: fixed, revolute"),
    "a universal joint": (joint("", "universal"), 3, "'universal'"),
    "a revolute2": (joint("", "revolute2"), 3, "'revolute2'"),
    "a gearbox": (joint("", "gearbox"), 3, "'gearbox'"),
    "a hinge without an axis": (joint(""), 3, "has no <axis>"),
    "an axis of length 0": (joint("<axis><xyz>0 0 0</xyz></axis>"), 3, "length 0"),
    "limits the wrong way round": (
        joint("<axis><xyz>0 0 1</xyz><limit><lower>1</lower><upper>0</upper></limit></axis>"), 3, "lower 1"),
    "a negative damping": (
        joint("<axis><xyz>0 0 1</xyz><dynamics><damping>-1</damping></dynamics></axis>"), 3, "0 or greater"),
    "a joint to nowhere": (joint("", "fixed", child="x"), 3, "'x' is not a link"),
    "a hinge that carries the world": (joint("<axis/>", child="world"), 3, "is the world"),
    "a model merged into another": ("<include merge='true'><uri>model://x</uri></include>", 2, "merge='true'"),
    "static of maybe": ("\n<static>maybe</static><link name='a'/>", 3, "allowed: true, false"),
}  # fmt: skip


@pytest.mark.parametrize("name", IN_A_MODEL)
def test_a_broken_model_is_refused_with_its_line(name: str) -> None:
    body, line, said = IN_A_MODEL[name]
    with pytest.raises(DescriptionError) as caught:
        read_model_text(f"<sdf version='1.9'><model name='m'>\n{body}\n</model></sdf>", "text", Resources())
    message = str(caught.value)
    assert message.startswith(f"text:{line}: ")
    assert said in message


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            f"<?xml version='1.0'?>\n<!DOCTYPE sdf [<!ENTITY e0 'x'>{BOMB}]>\n<sdf version='1.6'>&e11;</sdf>",
            ":2: got a D",
        ),
        ("", ":1: not an XML document"),
        ("\x00\x01", ":1: not an XML document"),
        ("<sdf/>", ":1: <sdf>: got version ''"),
        ("<sdf version='9.9'/>", ":1: <sdf>: got version '9.9'; allowed: 1.0 to 1.11"),
        ("<html/>", ":1: <html>: the root element is <html>"),
        ("<sdf version='1.6'>" + "<model name='m'>" * 40 + "</model>" * 40 + "</sdf>", "break the circle"),
        ("<sdf version='1.6'>" + "<a>" * 5000 + "</a>" * 5000 + "</sdf>", "not an XML document"),
    ],
)
def test_a_broken_document_is_refused(text: str, said: str) -> None:
    with pytest.raises(DescriptionError) as caught:
        read_model_text(text, "text", Resources())
    assert str(caught.value).startswith("text:")
    assert said in str(caught.value)


def test_files_that_include_each_other_many_times_over_are_refused(tmp_path: Path) -> None:
    for number in range(7):
        inner = "".join(f"<include><name>n{n}</name><uri>model://m{number + 1}</uri></include>" for n in range(10))
        body = inner if number < 6 else "<link name='l'/>"
        (tmp_path / f"m{number}").mkdir()
        (tmp_path / f"m{number}" / "model.sdf").write_text(f"<sdf version='1.6'><model name='m'>{body}</model></sdf>")
    path = tmp_path / "bomb.world"
    path.write_text("<sdf version='1.6'><world name='w'><include><uri>model://m0</uri></include></world></sdf>")
    with pytest.raises(DescriptionError, match=r"is model number 10,001; allowed: 10,000"):
        read_world(path, Resources((tmp_path,)))


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("<population name='p'/>", ":2: <population name='p'>: is not supported"),
        ("<joint name='j'/>", ":2: <joint name='j'>: is not supported"),
        ("<gravity>0 0 down</gravity>", ":2: <gravity>: got '0 0 down'"),
        ("<include/>", ":2: <include>: has no <uri>"),
        ("<include><uri></uri></include>", "does not exist"),
        ("<gravity>0 0 -1e30</gravity>", ":2: <gravity>: got '0 0 -1e30'; allowed: up to 10000 m/s^2"),
    ],
)
def test_a_broken_world_is_refused(tmp_path: Path, body: str, said: str) -> None:
    path = tmp_path / "test.world"
    path.write_text(f"<sdf version='1.6'><world name='w'>\n{body}</world></sdf>")
    with pytest.raises(DescriptionError) as caught:
        read_world(path, Resources())
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (
            "<link name='a'/><joint name='j' type='floating'><parent link='world'/><child link='a'/></joint>",
            "'floating'; allowed: fixed, revolute, continuous",
        ),
        (
            "<link name='a'/><link name='b'/><joint name='j' type='fixed'><parent link='a'/><child link='b'/></joint>"
            "\n<joint name='k' type='fixed'><parent link='a'/><child link='b'/></joint>",
            ":2: <joint name='k'>: gives link 'b' a second parent",
        ),
        (
            "<link name='a'><inertial>\n<mass value='-1'/><inertia/></inertial></link>",
            ":2: <mass>: got mass -1 kg",
        ),
        (
            "<link name='a'/><link name='b'/>\n<joint name='j' type='revolute'><parent link='a'/><child link='b'/>"
            "<axis xyz='0 0 0'/></joint>",
            "length 0",
        ),
    ],
)
def test_a_broken_urdf_is_refused(body: str, said: str) -> None:
    with pytest.raises(DescriptionError) as caught:
        read_urdf_model(f"<robot name='r'>{body}</robot>", "text", Resources())
    assert said in str(caught.value)


TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
BROKEN_MESHES = {
    "text.stl": ("this is no mesh\n", "is not a complete STL file"),
    "cut.obj": ("v 0 0 0\nf 1 2 9\n", "is not a complete OBJ file"),
    "flat.obj": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "has no convex hull (QH"),
    "far.obj": (TETRAHEDRON.replace("1", "9e9", 1), "m from the origin; allowed: at most 10000 m"),
}


def world_with(tmp_path: Path, body: str) -> specs.World:
    path = tmp_path / "test.world"
    path.write_text(f"<sdf version='1.6'><world name='w'>\n{body}</world></sdf>")
    return read_world(path, Resources())


@pytest.mark.parametrize("name", BROKEN_MESHES)
def test_a_broken_mesh_is_refused_with_the_line_of_the_world_that_names_it(
    tmp_path: Path, convex_parts: ConvexParts, name: str
) -> None:
    content, said = BROKEN_MESHES[name]
    (tmp_path / name).write_text(content)
    shape = f"<geometry>\n<mesh><uri>{name}</uri></mesh></geometry>"
    body = "<model name='m'><link name='l'><{0} name='s'>" + shape + "</{0}></link></model>"
    (model,) = world_with(tmp_path, body.format("collision")).models
    with pytest.raises(DescriptionError) as caught:
        model_to_urdf(model, convex_parts, False)
    start = f"{tmp_path}/test.world:3: <mesh>: mesh file {tmp_path}/{name}: "
    assert str(caught.value).startswith(start) and said in str(caught.value)
    assert "\n" not in str(caught.value)
    if name == "flat.obj":  # is drawn
        return
    (model,) = world_with(tmp_path, body.format("visual")).models
    messages: list[str] = []
    assert bodies_of_visuals(model.links[0].visuals, messages.append) == []
    assert messages[0].startswith(f"the visual 's' is not drawn: {start}") and said in messages[0]


@pytest.mark.parametrize(
    ("library", "image", "said"),
    [
        (None, "", "the material library 'm.mtl' of m.obj does not exist"),
        ("newmtl a\nmap_Kd gone.png\n", "", "the image 'gone.png' of m.obj does not exist"),
        ("newmtl a\nmap_Kd bad.png\n", "no picture", "the image 'bad.png' of m.obj is not a readable image"),
    ],
)
def test_a_mesh_without_its_texture_is_drawn_with_a_warning(
    tmp_path: Path, library: str | None, image: str, said: str
) -> None:
    (tmp_path / "m.obj").write_text(f"mtllib m.mtl\nusemtl a\n{TETRAHEDRON}")
    if library is not None:
        (tmp_path / "m.mtl").write_text(library)
    (tmp_path / "bad.png").write_text(image)
    body = (
        "<model name='m'><link name='l'>\n<visual name='v'><geometry><mesh><uri>m.obj</uri></mesh></geometry></visual>"
    )
    (model,) = world_with(tmp_path, f"{body}</link></model>").models
    (note,) = [note for note in model.notes if "<visual" in note]
    assert note.startswith(f"{tmp_path}/test.world:3: <visual name='v'>: {said}") and "without a texture" in note
    assert bodies_of_visuals(model.links[0].visuals, pytest.fail)


def test_a_material_whose_image_is_no_picture_has_a_plain_colour_and_a_warning(tmp_path: Path) -> None:
    (tmp_path / "bad.png").write_text("no picture")
    (tmp_path / "m.material").write_text("material Foo { technique { pass { texture_unit { texture bad.png } } } }")
    look = "<material>\n<script><uri>m.material</uri><name>Foo</name></script></material>"
    box = f"<visual name='v'><geometry><box><size>1 1 1</size></box></geometry>{look}</visual>"
    (model,) = world_with(tmp_path, f"<model name='m'><link name='l'>{box}</link></model>").models
    assert model.links[0].visuals[0].texture is None
    assert any(":3: <script>: the image" in note and "is not a readable image" in note for note in model.notes)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("<light name='l'/>", ":2: <light name='l'> has the type '' (allowed: point, directional, spot)"),
        ("<light name='l' type='sunny'/>", "has the type 'sunny'"),
        ("<light type='point'/>", ":2: <light>: has no name"),
        ("<light name='l' type='spot'>\n<pose>nan 0 0 0 0 0</pose></light>", ":3: <pose>: got 'nan 0 0 0 0 0'"),
        ("<model name='world'><link name='l'/></model>", "has the name of the world frame"),
        ("<state world_name='w'>\n<model name='gone'/></state>", ":3: <model name='gone'> of a model that the world"),
    ],
)
def test_faults_without_effect_on_the_physics_are_warnings(tmp_path: Path, body: str, said: str) -> None:
    (line,) = world_with(tmp_path, body).ignored
    assert said in line


def test_moments_that_no_engine_computes_are_replaced_with_a_warning() -> None:
    tiny = "".join(f"<{key}>1e-300</{key}>" for key in ("ixx", "iyy", "izz"))
    box = "<collision name='c'><geometry><box><size>1 1 1</size></box></geometry></collision>"
    text = f"<model name='m'><link name='l'><inertial><inertia>{tiny}</inertia></inertial>{box}</link></model>"
    model = read_model_text(f"<sdf version='1.6'>{text}</sdf>", "text", Resources())
    assert model.links[0].inertial is not None and model.links[0].inertial.inertia[0] == pytest.approx(1.0 / 6.0)
    assert "the moments of its collision shapes" in model.notes[0]
