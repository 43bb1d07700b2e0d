# SPDX-License-Identifier: BSD-3-Clause
"""All files that a world, a model or a robot description names are listed, however deep they are nested."""

from __future__ import annotations

from pathlib import Path

import pytest
import rospkg

from modular_framework_simulation.models.description_files import description_files, files_in_description
from modular_framework_simulation.models.model_search import ros_resources
from modular_framework_simulation.models.sdf_resources import Resources

WORLD = """<sdf version='1.6'><world name='w'>
  <include><uri>model://shelf</uri></include>
  <include><uri>model://missing</uri></include>
  <model name='post'><link name='l'><visual name='v'>
    <geometry><mesh><uri>file://post.dae</uri></mesh></geometry>
    <material><script><uri>model://paint/materials/scripts</uri><name>Paint/Red</name></script></material>
  </visual></link></model>
</world></sdf>"""
SHELF = """<sdf version='1.6'><model name='shelf'>
  <include><uri>model://board</uri></include><include><uri>model://shelf</uri></include>
</model></sdf>"""
BOARD = """<sdf version='1.4'><model name='board'><link name='l'><collision name='c'>
  <geometry><mesh><uri>model://board/meshes/board.obj</uri></mesh></geometry>
</collision></link></model></sdf>"""
FILES = {
    "a.world": WORLD,
    "post.dae": "<COLLADA><image><init_from>post.png</init_from></image></COLLADA>",
    "post.png": "",
    "models/shelf/model.sdf": SHELF,
    "models/shelf/model.config": "<model><sdf version='1.6'>model.sdf</sdf></model>",
    "models/board/model.sdf": BOARD,
    "models/board/meshes/board.obj": "mtllib board.mtl",
    "models/board/meshes/board.mtl": "map_Kd board.png",
    "models/board/meshes/board.png": "",
    "models/paint/materials/scripts/paint.material": "material Paint/Red {}",
    "models/paint/materials/textures/red.png": "",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in {**FILES, "models/other/model.sdf": BOARD, "unused.dae": ""}.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_world_names_its_models_with_their_meshes_images_and_materials(folder: Path) -> None:
    found = description_files(folder / "a.world", Resources((folder / "models",)))
    assert {str(path.relative_to(folder)) for path in found} == set(FILES)


def test_a_robot_names_its_meshes_with_their_images(folder: Path) -> None:
    urdf = """<robot name='r'><link name='base'>
      <visual><geometry><mesh filename='package://bench/post.dae'/></geometry></visual>
      <collision><geometry><mesh filename='package://bench/missing.stl'/></geometry></collision>
      <collision><geometry><mesh filename='package://bench/models/board/meshes/board.png'/></geometry></collision>
    </link></robot>"""
    found = files_in_description(urdf, Resources(find_package=lambda name: str(folder) if name == "bench" else ""))
    assert {path.name for path in found} == {"post.dae", "post.png", "board.png"}


def test_text_that_is_no_description_names_nothing(folder: Path) -> None:
    (folder / "a.world").write_text("{}")
    assert files_in_description("a text", Resources()) == ()
    assert description_files(folder / "a.world", Resources()) == (folder / "a.world",)


def test_a_shipped_world_names_the_models_of_its_package() -> None:
    package = Path(rospkg.RosPack().get_path("modular_framework_description"))
    found = description_files(package / "worlds" / "ur5_table.world", ros_resources(str(package / "models")))
    models = {path.parent.name for path in found if path.name == "model.sdf"}
    assert models == {"ground_plane", "robot_pedestal", "table"}
