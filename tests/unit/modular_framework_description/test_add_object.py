# SPDX-License-Identifier: BSD-3-Clause
"""An object of the lab becomes a model with its true mass properties, which rests as its stable poses say."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh
import yaml
from scipy.spatial.transform import Rotation

from modular_framework_core.files.default_folders import models_folder
from modular_framework_core.scene.scene_file import read_scene_file
from modular_framework_description.add_object_command import main
from modular_framework_description.gripper_openings import installed_grippers
from modular_framework_description.stable_poses import stable_poses
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.physics.engine_choice import ENGINES
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_states.place_poses import stable_directions
from modular_framework_testing.simulation.simulated_samples import run, solid
from modular_framework_urdf.mesh_reader import TriangleMesh
from modular_framework_urdf.rotations import rotate_vector

LEG, WIDTH, THICK = 0.08, 0.03, 0.02
"""L-shape: length of both legs, width, thickness of both legs [m]."""


@pytest.fixture(autouse=True)
def no_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GAZEBO_MODEL_PATH", raising=False)


def box(scale: float = 1.0) -> trimesh.Trimesh:
    mesh = trimesh.creation.box(extents=np.array([0.04, 0.06, 0.1]) * scale)
    mesh.apply_translation(np.array([0.3, -0.2, 0.7]) * scale)  # the origin of the file is outside the object
    return mesh


def l_shape() -> trimesh.Trimesh:
    outline = [(0.0, 0.0), (LEG, 0.0), (LEG, THICK), (THICK, THICK), (THICK, LEG), (0.0, LEG)]
    corners = [(x, y, z) for y in (0.0, WIDTH) for x, z in outline]
    caps = [(0, 1, 2), (0, 2, 3), (0, 3, 5), (3, 4, 5)]
    sides = [((a + 1) % 6, a, a + 6) for a in range(6)] + [((a + 1) % 6, a + 6, (a + 1) % 6 + 6) for a in range(6)]
    triangles = [*caps, *((c + 6, b + 6, a + 6) for a, b, c in caps), *sides]
    return trimesh.Trimesh(corners, triangles)


def mug() -> trimesh.Trimesh:
    outer = trimesh.creation.cylinder(radius=0.036, height=0.09, sections=48)
    inner = trimesh.creation.cylinder(radius=0.032, height=0.09, sections=48)
    inner.apply_translation((0.0, 0.0, 0.006))
    return trimesh.boolean.difference([outer, inner], engine="manifold")


def open_shell() -> trimesh.Trimesh:
    can = trimesh.creation.cylinder(radius=0.03, height=0.1, sections=32)
    can.update_faces(can.face_normals[:, 2] < 0.9)
    return can


def added(folder: Path, mesh: trimesh.Trimesh, *options: str, kind: str = "stl", name: str = "thing") -> Path:
    """Adds an object and returns the folder of its model."""
    file = folder / f"{name}.{kind}"
    mesh.export(file)
    assert main([str(file), "--directory", str(folder / "models"), *options]) == 0
    return folder / "models" / name


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    capsys.readouterr()
    assert main(arguments) == 1
    text = capsys.readouterr().err
    assert text.startswith("add_object: ") and text.count("\n") == 1
    return text


def model_of(folder: Path) -> specs.Model:
    text = (folder / "model.sdf").read_text()
    return read_model_text(text, str(folder / "model.sdf"), Resources((folder.parent,)))


def inertia_of(model: specs.Model) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = model.links[0].inertial.inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def parts_volume(folder: Path) -> float:
    return sum(trimesh.load(file).volume for file in sorted((folder / "meshes").glob("convex_*.obj")))


@pytest.mark.parametrize("kind", ["stl", "obj", "ply", "dae"])
def test_a_box_has_its_analytic_mass_and_inertia_in_every_format(tmp_path: Path, kind: str) -> None:
    folder = added(tmp_path, box(), "--density", "500", kind=kind)
    (link,) = model_of(folder).links
    mass = 500 * 0.04 * 0.06 * 0.1
    assert link.name == "link" and link.inertial.mass == pytest.approx(mass, rel=1e-5)
    assert link.inertial.pose.position == pytest.approx((0.0, 0.0, 0.0), abs=1e-7)
    wanted = mass / 12 * np.diag([0.06**2 + 0.1**2, 0.04**2 + 0.1**2, 0.04**2 + 0.06**2])
    assert np.allclose(inertia_of(model_of(folder)), wanted, rtol=1e-5, atol=1e-10)
    assert len(link.collisions) == 1 and link.collisions[0].friction.lateral == 0.8


def test_an_l_shape_has_the_mass_properties_of_its_two_boxes(tmp_path: Path) -> None:
    model = model_of(added(tmp_path, l_shape(), "--mass", "0.2", "--friction", "0.3"))
    boxes = (  # size and centre in the frame at the centre of the bounding box
        (np.array([LEG, WIDTH, THICK]), np.array([0.0, 0.0, (THICK - LEG) / 2])),
        (np.array([THICK, WIDTH, LEG - THICK]), np.array([(THICK - LEG) / 2, 0.0, THICK / 2])),
    )
    masses = np.array([size.prod() for size, _ in boxes])
    masses *= 0.2 / masses.sum()
    centre = sum(mass * at for mass, (_, at) in zip(masses, boxes, strict=True)) / 0.2
    wanted = np.zeros((3, 3))
    for mass, (size, at) in zip(masses, boxes, strict=True):
        arm = at - centre
        wanted += mass / 12 * np.diag(size @ size - size**2) + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    assert model.links[0].inertial.mass == pytest.approx(0.2)
    assert np.allclose(model.links[0].inertial.pose.position, centre, atol=1e-7)
    assert np.allclose(inertia_of(model), wanted, rtol=1e-4, atol=1e-9)
    assert {shape.friction.lateral for shape in model.links[0].collisions} == {0.3}


@pytest.mark.parametrize(("mesh", "excess"), [(l_shape(), 0.02), (mug(), 0.15)])
def test_the_convex_parts_fill_a_concave_mesh_and_leave_its_hollow_free(
    tmp_path: Path, mesh: trimesh.Trimesh, excess: float
) -> None:
    folder = added(tmp_path, mesh, "--mass", "0.2")
    assert parts_volume(folder) == pytest.approx(mesh.volume, rel=excess)
    assert parts_volume(folder) < 0.65 * mesh.convex_hull.volume
    for file in (folder / "meshes").glob("convex_*.obj"):
        part = trimesh.load(file)
        assert part.is_volume and part.volume > 0.98 * part.convex_hull.volume
    (item,) = read_scene_file(folder / "thing.scene").objects
    assert item.name == "thing__link" and {shape.kind for shape in item.shapes} == {"mesh"}
    assert len(item.shapes) == len(model_of(folder).links[0].collisions) > 1


def test_a_box_stands_on_its_faces_and_most_often_on_the_largest(tmp_path: Path) -> None:
    poses = yaml.safe_load((added(tmp_path, box(), "--mass", "0.2") / "object.yaml").read_text())["stable_poses"]
    assert len(poses) == 6 and sum(pose["probability"] for pose in poses) == pytest.approx(1.0, abs=1e-3)
    assert [pose["height"] for pose in poses] == pytest.approx([0.02, 0.02, 0.03, 0.03, 0.05, 0.05], abs=1e-6)
    # solid angles of the faces of a box seen from its centre: 8 asin(a b / sqrt((a^2 + d^2) (b^2 + d^2))) / 8 pi
    for index, (a, b, d) in ((0, (0.06, 0.1, 0.04)), (2, (0.04, 0.1, 0.06)), (4, (0.04, 0.06, 0.1))):
        fraction = 4 * math.asin(a * b / math.sqrt((a * a + d * d) * (b * b + d * d))) / (4 * math.pi)
        assert poses[index]["probability"] == pytest.approx(fraction, abs=2e-3)


def up_directions(folder: Path) -> np.ndarray:
    poses = yaml.safe_load((folder / "object.yaml").read_text())["stable_poses"]
    angles = [[pose["roll"], pose["pitch"], 0.0] for pose in poses]
    return Rotation.from_euler("xyz", angles).inv().apply([0.0, 0.0, 1.0])


def test_the_stable_poses_are_the_directions_in_which_plan_place_puts_the_object(tmp_path: Path) -> None:
    mesh = l_shape()
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    found = up_directions(added(tmp_path, mesh, "--mass", "0.2"))
    wanted = -stable_directions([TriangleMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))])
    distances = np.linalg.norm(found[:, np.newaxis] - wanted, axis=2)
    assert distances.min(axis=0).max() < 1e-3 and distances.min(axis=1).max() < 1e-3


def test_a_finely_meshed_ball_has_the_poses_of_a_coarse_ball() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.04)
    poses = stable_poses(np.asarray(ball.vertices), np.zeros(3))
    assert 10 < len(poses) < 1000 < len(ball.faces)
    assert [pose.height for pose in poses] == pytest.approx([0.04] * len(poses), abs=1e-3)


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the models bracket and mug_of_lab."""
    folder = tmp_path_factory.mktemp("lab")
    added(folder, l_shape(), "--mass", "0.2", name="bracket")
    added(folder, mug(), "--density", "1200", name="lab_mug")
    return folder


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", ["bracket", "lab_mug"])
def test_a_dropped_object_comes_to_rest_in_a_stable_pose_of_the_list(lab: Path, engine: str, name: str) -> None:
    folder = lab / "models" / name
    world = PhysicsWorld(PhysicsSettings(), ConvexParts(lab / "cache"), engine=engine)
    try:
        world.spawn(solid("floor", specs.Plane((0, 0, 1), (10, 10)), Pose(), static=True))
        for rpy in ((0.1, 0.3, 0.0), (math.pi / 2 + 0.2, 0.2, 0.0)):
            model = read_model_text((folder / "model.sdf").read_text(), name, Resources((folder.parent,)))
            world.spawn(replace(model, pose=Pose.from_xyz_rpy((0.0, 0.0, 0.1), rpy)))
            run(world, 3.0)
            state = world.entity_state(name)
            world.delete(name)
            assert np.linalg.norm(state.twist.linear) < 0.01
            up = rotate_vector(state.pose.inverse().quaternion, (0.0, 0.0, 1.0))
            nearest = np.max(up_directions(folder) @ np.array(up))
            assert nearest > math.cos(math.radians(5.0)), (rpy, up)
    finally:
        world.close()


def test_a_mesh_in_millimetres_is_refused_with_the_scale_and_accepted_with_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "part.stl"
    box(1000.0).export(file)
    text = refusal(capsys, str(file), "--mass", "0.2", "--directory", str(tmp_path / "models"))
    assert (
        "the longest side is 100 m; allowed: 0.002 to 2 m; give --scale 0.001 if the file is in millimetres (0.1 m)"
        in text
    )
    assert not (tmp_path / "models").exists()
    folder = added(tmp_path, box(1000.0), "--mass", "0.2", "--scale", "0.001")
    assert yaml.safe_load((folder / "object.yaml").read_text())["size"] == pytest.approx([0.04, 0.06, 0.1], abs=1e-6)


def test_an_open_shell_needs_a_mass_and_gets_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "thing.stl"
    open_shell().export(file)
    text = refusal(capsys, str(file), "--density", "1000", "--directory", str(tmp_path / "models"))
    assert "is not watertight, so a density gives no mass; weigh the object and give --mass" in text
    folder = added(tmp_path, open_shell(), "--mass", "0.1")
    assert "warning: The mesh is not watertight." in capsys.readouterr().out
    assert model_of(folder).links[0].inertial.mass == pytest.approx(0.1)
    assert "The mesh is not watertight." in (folder / "check.html").read_text()


def test_sizes_that_the_installed_grippers_cannot_hold_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    openings = {gripper.name: gripper.greatest_m for gripper in installed_grippers()}
    assert openings["ur5_ezgripper_robot/ezgripper"] == pytest.approx(0.142, abs=1e-3)
    assert openings["panda_hand_robot/hand"] == pytest.approx(0.08, abs=1e-3)
    added(tmp_path, trimesh.creation.box(extents=(0.1, 0.1, 0.1)), "--density", "300")
    text = capsys.readouterr().out
    assert "wider than the opening of panda_hand_robot/hand: 0.100 m" in text and "ezgripper" not in text
    added(tmp_path, trimesh.creation.box(extents=(0.1, 0.1, 0.002)), "--density", "300", "--force")
    assert "The object is 2.0 mm thin" in capsys.readouterr().out


def test_the_check_page_shows_the_object_without_other_files(tmp_path: Path) -> None:
    folder = added(tmp_path, l_shape(), "--mass", "0.2")
    page = (folder / "check.html").read_text()
    assert page.count("<svg") == 3 + min(6, len(up_directions(folder)))
    assert "0.0800, 0.0300, 0.0800" in page and "0.2 kg" not in page and "No warnings." in page
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "") and "src=" not in page
    for picture in page.split("<svg")[1:]:
        ElementTree.fromstring("<svg" + picture.partition("</svg>")[0] + "</svg>")


def text_mesh(file: Path, content: str) -> str:
    file.write_text(content)
    return str(file)


PLANE = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n"
POINT = "v 0.1 0 0\nv 0.1 0 0\nv 0.1 0 0\nf 1 2 3\n"


@pytest.mark.parametrize(
    ("file", "content", "options", "fault"),
    [
        ("none.stl", None, ("--mass", "1"), "cannot be read"),
        ("thing.step", "ISO-10303-21;", ("--mass", "1"), "is a '.step' file; allowed: "),
        ("thing.obj", "v 0 0 0\n", ("--mass", "1"), "contains no triangle"),
        ("thing.obj", PLANE.replace("0.1 0 0", "nan 0 0"), ("--mass", "1"), "a vertex is not finite"),
        ("thing.obj", PLANE, ("--mass", "1"), "all triangles lie in one plane or on a line"),
        ("thing.obj", POINT, ("--mass", "1"), "all vertices are at the same point"),
        ("thing.obj", PLANE, (), "neither --mass nor --density is given; weigh the object"),
        ("thing.obj", PLANE, ("--mass", "1", "--density", "1"), "give only one of them"),
        ("thing.obj", PLANE, ("--mass", "-1"), "--mass is -1; allowed: more than 0, up to 100 kg"),
        ("thing.obj", PLANE, ("--density", "nan"), "--density is nan; allowed: more than 0"),
        ("thing.obj", PLANE, ("--mass", "1", "--friction", "0"), "--friction is 0; allowed: more than 0, up to 10"),
        ("thing.obj", PLANE, ("--mass", "1", "--colour", "2", "0", "0"), "--colour is 2 0 0; allowed: 0 to 1 each"),
        ("thing.obj", PLANE, ("--mass", "1", "--scale", "0"), "--scale is 0; allowed: a positive number"),
        ("thing.obj", PLANE, ("--mass", "1", "--name", "My Thing"), "--name is 'My Thing'; allowed: lower-case"),
        ("cube.obj", PLANE, ("--mass", "1"), "the name 'cube' is taken by the model "),
    ],
)  # fmt: skip
def test_bad_input_is_refused_with_a_sentence(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    file: str,
    content: str | None,
    options: Sequence[str],
    fault: str,
) -> None:
    if content is not None:
        text_mesh(tmp_path / file, content)
    text = refusal(capsys, str(tmp_path / file), "--directory", str(tmp_path / "models"), *options)
    assert fault in text
    assert not (tmp_path / "models").exists()


def test_a_model_is_replaced_by_force_alone_and_other_folders_never(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = added(tmp_path, l_shape(), "--mass", "0.2")
    before = (folder / "model.sdf").read_text()
    again = [str(tmp_path / "thing.stl"), "--directory", str(tmp_path / "models"), "--mass", "0.5"]
    assert "exists; give another --name, or --force to replace it" in refusal(capsys, *again)
    assert (folder / "model.sdf").read_text() == before
    (folder / "notes.txt").write_text("")
    assert main([*again, "--force"]) == 0
    assert model_of(folder).links[0].inertial.mass == pytest.approx(0.5)
    assert sorted(path.name for path in (tmp_path / "models").iterdir()) == ["thing"]
    foreign = tmp_path / "models" / "foreign"
    foreign.mkdir()
    text = refusal(capsys, *again, "--name", "foreign", "--force")
    assert "exists and is no model of add_object; give another --name or --directory" in text
    assert not list(foreign.iterdir())


def test_the_default_folder_is_the_first_of_the_search_path_and_the_output_says_how_to_use_the_object(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    box().export("thing.stl")
    assert main(["thing.stl", "--mass", "0.2"]) == 0
    output = capsys.readouterr().out
    assert f"    export GAZEBO_MODEL_PATH={tmp_path / 'models'}:$GAZEBO_MODEL_PATH\n" in output
    assert "    objects: [{model: thing, x: [-0.2, 0.2], y: 0.5, roll: " in output
    monkeypatch.setenv("GAZEBO_MODEL_PATH", f"{tmp_path / 'lab'}:{tmp_path / 'models'}")
    assert "the name 'thing' is taken by the model " in refusal(capsys, "thing.stl", "--mass", "0.2")
    assert main(["thing.stl", "--mass", "0.2", "--name", "other"]) == 0
    assert (tmp_path / "lab" / "other" / "model.sdf").is_file() and "export" not in capsys.readouterr().out
    assert models_folder() is not None
