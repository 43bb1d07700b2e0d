# SPDX-License-Identifier: BSD-3-Clause
"""What is seen of a model has the size of its file's unit, the colours of its materials, and its pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.materials import gazebo_material, parse_material_script
from modular_framework_simulation.models.mesh_files import ConvexParts, load_mesh
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.visual_meshes import VisualMeshes
from modular_framework_simulation.physics.body_urdf import model_to_urdf
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld

SCRIPT = """// colours of a test
material Base
{
  technique { pass {
    ambient 1 0 0 1
    diffuse 0.5 0.25 0 1
  } }
}
material Painted : Base
{
  technique
  {
    pass main
    {
      /* diffuse 9 9 9 */
      texture_unit
      {
        texture paint.png
      }
    }
  }
}
"""

DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.01"/></asset>
<library_images><image id="i"><init_from>paint.png</init_from></image></library_images>
<library_effects>
<effect id="plain-e"><profile_COMMON><technique sid="t"><lambert><diffuse><color>0 0 1 1</color></diffuse></lambert>
</technique></profile_COMMON></effect>
<effect id="painted-e"><profile_COMMON>
<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="p"><sampler2D><source>s</source></sampler2D></newparam>
<technique sid="t"><lambert><diffuse><texture texture="p" texcoord="UV"/></diffuse></lambert></technique>
</profile_COMMON></effect></library_effects>
<library_materials><material id="plain"><instance_effect url="#plain-e"/></material>
<material id="painted"><instance_effect url="#painted-e"/></material></library_materials>
<library_geometries>{geometries}</library_geometries>
<library_visual_scenes><visual_scene id="scene">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#scene"/></scene></COLLADA>"""

GEOMETRY = """<geometry id="g-{name}"><mesh>
<source id="{name}-v"><float_array id="{name}-va" count="12">{x} 0 0 {right} 0 0 {right} 100 0 {x} 100 0</float_array>
<technique_common><accessor source="#{name}-va" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<source id="{name}-t"><float_array id="{name}-ta" count="8">0 0 1 0 1 1 0 1</float_array>
<technique_common><accessor source="#{name}-ta" count="4" stride="2"><param name="S" type="float"/>
<param name="T" type="float"/></accessor></technique_common></source>
<vertices id="{name}-p"><input semantic="POSITION" source="#{name}-v"/></vertices>
<triangles material="m" count="2"><input semantic="VERTEX" source="#{name}-p" offset="0"/>
<input semantic="TEXCOORD" source="#{name}-t" offset="1" set="0"/><p>0 0 1 1 2 2 0 0 2 2 3 3</p></triangles>
</mesh></geometry>"""

NODE = """<node id="n-{name}" name="{name}"><node><instance_geometry url="#g-{name}"><bind_material><technique_common>
<instance_material symbol="m" target="#{name}">
<bind_vertex_input semantic="UV" input_semantic="TEXCOORD" input_set="0"/>
</instance_material></technique_common></bind_material></instance_geometry></node></node>"""


@pytest.fixture
def model_folder(tmp_path: Path) -> Path:
    """A model with a mesh in centimetres: a blue square, and beside it one with a green picture."""
    folder = tmp_path / "sign"
    for name in ("meshes", "materials/textures", "materials/scripts"):
        (folder / name).mkdir(parents=True)
    parts = (("plain", 0), ("painted", 300))
    geometries = "".join(GEOMETRY.format(name=name, x=x, right=x + 100) for name, x in parts)
    nodes = "".join(NODE.format(name=name) for name, _ in parts)
    (folder / "meshes" / "sign.dae").write_text(DAE.format(geometries=geometries, nodes=nodes))
    (folder / "materials" / "scripts" / "sign.material").write_text(SCRIPT)
    Image.new("RGB", (4, 4), (0, 200, 0)).save(folder / "materials" / "textures" / "paint.png")
    return folder


def visual(mesh: specs.Mesh) -> specs.Visual:
    return specs.Visual("v", Pose(), mesh, specs.GREY, own_materials=True)


def vertices(obj: Path) -> np.ndarray:
    """The vertices of an .obj file."""
    lines = [line.split()[1:] for line in obj.read_text().splitlines() if line.startswith("v ")]
    return np.array(lines, dtype=float)


def test_a_mesh_is_drawn_in_metres_part_by_part(model_folder: Path, tmp_path: Path) -> None:
    meshes = VisualMeshes(tmp_path / "cache")
    plain, painted = meshes.parts(visual(specs.Mesh(model_folder / "meshes" / "sign.dae", (2, 1, 1))))
    assert plain.colour == pytest.approx((0, 0, 1, 1))
    assert vertices(plain.file).max(axis=0) == pytest.approx((2, 1, 0))
    assert vertices(painted.file).max(axis=0) == pytest.approx((8, 1, 0))
    assert not plain.file.with_suffix(".png").exists()
    with Image.open(painted.file.with_suffix(".png")) as picture:
        assert picture.getpixel((0, 0)) == (0, 200, 0)


def test_a_part_of_a_mesh_is_touched_and_drawn_alone(model_folder: Path, tmp_path: Path) -> None:
    mesh = specs.Mesh(model_folder / "meshes" / "sign.dae", submesh="painted", center=True)
    assert load_mesh(mesh).vertices.max(axis=0) == pytest.approx((0.5, 0.5, 0))
    (part,) = VisualMeshes(tmp_path / "cache").parts(visual(mesh))
    assert vertices(part.file).max(axis=0) == pytest.approx((0.5, 0.5, 0))
    with pytest.raises(DescriptionError, match="has no part 'roof'; allowed: plain, painted"):
        load_mesh(specs.Mesh(mesh.path, submesh="roof"))


def test_an_obj_file_is_drawn_with_the_pictures_of_its_materials(model_folder: Path, tmp_path: Path) -> None:
    mesh = model_folder / "meshes" / "flag.obj"
    mesh.write_text("mtllib flag.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl cloth\nf 1/1 2/2 3/3\n")
    (model_folder / "meshes" / "flag.mtl").write_text("newmtl cloth\n\tKd 0.5 0.5 0.5\n\tmap_Kd paint.png\n")
    (part,) = VisualMeshes(tmp_path / "cache").parts(visual(specs.Mesh(mesh)))
    with Image.open(part.file.with_suffix(".png")) as picture:
        assert picture.getpixel((0, 0)) == (0, 200, 0)


def test_converted_files_follow_the_content_of_their_pictures(model_folder: Path, tmp_path: Path) -> None:
    meshes, look = VisualMeshes(tmp_path / "cache"), visual(specs.Mesh(model_folder / "meshes" / "sign.dae"))
    first = meshes.parts(look)
    assert meshes.parts(look) == first
    Image.new("RGB", (4, 4), (200, 0, 0)).save(model_folder / "materials" / "textures" / "paint.png")
    assert meshes.parts(look)[0].file.parent != first[0].file.parent


def test_a_picture_that_a_mesh_names_and_that_is_not_there_is_noted(model_folder: Path) -> None:
    text = """<sdf version='1.6'><model name='m'><static>1</static><link name='l'><visual name='v'><geometry><mesh>
        <uri>model://sign/meshes/sign.dae</uri></mesh></geometry></visual></link></model></sdf>"""
    assert read_model_text(text, "text", Resources((model_folder.parent,))).notes == ()
    (model_folder / "materials" / "textures" / "paint.png").unlink()
    notes = read_model_text(text, "text", Resources((model_folder.parent,))).notes
    assert notes == (
        "text:1: <visual name='v'>: the image 'paint.png' of sign.dae does not exist; drawn without a texture",
    )


def test_materials_are_found_by_name(model_folder: Path) -> None:
    def read(name: str) -> tuple[specs.Visual, tuple[str, ...]]:
        script = (
            f"<uri>model://sign/materials/scripts</uri><uri>model://sign/materials/textures</uri><name>{name}</name>"
        )
        shape = "<geometry><box><size>1 1 1</size></box></geometry>"
        link = f"<visual name='v'>{shape}<material><script>{script}</script></material></visual>"
        text = f"<sdf version='1.6'><model name='m'><static>1</static><link name='l'>{link}</link></model></sdf>"
        model = read_model_text(text, "text", Resources((model_folder.parent,)))
        return model.links[0].visuals[0], model.notes

    painted, notes = read("Painted")
    assert (painted.colour, painted.texture) == (
        (0.5, 0.25, 0, 1),
        model_folder / "materials" / "textures" / "paint.png",
    )
    assert notes == ()
    assert read("Gazebo/Red")[0].colour == (1, 0, 0, 1)
    unknown, notes = read("Unknown/Thing")
    assert unknown.colour == specs.GREY
    assert "material 'Unknown/Thing' is not found; drawn grey" in notes[0]
    (model_folder / "materials" / "textures" / "paint.png").unlink()
    assert "the image 'paint.png' does not exist" in read("Painted")[1][0]


def test_gazebos_materials_have_their_colours() -> None:
    for name, colour in (("Gazebo/Blue", (0, 0, 1, 1)), ("Orange", (1, 0.5088, 0.0468, 1))):
        material = gazebo_material(name)
        assert material is not None and material.colour == colour
    glass = gazebo_material("Gazebo/BlueTransparent")
    assert glass is not None and glass.colour == (0, 0, 1, 0.5)
    assert gazebo_material("Gazebo/Plaid") is None


def test_a_broken_material_script_gives_what_can_be_read() -> None:
    assert parse_material_script("material A { pass { diffuse red } } } }")["A"] == (specs.GREY, "")
    assert parse_material_script("}{ material") == {}


def test_the_engine_draws_colours_and_pictures(model_folder: Path, tmp_path: Path) -> None:
    text = """<sdf version='1.6'><model name='m'><static>1</static><link name='l'><visual name='v'><geometry><mesh>
        <uri>model://sign/meshes/sign.dae</uri></mesh></geometry></visual></link></model></sdf>"""
    parts = ConvexParts(tmp_path / "cache")
    world = PhysicsWorld(PhysicsSettings(), parts)
    try:
        model = read_model_text(text, "text", Resources((model_folder.parent,)))
        world.spawn(model, model_to_urdf(model, parts, with_visuals=True))
        api, client = world.engine.api, world.engine.client
        view = api.computeViewMatrix((2, 0.5, 5), (2, 0.5, 0), (0, 1, 0))
        lens = api.computeProjectionMatrixFOV(60, 1, 0.1, 10)
        _, _, pixels, _, _ = api.getCameraImage(
            90, 90, view, lens, renderer=api.ER_TINY_RENDERER, physicsClientId=client
        )
        image = np.asarray(pixels).reshape(90, 90, 4)[:, :, :3].astype(int)
    finally:
        world.close()
    metre = 90 / (2 * 5 * np.tan(np.radians(30)))
    left, right = (image[45, int(45 + metre * (x - 2))] for x in (0.5, 3.5))
    assert left[2] > 100 and left[0] == left[1] == 0
    assert right[1] > 100 and right[0] == right[2] == 0
