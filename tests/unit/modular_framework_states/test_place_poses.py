# SPDX-License-Identifier: BSD-3-Clause
"""Where a held object is put down: on a stable face, in the region, on the surface; else the reason is given."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from modular_framework_core.grasp_generation import solid_meshes
from modular_framework_states.place_poses import (
    PlaceError,
    PlaceLimits,
    TargetRegion,
    place_poses,
    read_region,
    stable_directions,
    upper_face,
)
from modular_framework_urdf.mesh_reader import TriangleMesh

TABLE = solid_meshes.move_mesh(solid_meshes.box((1.2, 0.8, 0.03)), np.eye(3), np.array([0.0, 0.56, 0.825]))
LEG = solid_meshes.move_mesh(solid_meshes.box((0.05, 0.05, 0.81)), np.eye(3), np.array([0.56, 0.2, 0.405]))
CUBE = [solid_meshes.box((0.05, 0.05, 0.05))]
GOAL = TargetRegion(name="goal", x=(0.1, 0.2), y=(0.4, 0.6))
IDENTITY = Rotation.identity()


def face(region: TargetRegion = GOAL):
    return upper_face([TABLE, LEG], region)


def test_a_cube_stands_first_in_the_middle_of_the_region_as_it_was_grasped() -> None:
    held = Rotation.from_euler("z", 0.3)
    poses = place_poses(CUBE, held, face(), GOAL, PlaceLimits(gap_m=0.002))
    assert np.allclose(poses[0].position, [0.15, 0.5, 0.84 + 0.002 + 0.025])
    assert (poses[0].rotation * held.inv()).magnitude() == pytest.approx(0.0, abs=1e-9)
    turns = {round((pose.rotation * held.inv()).magnitude(), 6) for pose in poses[:8]}
    assert turns == {round(math.radians(angle), 6) for angle in (0, 45, 90, 135, 180)}
    for pose in poses:
        assert 0.1 <= pose.position[0] <= 0.2 and 0.4 <= pose.position[1] <= 0.6


def test_an_object_that_was_tilted_in_the_hand_is_set_upright() -> None:
    held = Rotation.from_euler("zyx", [0.4, 0.0, 0.2])
    best = place_poses(CUBE, held, face(), GOAL)[0]
    assert np.allclose(best.rotation.apply([0.0, 0.0, 1.0]), [0.0, 0.0, 1.0])
    assert (best.rotation * held.inv()).magnitude() == pytest.approx(0.2)


def test_the_centre_of_the_box_is_in_the_region_wherever_the_origin_of_the_object_is() -> None:
    # 0.1 long, from x = 0 to 0.1 and z = 0 to 0.04 in its frame, turned by 90 degrees: it lies along y
    block = [solid_meshes.move_mesh(solid_meshes.box((0.1, 0.02, 0.04)), np.eye(3), np.array([0.05, 0.0, 0.02]))]
    best = place_poses(block, Rotation.from_euler("z", math.pi / 2), face(), GOAL)[0]
    assert np.allclose(best.position, [0.15, 0.5 - 0.05, 0.84])


def l_shape() -> list[TriangleMesh]:
    """The shape of the model l_bracket: two boxes that touch."""
    return [
        solid_meshes.move_mesh(solid_meshes.box(size), np.eye(3), np.array(centre))
        for size, centre in (((0.08, 0.03, 0.02), (0.0, 0.0, -0.03)), ((0.02, 0.03, 0.06), (-0.03, 0.0, 0.01)))
    ]


def pyramid() -> list[TriangleMesh]:
    """A tetrahedron with its tip far beside its base: it does not stand on the base."""
    corners = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.4, 0.4, 0.1]])
    return [solid_meshes.outward(TriangleMesh(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])))]


@pytest.mark.parametrize("solids", [CUBE, l_shape(), pyramid(), [solid_meshes.cylinder(0.1, 0.02)]])
def test_the_stable_directions_are_those_of_trimesh(solids: list[TriangleMesh]) -> None:
    joined = solid_meshes.join_meshes(solids)
    transforms, _ = trimesh.poses.compute_stable_poses(trimesh.Trimesh(joined.vertices, joined.triangles), n_samples=1)
    wanted = np.array([transform[:3, :3].T @ [0.0, 0.0, -1.0] for transform in transforms])
    found = stable_directions(solids)
    nearest = np.linalg.norm(found[:, np.newaxis] - wanted, axis=2)
    assert nearest.min(axis=0).max() < 1e-3 and nearest.min(axis=1).max() < 1e-3


def test_a_lying_object_stays_lying_unless_more_tilt_is_allowed() -> None:
    tube, lying = [solid_meshes.cylinder(0.14, 0.02)], Rotation.from_euler("x", math.pi / 2)

    def angles(max_tilt_rad: float) -> list[float]:
        poses = place_poses(tube, lying, face(), GOAL, PlaceLimits(max_tilt_rad=max_tilt_rad))
        return [math.acos(min(abs(pose.rotation.apply([0.0, 0.0, 1.0])[2]), 1.0)) for pose in poses]

    assert angles(0.3) == pytest.approx([math.pi / 2] * len(angles(0.3)))
    both = angles(math.pi)
    assert both[0] == pytest.approx(math.pi / 2) and min(both) == pytest.approx(0.0, abs=1e-6)
    with pytest.raises(PlaceError, match=r"must be tilted by 0\.50 rad to stand; allowed: 0\.1 rad"):
        place_poses(CUBE, Rotation.from_euler("x", 0.5), face(), GOAL, PlaceLimits(max_tilt_rad=0.1))


def test_an_object_is_released_above_the_place_where_it_would_stand() -> None:
    floor = TargetRegion(name="bin", x=(0.1, 0.2), y=(0.4, 0.6), z=(0.84, 0.9))
    dropped = place_poses(CUBE, IDENTITY, face(), floor, PlaceLimits(gap_m=0.16))[0]
    assert np.allclose(dropped.position, [0.15, 0.5, 0.84 + 0.16 + 0.025])


def test_beside_an_edge_the_object_stays_on_the_surface() -> None:
    edge = TargetRegion(name="edge", x=(0.4, 0.78), y=(0.4, 0.6))
    poses = place_poses(CUBE, IDENTITY, face(TargetRegion(name="table", x=(0.4, 0.6), y=(0.4, 0.6))), edge)
    assert max(pose.position[0] for pose in poses) <= 0.6 - 0.025 + 1e-9


def test_what_does_not_fit_is_refused_with_its_size_and_the_size_of_the_surface() -> None:
    small = [solid_meshes.move_mesh(CUBE[0], np.eye(3), np.array([0.15, 0.5, 0.865]))]
    top = upper_face(small, TargetRegion())
    large = [solid_meshes.box((0.1, 0.1, 0.05))]
    with pytest.raises(PlaceError) as fault:
        place_poses(large, IDENTITY, top, TargetRegion(), PlaceLimits(max_tilt_rad=0.1))
    assert "extends beyond the face of 0.050 x 0.050 m by at least 0.025 m" in str(fault.value)
    assert "allowed: 0 m" in str(fault.value)
    best = place_poses(large, IDENTITY, top, TargetRegion(), PlaceLimits(max_tilt_rad=0.1, overhang_m=0.03))[0]
    assert np.allclose(best.position, [0.15, 0.5, 0.89 + 0.025])


def block_below(turn_rad: float) -> list[TriangleMesh]:
    """A cube of 50 mm on the table at (0.15, 0.5), turned about the vertical."""
    rotation = Rotation.from_euler("z", turn_rad).as_matrix()
    return [solid_meshes.move_mesh(CUBE[0], rotation, np.array([0.15, 0.5, 0.865]))]


@pytest.mark.parametrize(("below", "held"), [(0.2, 0.9), (-0.7, 0.7), (0.0, math.pi / 4 - 0.01), (3.0, -3.0)])
def test_a_block_is_turned_by_the_least_angle_that_makes_its_edges_parallel_to_the_block_below(
    below: float, held: float
) -> None:
    top, grasped = upper_face(block_below(below), TargetRegion()), Rotation.from_euler("z", held)
    poses = place_poses(
        CUBE, grasped, top, TargetRegion(), PlaceLimits(max_tilt_rad=0.1, overhang_m=1e-6, aligned=True)
    )
    assert np.allclose(poses[0].position, [0.15, 0.5, 0.89 + 0.025])
    yaws = [pose.rotation.as_euler("zyx")[0] for pose in poses]
    assert len(yaws) == 4
    assert np.allclose(np.sin([2 * (yaw - below) for yaw in yaws]), 0.0, atol=1e-6)  # multiples of a quarter turn
    turn = (poses[0].rotation * grasped.inv()).magnitude()
    assert turn == pytest.approx(abs((below - held + math.pi / 4) % (math.pi / 2) - math.pi / 4), abs=1e-6)


def test_a_bar_lies_along_or_across_the_longest_edge_of_its_support() -> None:
    bar = [solid_meshes.box((0.04, 0.02, 0.02))]
    support = [
        solid_meshes.move_mesh(
            solid_meshes.box((0.1, 0.06, 0.02)), Rotation.from_euler("z", 0.5).as_matrix(), np.zeros(3)
        )
    ]
    limits = PlaceLimits(max_tilt_rad=0.1, aligned=True)
    best = place_poses(bar, Rotation.from_euler("z", 0.6), upper_face(support, TargetRegion()), TargetRegion(), limits)[
        0
    ]
    assert best.rotation.as_euler("zyx")[0] == pytest.approx(0.5)
    assert best.position[2] == pytest.approx(0.02)


def test_the_height_of_the_region_chooses_the_board_of_a_shelf() -> None:
    boards = [
        solid_meshes.move_mesh(solid_meshes.box((0.6, 0.3, 0.02)), np.eye(3), np.array([0, 0.5, z])) for z in (0.5, 0.9)
    ]
    assert upper_face(boards, TargetRegion()).height == pytest.approx(0.91)
    lower = TargetRegion(name="low", x=(-0.1, 0.1), y=(0.4, 0.6), z=(0.45, 0.7))
    assert upper_face(boards, lower).height == pytest.approx(0.51)
    assert place_poses(CUBE, IDENTITY, upper_face(boards, lower), lower)[0].position[2] == pytest.approx(0.535)
    with pytest.raises(PlaceError, match=r"centre of the object would be at z = 0\.935 m; allowed: 0\.45 to 0\.7 m"):
        place_poses(CUBE, IDENTITY, upper_face(boards, TargetRegion()), lower)
    with pytest.raises(
        PlaceError, match=r"no upper face below its centre; heights of the upper faces \[m\]: 0\.510, 0\.910"
    ):
        upper_face(boards, TargetRegion(name="far", x=(2.0, 2.1), y=(0.4, 0.6)))


def test_a_region_is_read_from_the_parameter_or_refused_with_the_known_ones() -> None:
    regions = {"goal": {"x": [0.1, 0.2], "y": [0.4, 0.6]}, "bin": {"x": [0.1, 0.2]}}
    assert read_region("goal", regions) == GOAL
    assert read_region("", regions) == TargetRegion()
    with pytest.raises(PlaceError, match="region 'gaol' does not exist; /regions has: bin, goal"):
        read_region("gaol", regions)
    with pytest.raises(PlaceError, match="/regions has: none"):
        read_region("goal", {})
    with pytest.raises(PlaceError, match=r"/regions/bin is .* allowed: spans"):
        read_region("bin", {"bin": {"x": [0.1, 0.2, 0.3]}})
