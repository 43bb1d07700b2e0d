# SPDX-License-Identifier: BSD-3-Clause
"""Pairs of contacts of shapes whose antipodal points are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from modular_framework_core.grasp_generation import surface_points
from modular_framework_core.grasp_generation.surface_points import Surface
from point_cloud_grasps.cloud_pairs import CloudPairSettings, FoundPairs, sample_pairs

SETTINGS = CloudPairSettings()
CONE_RAD = math.atan(SETTINGS.friction)


def pairs_of(surface: Surface, widest: float = 0.2, seed: int = 1) -> FoundPairs:
    generator = np.random.default_rng(seed)
    return sample_pairs(
        surface.points, surface.normals, surface.centroid, widest, settings=SETTINGS, generator=generator
    )


def test_contacts_of_a_box_are_on_opposite_faces_within_the_cone() -> None:
    size = np.array([0.04, 0.07, 0.1])
    found = pairs_of(surface_points.box(size.tolist()))
    assert found.pairs
    for pair in found.pairs:
        axis = int(np.argmax(np.abs(pair.axis)))
        assert abs(pair.first[axis]) == pytest.approx(size[axis] / 2) == abs(pair.second[axis])
        assert pair.first[axis] == pytest.approx(-pair.second[axis])
        assert math.acos(min(1.0, abs(pair.axis[axis]))) <= CONE_RAD + 1e-9
        assert pair.alignment == pytest.approx(abs(pair.axis[axis]))
    assert found.narrowest_m == pytest.approx(0.04, abs=0.002)


@pytest.mark.parametrize("radius", [0.015, 0.035])
def test_the_line_between_contacts_of_a_sphere_passes_its_centre_within_the_cone(radius: float) -> None:
    found = pairs_of(surface_points.sphere(radius))
    assert found.pairs
    for pair in found.pairs:
        assert pair.distance_from(np.zeros(3)) <= radius * math.sin(CONE_RAD) + 1e-9
        assert np.linalg.norm(pair.first) == pytest.approx(radius) == np.linalg.norm(pair.second)
    assert found.pairs[0].alignment > 0.99, "the best comes first"


def test_contacts_of_a_cylinder_face_each_other_across_the_axis_or_are_its_ends() -> None:
    found = pairs_of(surface_points.cylinder(0.1, 0.03))
    kinds = set()
    for pair in found.pairs:
        across = float(np.linalg.norm(pair.axis[:2]))
        kinds.add("side" if across > 0.9 else "ends")
        if across > 0.9:
            offset = abs(pair.first[0] * pair.axis[1] - pair.first[1] * pair.axis[0]) / across
            assert offset <= 0.03 * math.sin(CONE_RAD) + 1e-6
    assert kinds == {"side", "ends"}


def test_no_pair_is_wider_than_allowed_and_the_narrowest_is_reported() -> None:
    surface = surface_points.box((0.06, 0.08, 0.1))
    assert {round(pair.width, 2) for pair in pairs_of(surface, widest=0.07).pairs} <= {0.06, 0.07}
    none = pairs_of(surface, widest=0.05)
    assert none.pairs == [] and none.narrowest_m == pytest.approx(0.06, abs=0.003)


def test_a_single_face_has_no_pairs() -> None:
    box = surface_points.box((0.1, 0.1, 0.02))
    top = box.normals[:, 2] > 0.5
    found = sample_pairs(
        box.points[top], box.normals[top], box.centroid, 1.0, settings=SETTINGS, generator=np.random.default_rng(1)
    )
    assert found == FoundPairs([], math.inf)


def test_the_seed_alone_decides() -> None:
    surface = surface_points.sphere(0.03)
    one, same, other = ([pair.first.tolist() for pair in pairs_of(surface, seed=seed).pairs] for seed in (1, 1, 2))
    assert one == same != other
