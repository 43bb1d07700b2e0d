# SPDX-License-Identifier: BSD-3-Clause
"""Text scenes of both layouts are read and written, and faults are reported with their line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from modular_framework_core.scene.scene_file import (
    Scene,
    SceneFileError,
    SceneObject,
    SceneShape,
    read_scene_file,
    scene_text,
)

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
    objects = {thing.name: thing for thing in read_scene_file(SHIPPED).objects}
    top, *legs = objects["table__link"].shapes
    assert len(legs) == 4
    assert top.position[2] + top.size[2] / 2 == pytest.approx(0.84)
    (can,) = objects["can__link"].shapes
    assert (can.kind, can.size) == ("cylinder", pytest.approx((0.033, 0.115)))
    assert objects["ground_plane__link"].shapes[0].size == (0.0, 0.0, 1.0, 0.0)


def test_objects_with_poses_meshes_and_subframes_are_read(tmp_path: Path) -> None:
    scene = read_scene_file(write(tmp_path, NEWER))
    (shelf,) = scene.objects
    assert scene.name == "(a room)"
    assert shelf.color == (1.0, 0.0, 0.0, 1.0), "that of its first shape with a colour"
    assert shelf.name == "shelf one"
    assert shelf.position == (0.1, 0.2, 0.3)
    assert shelf.quaternion_xyzw == pytest.approx((0.0, 0.0, 0.5**0.5, 0.5**0.5))
    assert [shape.kind for shape in shelf.shapes] == ["box", "mesh"]
    assert shelf.shapes[1].triangles == ((0, 1, 2),)
    assert shelf.subframes[0][:2] == ("handle", (0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("old", "new", "hint"),
    [
        ("box", "bottle", ":6: got 'bottle', expected a kind of shape: box, sphere"),
        ("1 2 3", "1 2", ":7: got '1 2', expected the size of a box"),
        ("1 2 3", "1 -2 3", "greater than 0"),
        ("1 2 3", "1 nan 3", "finite"),
        (TURN, "0 0 0 0", ":4: .* unit quaternion"),
        ("0 1 2", "0 1 3", "indices below 3"),
        ("1 0 0 1", "1 0 0 2", ":19: .* in 0..1"),
        ("\n.\n", "\n", "ends where"),
        ("* shelf", "shelf", ":2: got 'shelf one', expected an object"),
        ("handle\n0 0 1\n0 0 0 1\n.", "handle\n0 0 1\n0 0 0 1\n* shelf one\n0\n.", "no earlier object"),
    ],
)
def test_a_fault_is_reported_with_its_line(tmp_path: Path, old: str, new: str, hint: str) -> None:
    assert old in NEWER
    with pytest.raises(SceneFileError, match=hint):
        read_scene_file(write(tmp_path, NEWER.replace(old, new, 1)))


def test_a_missing_file_is_reported_with_those_that_are_there(tmp_path: Path) -> None:
    write(tmp_path, NEWER)
    with pytest.raises(SceneFileError, match="room.scene"):
        read_scene_file(tmp_path / "rom.scene")


def test_what_is_written_in_the_newer_layout_is_read_as_it_was(tmp_path: Path) -> None:
    for text in (NEWER, SHIPPED.read_text()):
        scene = read_scene_file(write(tmp_path, text))
        again = read_scene_file(write(tmp_path, scene_text(scene)))
        assert [thing.name for thing in again.objects] == [thing.name for thing in scene.objects]
        for thing, other in zip(scene.objects, again.objects, strict=True):
            assert other.subframes == thing.subframes and other.position == thing.position
            assert other.quaternion_xyzw == pytest.approx(thing.quaternion_xyzw)
            for shape, same in zip(thing.shapes, other.shapes, strict=True):
                assert same.quaternion_xyzw == pytest.approx(shape.quaternion_xyzw)
                assert replace(same, quaternion_xyzw=shape.quaternion_xyzw) == shape


def test_the_older_layout_has_the_objects_pose_in_its_shapes(tmp_path: Path) -> None:
    half = 0.5**0.5
    cup = SceneObject(
        "cup",
        (1.0, 2.0, 3.0),
        (0.0, 0.0, half, half),
        (
            SceneShape(
                kind="cylinder", size=(0.1, 0.4), position=(0.5, 0.0, 0.0), quaternion_xyzw=(half, 0.0, 0.0, half)
            ),
        ),
    )
    text = scene_text(Scene("old", (cup,)), old_layout=True)
    assert text.splitlines()[:5] == ["old", "* cup", "1", "cylinder", "0.1 0.4"], "radius before length"
    (read,) = read_scene_file(write(tmp_path, text)).objects
    assert read.position == (0.0, 0.0, 0.0)
    assert read.shapes[0].position == pytest.approx((1.0, 2.5, 3.0)), "x of the object points along y"
    assert read.shapes[0].quaternion_xyzw == pytest.approx((0.5, 0.5, 0.5, 0.5))
    with_handle = SceneObject(
        "cup", cup.position, cup.quaternion_xyzw, cup.shapes, (("handle", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),)
    )
    with pytest.raises(SceneFileError, match="'cup': got 1 subframes"):
        scene_text(Scene("old", (with_handle,)), old_layout=True)


@pytest.mark.parametrize("name", ["", " ", "two\nlines"])
def test_a_name_that_does_not_fit_on_a_line_is_refused(name: str) -> None:
    with pytest.raises(SceneFileError, match="one nonempty line"):
        scene_text(Scene("room", (SceneObject(name, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), ()),)))
