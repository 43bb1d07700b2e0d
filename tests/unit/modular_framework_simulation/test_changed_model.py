# SPDX-License-Identifier: BSD-3-Clause
"""A model with another mass, centre of mass or friction moves accordingly in each engine, also in another size."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.model_variants import changed_model, scaled_model
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources, no_packages
from modular_framework_simulation.models.sdf_specs import Model
from modular_framework_simulation.physics.engine_choice import ENGINES
from modular_framework_simulation.physics.physics_engine import BASE_INDEX
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState, Twist
from modular_framework_testing.simulation.simulated_samples import run

MODELS = Path(__file__).parents[3] / "src/modular_framework_description/models"
GRAVITY, CUBE_KG, CUBE_FRICTION = 9.81, 0.1, 0.8


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    """Every engine."""
    name: str = request.param
    return name


BLOCK = read_model_text(
    "<sdf version='1.6'><model name='block'><static>true</static><link name='link'><collision name='c'><geometry><box>"
    "<size>0.2 0.2 0.1</size></box></geometry></collision></link></model></sdf>",
    "block",
    Resources((), no_packages),
)


def changed_cube(scale: float = 1.0, **factors: float) -> Model:
    """The shipped cube in another size with a change, on the floor."""
    text = scaled_model((MODELS / "cube" / "model.sdf").read_text(), scale, "cube")
    model = read_model_text(changed_model(text, "cube", **factors), "cube", Resources((MODELS,), no_packages))
    return dataclasses.replace(model, pose=Pose((0.0, 0.0, 0.025 * scale)))


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_the_floor_carries_the_changed_weight(world: PhysicsWorld, scale: float) -> None:
    body = world.spawn(changed_cube(scale, mass=3.0))
    run(world, 1.0)
    force = sum(contact.force for contact in world.contacts(body, BASE_INDEX))
    assert force == pytest.approx(3.0 * scale**3 * CUBE_KG * GRAVITY, rel=0.02)


def test_a_sliding_cube_slows_down_with_the_changed_friction(world: PhysicsWorld) -> None:
    body = world.spawn(changed_cube(friction=0.25))
    run(world, 0.2)
    world.set_state("cube", BodyState(body.state().pose, Twist((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))), "world")
    run(world, 0.3)
    expected = 1.0 - 0.25 * CUBE_FRICTION * GRAVITY * 0.3
    assert body.state().twist.linear[0] == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(("offset_m", "falls"), [(0.0, False), (0.015, False), (0.024, True)])
def test_a_cube_tips_over_an_edge_that_its_centre_of_mass_has_passed(
    world: PhysicsWorld, offset_m: float, falls: bool
) -> None:
    """The cube extends 5 mm beyond the edge of a block, so that it tips from an offset of 20 mm on."""
    world.spawn(dataclasses.replace(BLOCK, pose=Pose((-0.1, 0.0, 0.05))))
    cube = changed_cube(centre_of_mass=offset_m)
    body = world.spawn(dataclasses.replace(cube, pose=Pose((-0.02, 0.0, 0.125))))
    run(world, 1.5)
    assert (body.state().pose.position[2] < 0.1) == falls


SDF = "<sdf version='1.11'><model name='m'><link name='link'>{}</link></model></sdf>"
BOX = "<collision name='c'>{}<geometry><box><size>0.1 0.1 0.1</size></box></geometry></collision>"


@pytest.mark.parametrize(
    ("inertial", "mass_kg"),
    [("", 1.0), ("<inertial/>", 1.0), ("<inertial auto='true'/>", 1.0), ("<inertial><mass>0.5</mass></inertial>", 0.5)],
)
def test_a_missing_mass_is_that_of_sdf(inertial: str, mass_kg: float) -> None:
    def inertial_of(factor: float) -> tuple[float, tuple[float, ...]]:
        text = changed_model(SDF.format(inertial + BOX.format("")), "m", mass=factor)
        (link,) = read_model_text(text, "m", Resources((), no_packages)).links
        assert link.inertial is not None
        return link.inertial.mass, link.inertial.inertia

    mass, moments = inertial_of(1.0)
    assert mass == pytest.approx(mass_kg)
    changed_mass, changed_moments = inertial_of(2.0)
    assert changed_mass == pytest.approx(2.0 * mass_kg)
    assert changed_moments == pytest.approx([2.0 * moment for moment in moments])


@pytest.mark.parametrize(
    ("surface", "expected"),
    [
        ("", 0.5),
        ("<surface><friction><ode><mu>0.6</mu></ode></friction></surface>", 0.3),
        ("<surface><friction><bullet><friction>0.4</friction></bullet></friction></surface>", 0.2),
    ],
)
def test_a_missing_friction_is_that_of_sdf(surface: str, expected: float) -> None:
    text = changed_model(SDF.format(BOX.format(surface)), "m", friction=0.5)
    (link,) = read_model_text(text, "m", Resources((), no_packages)).links
    assert link.collisions[0].friction.lateral == pytest.approx(expected)


def test_a_surface_that_never_slides_keeps_its_friction() -> None:
    text = SDF.format(BOX.format("<surface><friction><ode><mu>-1</mu></ode></friction></surface>"))
    before, after = (
        read_model_text(changed_model(text, "m", friction=factor), "m", Resources((), no_packages)).links[0]
        for factor in (1.0, 0.5)
    )
    assert before.collisions[0].friction == after.collisions[0].friction


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("<sdf", "not an XML document"),
        ("<sdf version='1.6'><model name='m'><include><uri>model://can</uri></include></model></sdf>", "<include>"),
        (SDF.format("<inertial auto='true'/>"), "allowed with another centre of mass: an <inertial> with mass"),
    ],
)
def test_a_model_that_cannot_be_changed_is_refused(text: str, reason: str) -> None:
    with pytest.raises(DescriptionError, match=reason):
        changed_model(text, "model.sdf", centre_of_mass=0.01)
    assert changed_model(text, "model.sdf") == text
