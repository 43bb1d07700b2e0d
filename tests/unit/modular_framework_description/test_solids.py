# SPDX-License-Identifier: BSD-3-Clause
"""Mass properties computed from shapes agree with integrals over their surfaces."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_description.solids import Body, Part, ring_of_boxes, unit_inertia

LENGTH = st.floats(0.01, 0.5)


@given(LENGTH, LENGTH, LENGTH)
def test_the_inertia_of_a_box_is_that_of_its_mesh(x: float, y: float, z: float) -> None:
    part = Part("box", (x, y, z))
    mesh = part.mesh()
    mesh.density = 1.0 / mesh.volume
    assert np.allclose(unit_inertia(part), mesh.moment_inertia, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("part", [Part("cylinder", (0.03, 0.1)), Part("sphere", (0.05,))])
def test_the_inertia_of_a_round_part_is_near_that_of_its_polygons(part: Part) -> None:
    mesh = part.mesh()
    mesh.density = 1.0 / mesh.volume
    assert np.allclose(unit_inertia(part), mesh.moment_inertia, rtol=0.02, atol=1e-7)


def test_two_halves_weigh_like_the_whole() -> None:
    whole = Body("whole", "", 2.0, (Part("box", (0.2, 0.1, 0.1)),)).mass_properties()
    halves = Body(
        "halves", "", 2.0, (Part("box", (0.1, 0.1, 0.1), (-0.05, 0, 0)), Part("box", (0.1, 0.1, 0.1), (0.05, 0, 0)))
    ).mass_properties()
    assert np.allclose(whole.inertia, halves.inertia, rtol=1e-5)
    assert np.allclose(whole.centre, halves.centre, atol=1e-7)


def test_a_turned_part_moves_its_inertia_with_it() -> None:
    lying = Body("rod", "", 1.0, (Part("cylinder", (0.01, 0.2), rpy=(math.pi / 2, 0, 0)),)).mass_properties()
    assert lying.inertia[1, 1] < 0.1 * lying.inertia[0, 0]
    assert np.allclose(lying.inertia[0, 0], lying.inertia[2, 2], rtol=1e-3)


def test_a_ring_of_boxes_is_closed_and_hollow() -> None:
    ring = Body("ring", "", 1.0, ring_of_boxes(0.05, 0.005, 0.1, 16, 0.0))
    mesh = ring.mesh()
    assert mesh.is_watertight
    assert mesh.euler_number == 0, "one hole goes through"
    assert mesh.volume == pytest.approx(math.pi * (0.05**2 - 0.045**2) * 0.1, rel=0.05)


@pytest.mark.parametrize(("kind", "size"), [("cone", (1.0, 1.0)), ("box", (1.0, 1.0)), ("sphere", (0.0,))])
def test_an_impossible_part_is_refused(kind: str, size: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="allowed"):
        Part(kind, size)
