# SPDX-License-Identifier: BSD-3-Clause
"""Text scenes of both layouts are read, and what is wrong in one is told with its line."""
from __future__ import annotations

from pathlib import Path

import pytest

from modular_framework_core.scene_file import SceneFileError, read_scene_file

SHIPPED = Path(__file__).parents[3] / "src" / "modular_framework_description" / "scenes" / "ur5_setup.scene"
TURN = "0 0 0.7071068 0.7071068"
NEWER = f"""(a room)
* shelf one
0.1 0.2 0.3
{TURN}
2
box
1 2 3
0 0 0.5
0 0 0 1
0 0 0 0
mesh
3 1
0 0 0
1 0 0
0 1 0
0 1 2
0 0 0
0 0 0 1
1 0 0 1
1
handle
0 0 1
0 0 0 1
.
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "room.scene"
    path.write_text(text)
    return path


def test_the_shipped_scene_has_table_and_can_where_they_stand() -> None:
    objects = {thing.name: thing for thing in read_scene_file(SHIPPED)}
    top, *legs = objects["table__link"].shapes
    assert len(legs) == 4
    assert top.position[2] + top.size[2] / 2 == pytest.approx(0.84)
    can, = objects["can__link"].shapes
    assert (can.kind, can.size) == ("cylinder", pytest.approx((0.033, 0.115)))
    assert objects["ground_plane__link"].shapes[0].size == (0.0, 0.0, 1.0, 0.0)


def test_objects_with_poses_meshes_and_subframes_are_read(tmp_path: Path) -> None:
    shelf, = read_scene_file(write(tmp_path, NEWER))
    assert shelf.name == "shelf one"
    assert shelf.position == (0.1, 0.2, 0.3)
    assert shelf.quaternion_xyzw == pytest.approx((0.0, 0.0, 0.5 ** 0.5, 0.5 ** 0.5))
    assert [shape.kind for shape in shelf.shapes] == ["box", "mesh"]
    assert shelf.shapes[1].triangles == ((0, 1, 2),)
    assert shelf.subframes[0][:2] == ("handle", (0.0, 0.0, 1.0))


@pytest.mark.parametrize(("old", "new", "hint"), [
    ("box", "bottle", ":6: got 'bottle', expected a kind of shape: box, sphere"),
    ("1 2 3", "1 2", ":7: got '1 2', expected the size of a box"),
    ("1 2 3", "1 -2 3", "more than 0"),
    ("1 2 3", "1 nan 3", "finite"),
    (TURN, "0 0 0 0", ":4: .* unit quaternion"),
    ("0 1 2", "0 1 3", "indices below 3"),
    ("\n.\n", "\n", "ends where"),
    ("* shelf", "shelf", ":2: got 'shelf one', expected an object"),
    ("handle\n0 0 1\n0 0 0 1\n.", "handle\n0 0 1\n0 0 0 1\n* shelf one\n0\n.", "no object above")])
def test_a_fault_is_told_with_its_line(tmp_path: Path, old: str, new: str, hint: str) -> None:
    assert old in NEWER
    with pytest.raises(SceneFileError, match=hint):
        read_scene_file(write(tmp_path, NEWER.replace(old, new, 1)))


def test_a_missing_file_is_told_with_those_that_are_there(tmp_path: Path) -> None:
    write(tmp_path, NEWER)
    with pytest.raises(SceneFileError, match="room.scene"):
        read_scene_file(tmp_path / "rom.scene")
