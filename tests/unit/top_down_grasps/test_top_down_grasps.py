# SPDX-License-Identifier: BSD-3-Clause
"""Grasps from above: they fit the hand, keep off the support, and the best ones are where one would grasp."""

from __future__ import annotations

import math
import random
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from modular_framework_core.grasp_generation import surface_points
from modular_framework_core.grasp_generation.gripper_geometry import (
    GripperGeometry,
    GripperGeometryError,
    measure_gripper,
)
from modular_framework_core.grasp_generation.object_names import is_named
from modular_framework_core.grasp_generation.planning_scene_objects import (
    CropBox,
    SceneObjectError,
    rotation_matrix,
    scene_object,
)
from modular_framework_core.grasp_generation.surface_points import Surface
from top_down_grasps.top_down import TopDownSettings, top_down_grasps

sys.path.insert(0, str(Path(__file__).parents[1]))
from two_finger_hands import fixed_jaw  # noqa: E402

UP = np.array([0.0, 0.0, 1.0])
SETTINGS = TopDownSettings()
TABLE = 0.84
JOINT = "ezgripper_knuckle_palm_L1_1"


@pytest.fixture(scope="module")
def urdf() -> str:
    from xacro_rospkg import expand

    folder = Path(__file__).parents[3] / "src" / "robots" / "ur5_ezgripper_robot" / "urdf"
    return str(expand(folder / "ur5_with_ezgripper.urdf.xacro", {}))


@pytest.fixture(scope="module")
def gripper(urdf: str) -> GripperGeometry:
    return measure_gripper(urdf, "eg_manipulator", JOINT)


def on_table(surface: Surface, x: float, y: float, yaw: float = 0.0) -> Surface:
    turned = surface.transformed(Rotation.from_euler("z", yaw).as_matrix(), np.zeros(3))
    return turned.transformed(np.eye(3), np.array([x, y, TABLE - turned.points[:, 2].min()]))


def test_the_opening_follows_from_the_geometry_of_the_fingers(gripper: GripperGeometry) -> None:
    expected = np.maximum(0.0, 2 * (0.019 + 0.052 * np.cos(gripper.positions)))
    assert gripper.openings == pytest.approx(expected, abs=5e-4)
    assert gripper.max_opening == pytest.approx(0.142, abs=1e-3)
    assert gripper.closed_position == pytest.approx(1.94)
    for opening in (0.02, 0.05, 0.1):
        assert gripper.position_for(opening) == pytest.approx(math.acos((opening / 2 - 0.019) / 0.052), abs=1e-3)


@pytest.mark.parametrize(("link", "joint"), [("moon", JOINT), ("eg_manipulator", "moon"), ("base_link", "elbow_joint")])
def test_a_robot_without_such_a_gripper_is_refused(urdf: str, link: str, joint: str) -> None:
    with pytest.raises(GripperGeometryError):
        measure_gripper(urdf, link, joint)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.02, 0.09), st.floats(0.02, 0.09), st.floats(0.03, 0.15), st.floats(0, math.pi), st.booleans())
def test_every_grasp_fits_the_hand_and_keeps_off_the_table(
    gripper: GripperGeometry, width: float, depth: float, height: float, yaw: float, round_: bool
) -> None:
    shape = surface_points.cylinder(height, width / 2) if round_ else surface_points.box((width, depth, height))
    surface = on_table(shape, 0.05, 0.5, yaw)
    for grasp in top_down_grasps(surface, TABLE, gripper, SETTINGS):
        opening = float(np.interp(grasp.pregrasp_joint, gripper.positions, gripper.openings))
        assert opening >= grasp.width + 1.9 * SETTINGS.finger_clearance_m
        assert grasp.position[2] - gripper.max_tip >= TABLE + SETTINGS.tip_clearance_m - 1e-9
        assert 0.0 <= grasp.quality <= 1.0


@pytest.mark.parametrize("yaw", [0.0, 0.4, 1.2, -0.7])
def test_the_best_grasp_of_a_box_closes_across_its_narrow_side_over_its_centre(
    gripper: GripperGeometry, yaw: float
) -> None:
    grasps = top_down_grasps(on_table(surface_points.box((0.04, 0.07, 0.12)), 0.05, 0.5, yaw), TABLE, gripper, SETTINGS)
    best = grasps[0]
    assert best.width == pytest.approx(0.04, abs=1e-6)
    assert math.sin(best.yaw - yaw) == pytest.approx(0.0, abs=1e-6)
    assert best.position[:2] == pytest.approx((0.05, 0.5), abs=1e-6)
    assert len(grasps) > 2
    assert [g.quality for g in grasps] == sorted((g.quality for g in grasps), reverse=True)


def test_a_jaw_that_moves_and_one_that_is_fixed_advance_at_equal_distances_from_the_object() -> None:
    gripper = measure_gripper(fixed_jaw(), "tool", "slide")
    best = top_down_grasps(on_table(surface_points.box((0.02, 0.05, 0.1)), 0.05, 0.5), TABLE, gripper, SETTINGS)[0]
    opening = best.pregrasp_joint  # the fixed jaw is at the grasp frame
    closing = np.array([math.cos(best.yaw), math.sin(best.yaw)])
    assert np.array(best.position[:2]) + opening / 2 * closing == pytest.approx([0.05, 0.5], abs=1e-3)
    assert abs(closing) == pytest.approx([1.0, 0.0], abs=1e-6)


def test_a_long_box_is_grasped_across_and_one_that_is_wide_both_ways_not_at_all(gripper: GripperGeometry) -> None:
    beam = on_table(surface_points.box((0.3, 0.03, 0.05)), 0.0, 0.5)
    assert all(math.sin(g.yaw) ** 2 > 0.9 for g in top_down_grasps(beam, TABLE, gripper, SETTINGS))
    assert not top_down_grasps(on_table(surface_points.box((0.2, 0.2, 0.1)), 0.0, 0.5), TABLE, gripper, SETTINGS)


def test_something_flat_cannot_be_grasped_from_above(gripper: GripperGeometry) -> None:
    assert not top_down_grasps(on_table(surface_points.box((0.05, 0.05, 0.006)), 0, 0.5), TABLE, gripper, SETTINGS)


def test_a_lying_cylinder_is_grasped_across_its_axis_at_its_middle(gripper: GripperGeometry) -> None:
    tipping = Rotation.from_euler("y", math.pi / 2).as_matrix()
    lying = surface_points.cylinder(0.14, 0.02).transformed(tipping, np.zeros(3))
    best = top_down_grasps(on_table(lying, 0.0, 0.5, 0.3), TABLE, gripper, SETTINGS)[0]
    assert abs(math.cos(best.yaw - 0.3)) < 0.05
    assert best.position[:2] == pytest.approx((0.0, 0.5), abs=1e-3)


def test_a_standing_cylinder_and_a_sphere_are_grasped_through_their_axis(gripper: GripperGeometry) -> None:
    for shape, width in ((surface_points.cylinder(0.115, 0.033), 0.066), (surface_points.sphere(0.032), 0.064)):
        best = top_down_grasps(on_table(shape, 0.1, 0.45), TABLE, gripper, SETTINGS)[0]
        assert best.position[:2] == pytest.approx((0.1, 0.45), abs=2e-3)
        assert best.width == pytest.approx(width, abs=1.5e-3)


def test_a_mesh_gives_the_grasps_of_the_shape_it_draws(gripper: GripperGeometry) -> None:
    trimesh = pytest.importorskip("trimesh")
    drawn = trimesh.creation.box((0.04, 0.07, 0.12))
    surface = surface_points.mesh(np.asarray(drawn.vertices), np.asarray(drawn.faces, dtype=np.int64))
    assert surface.volume == pytest.approx(0.04 * 0.07 * 0.12)
    assert surface.centroid == pytest.approx(np.zeros(3), abs=1e-9)
    best = top_down_grasps(on_table(surface, 0.05, 0.5, 0.4), TABLE, gripper, SETTINGS)[0]
    assert best.width == pytest.approx(0.04, abs=2e-3)
    assert best.position[:2] == pytest.approx((0.05, 0.5), abs=3e-3)


def test_an_angle_of_two_boxes_is_grasped_on_one_of_its_legs(gripper: GripperGeometry) -> None:
    long_leg = surface_points.box((0.03, 0.12, 0.04)).transformed(np.eye(3), np.array([-0.045, 0.0, 0.0]))
    short_leg = surface_points.box((0.09, 0.03, 0.04)).transformed(np.eye(3), np.array([0.015, -0.045, 0.0]))
    grasps = top_down_grasps(
        on_table(surface_points.join_surfaces([long_leg, short_leg]), 0.0, 0.5), TABLE, gripper, SETTINGS
    )
    assert grasps
    assert min(grasp.width for grasp in grasps) == pytest.approx(0.03, abs=1e-6)


def test_volumes_and_centroids_are_those_of_the_solids() -> None:
    cone = surface_points.cylinder(0.2, 0.05, 0.0)
    assert cone.volume == pytest.approx(math.pi * 0.05**2 * 0.2 / 3)
    assert cone.centroid[2] == pytest.approx(-0.1 + 0.05)
    for shape in (surface_points.box((0.1, 0.2, 0.3)), cone, surface_points.sphere(0.03)):
        assert np.linalg.norm(shape.normals, axis=1) == pytest.approx(1.0)
        outward = ((shape.points - shape.centroid) * shape.normals).sum(axis=1)
        assert (outward > 0).all()


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0, w: float = 0.0) -> SimpleNamespace:
    return SimpleNamespace(x=x, y=y, z=z, w=w)


def pose(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> SimpleNamespace:
    return SimpleNamespace(position=vector(x, y, z), orientation=vector())


def collision_object(primitives: list[SimpleNamespace]) -> SimpleNamespace:
    return SimpleNamespace(
        id="box__link",
        pose=pose(1.0, 2.0, 3.0),
        primitives=primitives,
        primitive_poses=[pose(0.0, 0.0, 0.1)] * len(primitives),
        meshes=[],
        mesh_poses=[],
    )


def test_a_collision_object_is_placed_by_its_own_pose_and_that_of_its_parts() -> None:
    found = scene_object(collision_object([SimpleNamespace(type=1, dimensions=[0.1, 0.2, 0.4])]))
    assert found is not None
    assert found.centre == pytest.approx((1.0, 2.0, 3.1))
    assert found.bottom == pytest.approx(2.9)
    assert CropBox((0.0, 0.0, 0.0), (2.0, 3.0, 4.0)).holds(found.centre)
    assert not CropBox((0.0, 0.0, 0.0), (2.0, 3.0, 3.0)).holds(found.centre)


def test_a_plane_is_no_object_to_grasp_and_a_broken_part_is_named() -> None:
    assert scene_object(collision_object([])) is None
    for shape in (SimpleNamespace(type=1, dimensions=[0.1]), SimpleNamespace(type=2, dimensions=[-1.0])):
        with pytest.raises(SceneObjectError, match="box__link"):
            scene_object(collision_object([shape]))


def test_objects_are_found_by_model_or_by_id() -> None:
    assert is_named("can__link", "can")
    assert is_named("can__link", "can__link")
    assert is_named("can__link", "")
    assert not is_named("candle__link", "can")


def test_rotations_of_quaternions_are_rotations() -> None:
    generator = random.Random(1)
    for _ in range(20):
        matrix = rotation_matrix(vector(*(generator.uniform(-1, 1) for _ in range(4))))
        assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-12)
    assert rotation_matrix(vector(0, 0, math.sin(0.2), math.cos(0.2))) == pytest.approx(
        Rotation.from_euler("z", 0.4).as_matrix()
    )
