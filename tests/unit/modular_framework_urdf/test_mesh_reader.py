# SPDX-License-Identifier: BSD-3-Clause
"""Meshes are compared with a second reader, a few plain lines a format that share no code with the first one."""

from __future__ import annotations

import re
import struct
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import trimesh

from modular_framework_urdf.mesh_reader import MeshError, TriangleMesh, read_mesh

ROBOTS = Path(trimesh.__file__).parents[1] / "cmeel.prefix/share/example-robot-data/robots"
UR5 = sorted((ROBOTS / "ur_description/meshes/ur5").glob("*/*.*"))

TWO_MATERIALS = """mtllib parts.mtl
o first
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vn 0 0 1
usemtl steel
f 1/1/1 2/1/1 3/1/1 4/1/1
o second
v 5 0 0
v 6 0 0
v 5 2 0
v 5 0 3
usemtl rubber
f 5/1/1 6/1/1 7/1/1
f -4 -2 -1
f 1//1 5//1 \\
  6//1
"""

COLLADA = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
 <library_images><image id="i"><init_from>not_there.png</init_from></image></library_images>
 <library_geometries>
  <geometry id="one"><mesh>
   <source id="p1"><float_array id="a1" count="12">0 0 0 10 0 0 0 20 0 0 0 30</float_array><technique_common>
    <accessor source="#a1" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
     <param name="Z" type="float"/></accessor></technique_common></source>
   <vertices id="v1"><input semantic="POSITION" source="#p1"/></vertices>
   <triangles count="2" material="missing"><input semantic="VERTEX" source="#v1" offset="0"/>
    <p>0 1 2 0 1 3</p></triangles>
   {more}
  </mesh></geometry>
  <geometry id="two"><mesh>
   <source id="p2"><float_array id="a2" count="15">0 0 0 10 0 0 10 10 0 0 10 0 5 5 9</float_array><technique_common>
    <accessor source="#a2" count="5" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
     <param name="Z" type="float"/></accessor></technique_common></source>
   <vertices id="v2"><input semantic="POSITION" source="#p2"/></vertices>
   <polylist count="2"><input semantic="VERTEX" source="#v2" offset="0"/><vcount>4 3</vcount>
    <p>0 1 2 3 0 1 4</p></polylist>
  </mesh></geometry>
 </library_geometries>
 <library_nodes><node id="shared"><translate>0 0 100</translate><instance_geometry url="#two"/></node></library_nodes>
 <library_visual_scenes><visual_scene id="s">
  <node><matrix>0 -1 0 7 1 0 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url="#one"><bind_material>
    <technique_common><instance_material symbol="missing" target="#nowhere"/></technique_common></bind_material>
    </instance_geometry>
   <node><scale>2 2 2</scale><instance_geometry url="#two"/></node></node>
  <node><translate>0 50 0</translate><instance_geometry url="#one"/></node>
  <node><instance_node url="#shared"/></node>
 </visual_scene></library_visual_scenes>
 <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
"""


def stl_corners(content: bytes) -> np.ndarray:
    if content[:5] == b"solid":
        words = re.findall(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", content)
        return np.array(words, dtype=float).reshape(-1, 3, 3)
    count = struct.unpack_from("<I", content, 80)[0]
    return np.array([struct.unpack_from("<9f", content, 96 + 50 * number) for number in range(count)]).reshape(-1, 3, 3)


def fans(polygons: list[list[np.ndarray]]) -> np.ndarray:
    return np.array([[one[0], one[k], one[k + 1]] for one in polygons for k in range(1, len(one) - 1)])


def obj_corners(content: bytes) -> np.ndarray:
    points, polygons = [], []
    for line in content.decode().replace("\\\n", " ").splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            points.append(np.array(words[1:4], dtype=float))
        elif words[:1] == ["f"]:
            numbers = [int(word.split("/")[0]) for word in words[1:]]
            polygons.append([points[number - 1] if number > 0 else points[number] for number in numbers])
    return fans(polygons)


def ply_corners(content: bytes) -> np.ndarray:
    header, _, body = content.partition(b"end_header\n")
    vertices, faces = (int(re.search(rb"element %s (\d+)" % name, header)[1]) for name in (b"vertex", b"face"))
    if b"format ascii" in header:
        lines = [line.split() for line in body.decode().splitlines()]
        points = np.array([line[:3] for line in lines[:vertices]], dtype=float)
        return fans(
            [[points[int(word)] for word in line[1 : 1 + int(line[0])]] for line in lines[vertices : vertices + faces]]
        )
    points = np.array([struct.unpack_from("<3f", body, 12 * number) for number in range(vertices)])
    return np.array(
        [points[list(struct.unpack_from("<3i", body, 12 * vertices + 13 * number + 1))] for number in range(faces)]
    )


def node_matrix(node: ET.Element) -> np.ndarray:
    result = np.eye(4)
    for step in node:
        values = (
            np.array((step.text or "").split(), dtype=float)
            if step.tag in ("matrix", "translate", "scale", "rotate")
            else np.zeros(0)
        )
        one = np.eye(4)
        if step.tag == "matrix":
            one = values.reshape(4, 4)
        elif step.tag == "translate":
            one[:3, 3] = values
        elif step.tag == "scale":
            one[:3, :3] = np.diag(values)
        elif step.tag == "rotate":
            one = trimesh.transformations.rotation_matrix(np.radians(values[3]), values[:3])
        result = result @ one
    return result


def geometry_corners(geometry: ET.Element, known: dict[str, ET.Element]) -> np.ndarray:
    found = [np.zeros((0, 3, 3))]
    for primitive in (*geometry.findall("mesh/triangles"), *geometry.findall("mesh/polylist")):
        inputs = primitive.findall("input")
        stride = 1 + max(int(one.get("offset")) for one in inputs)
        vertex = next(one for one in inputs if one.get("semantic") == "VERTEX")
        positions = known[known[vertex.get("source")[1:]].find("input[@semantic='POSITION']").get("source")[1:]]
        points = np.array(positions.findtext("float_array").split(), dtype=float).reshape(-1, 3)
        numbers = np.array(primitive.findtext("p").split(), dtype=int)[int(vertex.get("offset")) :: stride]
        counts = primitive.findtext("vcount")
        sizes = [3] * (len(numbers) // 3) if counts is None else [int(word) for word in counts.split()]
        found.append(fans([list(points[one]) for one in np.split(numbers, np.cumsum(sizes)[:-1])]))
    return np.concatenate(found)


def dae_corners(content: bytes) -> np.ndarray:
    root = ET.fromstring(re.sub(rb'xmlns="[^"]*"', b"", content, count=1))
    known = {one.get("id"): one for one in root.iter() if one.get("id")}
    unit = float(root.find("asset/unit").get("meter"))
    found = []

    def walk(node: ET.Element, above: np.ndarray) -> None:
        pose = above @ node_matrix(node)
        for instance in node.findall("instance_geometry"):
            corners = geometry_corners(known[instance.get("url")[1:]], known)
            found.append(corners @ pose[:3, :3].T + pose[:3, 3])
        for inner in (*node.findall("node"), *(known[one.get("url")[1:]] for one in node.findall("instance_node"))):
            walk(inner, pose)

    for node in known[root.find("scene/instance_visual_scene").get("url")[1:]].findall("node"):
        walk(node, np.eye(4))
    return unit * np.concatenate(found)


SECOND_READERS = {".stl": stl_corners, ".obj": obj_corners, ".ply": ply_corners, ".dae": dae_corners}


def area(corners: np.ndarray) -> float:
    sides = corners[:, 1:] - corners[:, :1]
    return float(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum() / 2.0)


def compare(mesh: TriangleMesh, corners: np.ndarray) -> None:
    read = mesh.vertices[mesh.triangles]
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    assert len(read) == len(corners)
    assert len(mesh.vertices) == len(np.unique(corners.reshape(-1, 3), axis=0))
    np.testing.assert_allclose(area(read), area(corners), rtol=1e-6)
    for bound in (np.min, np.max):
        np.testing.assert_allclose(bound(read, axis=(0, 1)), bound(corners, axis=(0, 1)), atol=1e-6 * size)


def written(folder: Path, kind: str) -> Path:
    body = trimesh.creation.annulus(r_min=0.02, r_max=0.05, height=0.1, sections=24)
    texts = {
        "two_materials.obj": TWO_MATERIALS,
        "instances.dae": COLLADA.format(more=""),
        "two_solids.stl": trimesh.exchange.stl.export_stl_ascii(body)
        + trimesh.exchange.stl.export_stl_ascii(trimesh.creation.box((3, 2, 1))),
        "quads.ply": "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
        "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 2\n4 0 1 2 3\n3 0 1 4\n",
    }
    file = folder / kind
    if kind in texts:
        file.write_text(texts[kind])
    else:
        body.export(file)
    return file


@pytest.mark.parametrize(
    "kind", ["two_materials.obj", "instances.dae", "two_solids.stl", "quads.ply", "binary.stl", "binary.ply", "one.obj"]
)
def test_every_format_is_read_as_a_second_reader_reads_it(tmp_path: Path, kind: str) -> None:
    file = written(tmp_path, kind)
    compare(read_mesh(file), SECOND_READERS[file.suffix](file.read_bytes()))


@pytest.mark.parametrize("file", UR5, ids=lambda file: "/".join(file.parts[-2:]))
def test_the_public_robots_meshes_are_read_whole(file: Path) -> None:
    compare(read_mesh(file), SECOND_READERS[file.suffix.lower()](file.read_bytes()))


def test_there_are_public_meshes_to_read() -> None:
    assert {file.suffix.lower() for file in UR5} == {".stl", ".dae"}


def test_collada_is_scaled_by_its_unit_and_not_turned_by_its_up_axis(tmp_path: Path) -> None:
    mesh = read_mesh(written(tmp_path, "instances.dae"), (1.0, 1.0, 2.0))
    assert mesh.vertices.max(axis=0) == pytest.approx([0.10, 0.70, 2.18])  # the shared node is 1 m up along z


def test_a_mirrored_mesh_keeps_its_outside(tmp_path: Path) -> None:
    mesh = read_mesh(written(tmp_path, "binary.stl"), (-1.0, 1.0, 1.0))
    assert trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False).volume > 0.0


SKIN = '<library_controllers><controller id="skin"><skin source="#one"/></controller></library_controllers>'
SKINNED = (
    COLLADA.format(more="")
    .replace("<library_nodes>", SKIN + "<library_nodes>")
    .replace('<instance_geometry url="#one"/>', '<instance_controller url="#skin"/>')
)
STRIP = '<tristrips count="1"><input semantic="VERTEX" source="#v1" offset="0"/><p>0 1 2 3</p></tristrips>'


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("skinned.dae", SKINNED.encode(), "8 of the 10 declared triangles"),
        ("entity.dae", b'<!DOCTYPE a [<!ENTITY b "c">]>' + COLLADA.format(more="").encode()[21:], "DOCTYPE"),
        ("other.dae", b"<robot/>", "not <COLLADA>"),
        ("short.stl", struct.pack("<80sI", b"", 9) + bytes(100), "not a complete STL"),
        ("empty.stl", b"solid a\nendsolid a\n", "no triangle"),
        ("nan.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "not finite"),
        ("beyond.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "not a complete OBJ"),
        (
            "cut.ply",
            b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
            b"element face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
            "not a complete PLY",
        ),
        (
            "huge.ply",
            b"ply\nformat ascii 1.0\nelement vertex 1000000000000\nproperty float x\nend_header\n0\n",
            "1 values where the header declares 1000000000000",
        ),
        (
            "back.ply",
            b"ply\nformat binary_little_endian 1.0\nelement face 1000000000000\n"
            b"property list char char vertex_indices\nend_header\n\xff",
            "a list has -1 entries",
        ),
        ("body.step", b"", "'.step'"),
    ],
)
def test_a_mesh_that_is_not_whole_is_refused_and_named(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshError, match=re.escape(words)) as refusal:
        read_mesh(tmp_path / name)
    assert str(tmp_path / name) in str(refusal.value) and ";" in str(refusal.value)


def test_strips_of_triangles_are_read(tmp_path: Path) -> None:
    file = tmp_path / "strip.dae"
    file.write_text(COLLADA.format(more=STRIP))
    assert len(read_mesh(file).triangles) == 10 + 2 * 2


def test_a_scale_without_extent_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match="none of them 0"):
        read_mesh(written(tmp_path, "binary.stl"), (1.0, 0.0, 1.0))
    with pytest.raises(MeshError, match="cannot be read"):
        read_mesh(tmp_path / "absent.stl")


def test_one_group_of_an_obj_file_is_read_and_another_name_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "two.obj"
    corners = "\n".join(f"v {x} {y} 0" for x in (0, 1) for y in (0, 1)) + "\nv 5 0 0\n"
    file.write_text(f"{corners}g small\nf 1 2 3\ng large\nf 1 2 5\nf 2 3 5\n")
    assert len(read_mesh(file, part="small").triangles) == 1
    assert read_mesh(file, part="large").vertices.max() == 5
    assert read_mesh(file, part="large", centred=True).vertices.max() == 2.5
    with pytest.raises(MeshError, match=r"has no part 'medium'; allowed: small, large"):
        read_mesh(file, part="medium")
    file.rename(tmp_path / "two.stl")
    with pytest.raises(MeshError, match="allowed: parts of dae and obj files"):
        read_mesh(tmp_path / "two.stl", part="small")


def test_a_scene_with_the_id_of_its_node_is_read(tmp_path: Path) -> None:
    file = tmp_path / "hand.dae"
    trimesh.creation.box((1, 1, 1)).export(file)
    text = file.read_text()
    scene = re.search(r'<visual_scene[^>]* id="([^"]*)"', text) or re.search(r'<visual_scene id="([^"]*)"', text)
    node = re.search(r'<node[^>]* id="([^"]*)"', text)
    assert scene is not None and node is not None
    file.write_text(text.replace(f'id="{node.group(1)}"', f'id="{scene.group(1)}"'))
    assert len(read_mesh(file).triangles) == 12
