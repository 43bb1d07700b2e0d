# SPDX-License-Identifier: BSD-3-Clause
"""The visual geometry of a robot is kept for markers, beside what Pinocchio reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modular_framework_planning.errors import ModelError
from modular_framework_planning.geometry.shapes import Box, Cylinder, Sphere
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.robot_model.urdf_document import load_urdf

URDF = """<robot name="r"><link name="a">
<visual><origin xyz="0 0 0.5"/><geometry><box size="0.1 0.2 0.3"/></geometry></visual>
<visual><geometry><cylinder radius="0.1" length="0.4"/></geometry></visual>
<visual><geometry><sphere radius="0.2"/></geometry></visual>
<visual><geometry><mesh filename="package://p/m.dae" scale="2 2 2"/></geometry></visual>
</link></robot>"""


def test_primitives_and_meshes_of_a_link_are_kept_with_their_poses() -> None:
    document = load_urdf(URDF)
    shapes = document.visual_shapes["a"]
    assert [type(shape) for shape, _ in shapes] == [Box, Cylinder, Sphere]
    sizes = [tuple(getattr(shape, name) for name in shape.__match_args__) for shape, _ in shapes]
    assert sizes == [(0.1, 0.2, 0.3), (0.4, 0.1), (0.2,)]
    assert np.allclose(shapes[0][1].translation, [0.0, 0.0, 0.5])
    ((uri, pose, scale),) = document.visual_meshes["a"]
    assert (uri, scale) == ("package://p/m.dae", (2.0, 2.0, 2.0)) and np.allclose(pose.homogeneous, np.eye(4))


def test_a_size_that_is_no_number_is_refused_and_named() -> None:
    with pytest.raises(ModelError, match="link 'a'.*'0.1 wide 0.3'") as fault:
        load_urdf(URDF.replace("0.1 0.2 0.3", "0.1 wide 0.3"))
    assert "xacro" not in str(fault.value)
    with pytest.raises(ModelError, match="xacro expanded"):
        load_urdf("no description")


# The second part begins at vertex 4: a reader that counts anew for each material builds another body.
PARTS = """o first
v 0 0 0
v 1 0 0
v 0 1 0
usemtl a
f 1 2 3
o second
v 5 0 0
v 7 0 0
v 5 0 3
usemtl b
f 4 5 6
"""
MESH_URDF = """<robot name="r"><link name="base"/><link name="arm"><collision><origin xyz="0 0 1"/>
<geometry><mesh filename="parts.obj" scale="0.1 0.1 0.1"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 2 0"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""


def test_collision_meshes_of_several_materials_are_whole_and_in_place(tmp_path: Path) -> None:
    (tmp_path / "parts.obj").write_text(PARTS)
    model = RobotModel(MESH_URDF, '<robot name="r"/>', {}, lambda uri: str(tmp_path / uri))
    (item,) = model.link_geometries
    corners = np.array(item.geometry.vertices())
    expected = 0.1 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 0, 0], [7, 0, 0], [5, 0, 3]])
    assert np.allclose(np.unique(corners, axis=0), np.unique(expected, axis=0))
    assert item.geometry.num_tris == 2
    assert (item.link, item.joint_id) == ("arm", 1) and np.allclose(item.placement.translation, [0, 0, 1])


def test_a_collision_mesh_that_cannot_be_read_is_refused_with_link_and_file(tmp_path: Path) -> None:
    (tmp_path / "parts.obj").write_text("v 0 0 0\n")
    with pytest.raises(ModelError, match=r"link 'arm' collision: mesh file .*parts\.obj: contains no triangle"):
        RobotModel(MESH_URDF, '<robot name="r"/>', {}, lambda uri: str(tmp_path / uri))


@pytest.mark.parametrize("shape", ["<tetrahedron/>", '<sphere radius="0"/>', '<capsule radius="1" length="-1"/>'])
def test_an_unknown_or_empty_collision_shape_is_refused_with_its_link(shape: str) -> None:
    with pytest.raises(ModelError, match="link 'a' collision"):
        load_urdf(f'<robot name="r"><link name="a"><collision><geometry>{shape}</geometry></collision></link></robot>')


PAIR = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
<joint name="one" type="{0}"><parent link="a"/><child link="b"/><limit lower="-1" upper="1" velocity="1" effort="1"/>
</joint><joint name="two" type="{1}"><parent link="b"/><child link="c"/><mimic joint="one"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""


def test_a_fixed_joint_that_mimics_is_fixed_and_noted() -> None:
    model = RobotModel(PAIR.format("prismatic", "fixed"), '<robot name="r"/>')
    assert model.joint_names == ("one",) and not model.mimics
    assert "'two'" in model.document.notes[0] and "<mimic> is ignored" in model.document.notes[0]


def test_a_joint_that_mimics_one_that_does_not_move_is_refused() -> None:
    with pytest.raises(ModelError, match="'two'.*mimics 'one'.*allowed: none"):
        load_urdf(PAIR.format("fixed", "prismatic"))
