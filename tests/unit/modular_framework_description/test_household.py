# SPDX-License-Identifier: BSD-3-Clause
"""Household objects have the size, mass and friction that were published, and the worlds made of them stand still."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from modular_framework_description.catalogue import read_catalogue
from modular_framework_description.scene_writer import world_scene_text
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.sdf_reader import read_world
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld

CATALOGUE = Path(__file__).resolve().parents[3] / "src" / "modular_framework_description" / "config" / "catalogue.yaml"
HOUSEHOLD = read_catalogue(CATALOGUE)["household"]
# name: mass [g], edges of the bounding box in any order [mm], friction; as the tables have them
PUBLISHED = {
    "toy_cube": (12.2, (31.0, 31.0, 31.0), 0.31),
    "drinks_can": (368.0, (65.8, 65.8, 115.6), 0.23),
    "tissue_pack": (25.7, (107.0, 53.0, 25.0), 0.35),
    "tennis_ball": (58.4, (66.0, 66.0, 66.0), 0.79),
    "sharpener": (24.4, (36.6, 36.6, 57.0), 0.44),
    "remote_control": (145.9, (165.0, 50.0, 40.0), 0.4),
    "board_marker": (16.8, (140.0, 17.8, 17.8), 0.44),
    "tea_light": (13.5, (38.0, 38.0, 16.5), 0.3),
    "golf_ball": (45.7, (42.7, 42.7, 42.7), 0.25),
    "matchbox": (7.2, (52.0, 37.0, 13.5), 0.48),
    "chocolate_bar": (55.7, (101.0, 30.5, 22.0), 0.3),
    "folding_rule": (101.4, (235.0, 16.4, 39.0), 0.31),
    "voltage_tester": (16.9, (139.3, 17.5, 15.0), 0.26),
    "eraser": (17.9, (49.0, 10.3, 24.2), 1.1),
    "pencil": (4.4, (175.0, 7.6, 6.9), 0.3),
    "cracker_box": (411.0, (60.0, 158.0, 210.0), 0.48),
    "sugar_box": (514.0, (38.0, 89.0, 175.0), 0.48),
    "pudding_box": (187.0, (35.0, 110.0, 89.0), 0.48),
    "gelatin_box": (97.0, (28.0, 85.0, 73.0), 0.48),
    "tomato_soup_can": (349.0, (66.0, 66.0, 101.0), 0.23),
    "tuna_fish_can": (171.0, (85.0, 85.0, 33.0), 0.23),
    "potted_meat_can": (370.0, (50.0, 97.0, 82.0), 0.23),
    "foam_brick": (28.0, (50.0, 75.0, 50.0), 0.54),
    "mustard_bottle": (603.0, (58.0, 95.0, 190.0), 0.40),
}
OFFSETS_MM = {"remote_control": 11.0, "board_marker": 2.0, "voltage_tester": 11.5, "pencil": 5.5}
WORLDS = {
    "empty_table": 0,
    "cluttered_table": 10,
    "shelf": 5,
    "bin": 6,
    "table_and_bin": 0,
    "low_compartment": 0,
    "high_compartment": 0,
}
STEPS = 500


def text(package: Path, name: str, path: str) -> str:
    model = ElementTree.parse(package / "models" / name / "model.sdf").getroot().find("model")
    assert model is not None
    return model.findtext(path) or ""


def test_every_object_of_the_tables_is_there() -> None:
    assert {body.name for body in HOUSEHOLD} == set(PUBLISHED)
    assert all(" Source: Development of Grasps" in body.description or "YCB" in body.description for body in HOUSEHOLD)


@pytest.mark.parametrize("name", PUBLISHED)
def test_files_have_the_published_size_mass_and_friction(package: Path, name: str) -> None:
    mass_g, edges_mm, friction = PUBLISHED[name]
    body = next(body for body in HOUSEHOLD if body.name == name)
    assert float(text(package, name, "link/inertial/mass")) == pytest.approx(mass_g / 1000)
    assert np.allclose(sorted(body.mesh().extents), sorted(np.array(edges_mm) / 1000), rtol=0.01)
    assert float(text(package, name, "link/collision/surface/friction/ode/mu")) == friction
    stated = [float(value) for value in text(package, name, "link/inertial/pose").split()][:3]
    assert np.allclose(stated, np.add(body.mesh().center_mass, (OFFSETS_MM.get(name, 0) / 1000, 0, 0)), atol=1e-4)


@pytest.mark.parametrize("name", PUBLISHED)
def test_moments_of_inertia_are_those_of_the_evenly_filled_shape(package: Path, name: str) -> None:
    mesh = next(body for body in HOUSEHOLD if body.name == name).mesh()
    mesh.density = PUBLISHED[name][0] / 1000 / mesh.volume
    keys = [[f"i{min(a, b)}{max(a, b)}" for b in "xyz"] for a in "xyz"]
    stated = np.array([[float(text(package, name, f"link/inertial/inertia/{key}")) for key in row] for row in keys])
    assert np.allclose(stated, mesh.moment_inertia, rtol=0.02, atol=1e-10)


def simulated(package: Path, name: str, tmp_path: Path) -> PhysicsWorld:
    resources = Resources((package / "models",), lambda _: "", ())
    read = read_world(package / "worlds" / f"{name}.world", resources)
    world = PhysicsWorld(PhysicsSettings(), ConvexParts(tmp_path), read.gravity, log=lambda _: None)
    for model in read.models:
        world.spawn(model)
    return world


@pytest.mark.parametrize("name", WORLDS)
def test_a_world_stands_still_when_simulated(package: Path, name: str, tmp_path: Path) -> None:
    world = simulated(package, name, tmp_path)
    try:
        loose = [body.name for body in world.bodies.values() if not body.static]
        assert len(loose) == WORLDS[name]
        before = {model: world.entity_state(model).pose for model in loose}
        for _ in range(STEPS):
            world.step()
        for model, pose in before.items():
            moved, turned = world.entity_state(model).pose.distance_to(pose)
            assert moved < 0.002 and turned < 0.05, f"{model}: {moved * 1000:.2f} mm, {turned:.3f} rad"
    finally:
        world.close()


@pytest.mark.parametrize("name", WORLDS)
def test_a_world_has_its_scene(package: Path, name: str) -> None:
    text = world_scene_text(package / "worlds" / f"{name}.world", package / "models")
    assert text == (package / "scenes" / f"{name}.scene").read_text()
