# SPDX-License-Identifier: BSD-3-Clause
"""Pairs of contacts lie on the surface, each in its friction cone, and nothing but air is outside of them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from antipodal_grasps.contact_pairs import PairSettings, contact_pairs
from modular_framework_core.grasp_generation import solid_meshes
from modular_framework_core.grasp_generation.contact_pair import ContactPair
from modular_framework_urdf.mesh_reader import TriangleMesh

SETTINGS = PairSettings()
CONE_RAD = np.arctan(SETTINGS.friction)
ROUNDING_RAD = 1e-6
FACET_RAD = np.radians(4.5)  # between the normal of a facet of a round shape and that of the shape
WIDEST_M = 0.14


def pairs_of(*solids: TriangleMesh, widest: float = WIDEST_M, seed: int = 1) -> list[ContactPair]:
    return contact_pairs(solids, np.zeros(3), widest, SETTINGS, np.random.default_rng(seed))


def drawn(mesh: trimesh.Trimesh) -> TriangleMesh:
    return TriangleMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64))


def shifted(mesh: TriangleMesh, *translation: float) -> TriangleMesh:
    return solid_meshes.move_mesh(mesh, np.eye(3), np.array(translation))


def angles(pair: ContactPair, first_normal: np.ndarray, second_normal: np.ndarray) -> tuple[float, float]:
    """Angles between the closing axis and the normals, as a fresh computation [rad]."""
    axis = (pair.second - pair.first) / np.linalg.norm(pair.second - pair.first)
    return (
        float(np.arccos(np.clip(-axis @ first_normal, -1.0, 1.0))),
        float(np.arccos(np.clip(axis @ second_normal, -1.0, 1.0))),
    )


def box_normal(point: np.ndarray, size: np.ndarray) -> np.ndarray:
    side = int(np.argmax(np.abs(point) / (size / 2)))
    assert abs(point[side]) == pytest.approx(size[side] / 2, abs=1e-9)
    normal = np.zeros(3)
    normal[side] = np.sign(point[side])
    return normal


def test_contacts_on_a_box_are_antipodal_within_the_friction_cone() -> None:
    size = np.array([0.04, 0.07, 0.12])
    pairs = pairs_of(solid_meshes.box(size.tolist()))
    assert len(pairs) > 30
    for pair in pairs:
        assert max(angles(pair, box_normal(pair.first, size), box_normal(pair.second, size))) <= CONE_RAD + ROUNDING_RAD
    closed = {int(np.argmax(np.abs(pair.axis))) for pair in pairs}
    assert closed == {0, 1, 2}, "the box can be held across each of its three directions"


def test_contacts_on_a_cylinder_go_through_its_axis_or_along_it() -> None:
    pairs = pairs_of(solid_meshes.cylinder(0.12, 0.03))
    assert len(pairs) > 30
    for pair in pairs:
        normals = []
        for point in (pair.first, pair.second):
            is_end = abs(abs(point[2]) - 0.06) < 1e-9
            radial = np.array([point[0], point[1], 0.0]) / max(1e-9, np.linalg.norm(point[:2]))
            normals.append(np.array([0.0, 0.0, np.sign(point[2])]) if is_end else radial)
            assert is_end or np.linalg.norm(point[:2]) == pytest.approx(0.03, rel=2e-3)
        assert max(angles(pair, *normals)) <= CONE_RAD + FACET_RAD


def test_contacts_on_a_sphere_are_opposite() -> None:
    pairs = pairs_of(solid_meshes.sphere(0.03))
    assert len(pairs) > 30
    for pair in pairs:
        normals = [point / np.linalg.norm(point) for point in (pair.first, pair.second)]
        assert max(angles(pair, *normals)) <= CONE_RAD + FACET_RAD
        assert pair.distance_from(np.zeros(3)) <= 0.03 * np.sin(CONE_RAD + FACET_RAD)


def test_contacts_on_a_mesh_are_antipodal_by_the_nearest_triangle() -> None:
    mesh = trimesh.creation.torus(0.05, 0.015, major_sections=48, minor_sections=24)
    pairs = pairs_of(drawn(mesh))
    assert len(pairs) > 30
    triangles = np.asarray(mesh.triangles)
    for pair in pairs:
        normals = []
        for point in (pair.first, pair.second):
            nearest = trimesh.triangles.closest_point(triangles, np.tile(point, (len(triangles), 1)))
            distances = np.linalg.norm(nearest - point, axis=1)
            assert distances.min() < 1e-7
            normals.append(np.asarray(mesh.face_normals)[distances < 1e-7])
        found = [
            max(angles(pair, first, second)) for first in normals[0] for second in normals[1]
        ]  # a contact on an edge belongs to both triangles
        assert min(found) <= CONE_RAD + ROUNDING_RAD


def test_no_pair_is_wider_than_the_gripper_opens() -> None:
    narrow = pairs_of(solid_meshes.box((0.04, 0.07, 0.12)), widest=0.05)
    assert narrow and all(pair.width <= 0.05 for pair in narrow)
    assert not pairs_of(solid_meshes.box((0.2, 0.2, 0.2)))


def test_contacts_of_an_object_of_two_parts_are_on_the_outside_of_both() -> None:
    leg, foot = ((0.02, 0.03, 0.06), (-0.03, 0.0, 0.01)), ((0.08, 0.03, 0.02), (0.0, 0.0, -0.03))
    pairs = pairs_of(*(shifted(solid_meshes.box(size), *place) for size, place in (leg, foot)))
    assert pairs
    for pair in pairs:
        for point, outward in ((pair.first, -pair.axis), (pair.second, pair.axis)):
            outside = point + 1e-4 * outward
            for size, place in (leg, foot):
                assert (np.abs(outside - place) > np.array(size) / 2 - 1e-9).any(), (pair, size)


def test_both_the_wall_and_the_whole_of_a_hollow_object_are_found() -> None:
    pipe = drawn(trimesh.creation.annulus(0.03, 0.035, 0.08, sections=48))
    widths = np.array([pair.width for pair in pairs_of(pipe)])
    assert (np.abs(widths - 0.005) < 0.001).any()
    assert (np.abs(widths - 0.07) < 0.001).any()


def test_a_mesh_with_a_hole_gives_no_contact_where_it_is_open() -> None:
    mesh = trimesh.creation.box((0.04, 0.07, 0.12))
    open_at_the_top = trimesh.Trimesh(mesh.vertices, mesh.faces[mesh.face_normals[:, 2] < 0.5], process=False)
    assert all(abs(pair.axis[2]) < 0.5 for pair in pairs_of(drawn(open_at_the_top)))


def test_the_seed_alone_decides_which_pairs_are_found() -> None:
    def found(seed: int) -> np.ndarray:
        return np.array([pair.middle for pair in pairs_of(solid_meshes.cylinder(0.12, 0.03), seed=seed)])

    assert np.array_equal(found(7), found(7))
    assert found(7).shape != found(8).shape or not np.allclose(found(7), found(8))
