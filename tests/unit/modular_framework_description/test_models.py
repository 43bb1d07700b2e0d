# SPDX-License-Identifier: BSD-3-Clause
"""Every model is well-formed, weighs what its shape says, and can be held by the gripper."""

import math
import re
import struct
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from modular_framework_description.catalogue import CatalogueError, read_catalogue
from modular_framework_description.model_writer import write_model

CATALOGUE = Path(__file__).resolve().parents[3] / "src" / "modular_framework_description" / "config" / "catalogue.yaml"
BODIES = read_catalogue(CATALOGUE)
NAMES = [body.name for body in BODIES["graspable"]]
OPENING_M = 0.142


def sdf(package: Path, name: str) -> ElementTree.Element:
    model = ElementTree.parse(package / "models" / name / "model.sdf").getroot().find("model")
    assert model is not None
    return model


def numbers(element: ElementTree.Element, path: str) -> list[float]:
    return [float(value) for value in (element.findtext(path) or "").split()]


def collision_mesh(model: ElementTree.Element) -> trimesh.Trimesh:
    """The union of a model's collision elements, read from the file alone."""
    pieces = []
    for collision in model.iter("collision"):
        if collision.find("geometry/box") is not None:
            piece = trimesh.creation.box(extents=numbers(collision, "geometry/box/size"))
        elif collision.find("geometry/cylinder") is not None:
            radius, length = (numbers(collision, f"geometry/cylinder/{tag}")[0] for tag in ("radius", "length"))
            piece = trimesh.creation.cylinder(radius=radius, height=length, sections=128)
        else:
            piece = trimesh.creation.icosphere(radius=numbers(collision, "geometry/sphere/radius")[0], subdivisions=4)
        x, y, z, roll, pitch, yaw = numbers(collision, "pose")
        transform = trimesh.transformations.euler_matrix(roll, pitch, yaw)
        transform[:3, 3] = x, y, z
        pieces.append(piece.apply_transform(transform))
    return pieces[0] if len(pieces) == 1 else trimesh.boolean.union(pieces, engine="manifold")


def test_there_are_boxes_cylinders_a_sphere_and_something_that_is_not_convex(package: Path) -> None:
    kinds = [element.tag for name in NAMES for element in sdf(package, name).findall(".//collision/geometry/*")]
    assert len(NAMES) >= 6
    assert {"box", "cylinder", "sphere"} <= set(kinds)
    assert any(not collision_mesh(sdf(package, name)).is_convex for name in ("l_bracket", "mug"))


@pytest.mark.parametrize(
    "folder", [*NAMES, *(body.name for group in ("household", "furniture") for body in BODIES[group]), "ground_plane"]
)
def test_the_files_of_a_model_name_each_other(package: Path, folder: str) -> None:
    config = ElementTree.parse(package / "models" / folder / "model.config").getroot()
    assert config.findtext("name") == folder
    assert config.findtext("sdf") == "model.sdf"
    root = ElementTree.parse(package / "models" / folder / "model.sdf").getroot()
    assert root.get("version") == "1.5"
    assert sdf(package, folder).get("name") == folder
    assert [link.get("name") for link in sdf(package, folder).findall("link")] == ["link"]


@pytest.mark.parametrize("name", NAMES)
def test_mass_centre_and_inertia_match_the_shape(package: Path, name: str) -> None:
    inertial = sdf(package, name).find("link/inertial")
    assert inertial is not None
    mass = numbers(inertial, "mass")[0]
    stated = np.array([[numbers(inertial, f"inertia/i{min(a, b)}{max(a, b)}")[0] for b in "xyz"] for a in "xyz"])
    shape = collision_mesh(sdf(package, name))
    shape.density = mass / shape.volume
    assert 0.05 <= mass <= 0.4
    assert np.allclose(numbers(inertial, "pose")[:3], shape.center_mass, atol=1e-5)
    assert np.allclose(stated, shape.moment_inertia, rtol=0.005, atol=1e-7)


@pytest.mark.parametrize("name", NAMES)
def test_a_graspable_model_fits_between_the_pads_and_is_centred(package: Path, name: str) -> None:
    lower, upper = collision_mesh(sdf(package, name)).bounds
    assert np.allclose(lower[2] + upper[2], 0.0, atol=1e-4)
    assert 0.03 - 1e-9 <= min(upper[:2] - lower[:2]) <= 0.08
    assert min(upper[:2] - lower[:2]) < OPENING_M - 0.05


@pytest.mark.parametrize("name", NAMES)
def test_every_collision_element_states_friction_for_both_engines(package: Path, name: str) -> None:
    for collision in sdf(package, name).iter("collision"):
        values = {
            numbers(collision, f"surface/friction/{path}")[0]
            for path in ("ode/mu", "ode/mu2", "bullet/friction", "bullet/friction2")
        }
        assert len(values) == 1
        assert 0.3 <= values.pop() <= 1.2


@pytest.mark.parametrize("name", ["l_bracket", "mug"])
def test_the_visual_mesh_is_the_collision_shape(package: Path, name: str) -> None:
    uri = sdf(package, name).findtext(".//visual/geometry/mesh/uri")
    assert uri == f"model://{name}/meshes/{name}.stl"
    mesh = trimesh.load(package / "models" / name / "meshes" / f"{name}.stl")
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(collision_mesh(sdf(package, name)).volume, rel=1e-3)
    content = (package / "models" / name / "meshes" / f"{name}.stl").read_bytes()
    assert struct.unpack("<I", content[80:84])[0] * 50 + 84 == len(content)


def test_the_committed_models_are_what_the_generator_writes(package: Path, tmp_path: Path) -> None:
    for body in (body for bodies in BODIES.values() for body in bodies):
        write_model(body, tmp_path)
        for name in ("model.sdf", "model.config"):
            written, committed = ((root / body.name / name).read_text() for root in (tmp_path, package / "models"))
            assert re.sub(r"[-\d.e]+", "#", written) == re.sub(r"[-\d.e]+", "#", committed)
            values = [
                [float(x) for x in re.findall(r"(?<=[> ])-?\d[\d.e-]*(?=[< ])", text)] for text in (written, committed)
            ]
            assert np.allclose(*values, rtol=1e-5, atol=1e-9)


def test_only_the_ball_resists_rolling(package: Path) -> None:
    rolling = {name for name in NAMES if sdf(package, name).find(".//rolling_friction") is not None}
    assert rolling == {"ball"}
    assert math.isclose(numbers(sdf(package, "ball"), ".//rolling_friction")[0], 0.001)


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        ("{name: brick, description: A brick., mass: 1.0, parts: [{cube: [1, 1, 1]}]}", "got 'cube', allowed"),
        ("{name: brick, description: A brick., mass: 1.0, parts: [{box: [1, 1]}]}", "allowed 3 positive lengths"),
        ("{name: brick, description: A brick., parts: [{box: [1, 1, 1]}]}", "'mass'"),
        ("{name: brick, weight: 1.0, description: A brick., mass: 1.0, parts: [{box: [1, 1, 1]}]}", "'weight'"),
        ("{name: brick, source: hearsay, description: A brick., mass: 1.0, parts: [{box: [1, 1, 1]}]}", "'hearsay'"),
    ],
)
def test_a_faulty_model_of_a_catalogue_is_named_with_the_file(tmp_path: Path, entry: str, text: str) -> None:
    file = tmp_path / "own.yaml"
    file.write_text(f"graspable:\n- {entry}\n")
    with pytest.raises(CatalogueError) as caught:
        read_catalogue(file)
    assert str(caught.value).startswith(f"{file}: model 'brick': ") and text in str(caught.value)
