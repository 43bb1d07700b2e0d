# SPDX-License-Identifier: BSD-3-Clause
"""The voxel map does what OctoMap does, byte for byte, and its octree collides like the cubes it stands for.

octomap_reference.json was written by a program that uses the OctoMap library (1.9): looks at random points, the leaves
afterwards, and its own streams.
"""

from __future__ import annotations

import json
from pathlib import Path

import coal
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modular_framework_planning.errors import GeometryError
from modular_framework_planning.octomap.encoding import read_file, read_stream, write_binary, write_file, write_full
from modular_framework_planning.octomap.octree import Octree
from modular_framework_planning.octomap.voxel_map import HIGHEST, VoxelMap, cells_of_keys, empty_map

REFERENCE = json.loads((Path(__file__).parent / "octomap_reference.json").read_text())
NOTHING = np.empty((0, 3))


def value_at(voxels: VoxelMap, point: np.ndarray) -> float | None:
    """Log odds of the voxel a point (3,) [m] lies in; None where nothing is known."""
    found = np.flatnonzero(voxels.keys == voxels.keys_of_points(point[None])[0])
    return float(voxels.values[found[0]]) if len(found) else None


def keys_of_cells(cells: np.ndarray) -> np.ndarray:
    """Morton codes of voxels given by their three 16-bit numbers (n, 3): bit i of number k is bit 3i + k."""
    return sum(((cells[:, axis] >> bit) & 1) << (3 * bit + axis) for axis in range(3) for bit in range(16))


def looked() -> VoxelMap:
    voxels = empty_map(REFERENCE["resolution"])
    for cloud in REFERENCE["looks"]:
        voxels = voxels.with_point_cloud(np.array(cloud["origin"]), np.array(cloud["points"]), NOTHING, NOTHING)
    return voxels


def test_point_clouds_give_the_voxels_and_odds_that_octomap_has() -> None:
    voxels, leaves = looked(), np.array(REFERENCE["leaves"])
    cells = np.column_stack([cells_of_keys(voxels.keys), voxels.values])
    order, expected = np.lexsort(cells.T[:3]), np.lexsort(leaves.T[:3])
    assert np.array_equal(cells[order][:, :3], leaves[expected][:, :3])
    assert np.allclose(cells[order][:, 3], leaves[expected][:, 3], atol=1e-6)


def test_both_streams_are_octomaps_own_bytes() -> None:
    voxels = looked()
    assert write_full(voxels).hex() == REFERENCE["full_hex"]
    _, _, data = bytes.fromhex(REFERENCE["bt_file_hex"]).partition(b"\ndata\n")
    assert write_binary(voxels) == data


def test_a_file_of_octomap_is_read_and_a_written_one_says_the_same(tmp_path: Path) -> None:
    theirs, ours = tmp_path / "theirs.bt", tmp_path / "ours.bt"
    theirs.write_bytes(bytes.fromhex(REFERENCE["bt_file_hex"]))
    voxels = read_file(theirs)
    assert voxels.resolution == 0.1
    assert np.array_equal(voxels.occupied_keys, looked().occupied_keys)
    write_file(ours, voxels)
    fields = dict(line.split(b" ", 1) for line in ours.read_bytes().split(b"\ndata\n")[0].splitlines()[1:])
    assert fields[b"size"] in bytes.fromhex(REFERENCE["bt_file_hex"])[:200]
    assert np.array_equal(read_file(ours).keys, voxels.keys)
    assert not list(tmp_path.glob("ours.bt?*")), "no half-written file is left"


@settings(max_examples=60, deadline=None)
@given(
    st.dictionaries(
        st.tuples(*[st.integers(32750, 32790)] * 3), st.sampled_from([-2.0, -0.4, 0.85, 3.5]), min_size=1, max_size=300
    ),
    st.booleans(),
)
def test_a_map_survives_its_streams(cells: dict[tuple[int, int, int], float], full_block: bool) -> None:
    if full_block:  # 64 equal voxels that are pruned into one leaf
        cells |= {(32768 + x, 32768 + y, 32768 + z): 3.5 for x in range(4) for y in range(4) for z in range(4)}
    keys = keys_of_cells(np.array(list(cells), dtype=np.int64))
    order = np.argsort(keys)
    voxels = VoxelMap(0.05, keys[order], np.clip(np.array(list(cells.values()), np.float32)[order], -2.0, HIGHEST))
    full = read_stream(write_full(voxels), 0.05, binary=False)
    assert np.array_equal(full.keys, voxels.keys) and np.array_equal(full.values, voxels.values)
    binary = read_stream(write_binary(voxels), 0.05, binary=True)
    assert np.array_equal(binary.keys, voxels.keys)
    assert np.array_equal(binary.occupied_keys, voxels.occupied_keys)


def test_equal_neighbours_are_pruned_into_one_leaf() -> None:
    block = np.array([(32768 + x, 32768 + y, 32768 + z) for x in range(8) for y in range(8) for z in range(8)])
    voxels = VoxelMap(0.1, np.sort(keys_of_cells(block)), np.full(512, 3.5, np.float32))
    assert len(write_full(voxels)) == 5 * 14, "13 levels above a leaf of 8 x 8 x 8 voxels"


@pytest.mark.parametrize(
    ("data", "binary", "text"),
    [
        (b"abc", False, "multiple of the 5 bytes"),
        (b"abc", True, "multiple of the 2 bytes"),
        (b"\x00\x00\x00\x00\x01", False, "truncated"),
        (b"\xff\xff", True, "truncated"),
        (b"\x00\x00\x00\x00\x00" * 2, False, "after the end"),
        (b"\x03\x00" * 17, True, "deeper than 16"),
        (b"\x00\x00\x00\x00\x00", False, "at most 16000000"),
        (b"\x00\x00\xc0\x7f\x00", False, "not finite"),
    ],
)
def test_broken_streams_are_refused(data: bytes, binary: bool, text: str) -> None:
    with pytest.raises(GeometryError, match=text):
        read_stream(data, 0.1, binary)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"PNG", "starts with 'PNG'"),
        (b"# Octomap OcTree file\nid ColorOcTree\nsize 1\nres 0.1\ndata\n", "ColorOcTree"),
        (b"# Octomap OcTree file\nid OcTree\nsize 1\nres x\ndata\n", "numbers after"),
        (b"# Octomap OcTree file\nid OcTree\nsize 1\nres -1\ndata\n", "0.001"),
    ],
)
def test_files_that_are_no_maps_are_refused(tmp_path: Path, content: bytes, text: str) -> None:
    path = tmp_path / "map.bt"
    path.write_bytes(content)
    with pytest.raises(GeometryError, match=text):
        read_file(path)
    with pytest.raises(GeometryError, match="cannot be read"):
        read_file(tmp_path)


def test_a_ray_clears_what_it_goes_through_and_repeated_clouds_win() -> None:
    origin, wall, behind = np.zeros(3) + 0.01, np.array([[1.0, 0.02, 0.03]]), np.array([[2.0, 0.04, 0.06]])
    voxels = empty_map(0.1).with_point_cloud(origin, wall, NOTHING, NOTHING)
    assert value_at(voxels, wall[0]) > 0.0 > value_at(voxels, wall[0] / 2)
    assert value_at(voxels, behind[0]) is None
    for _ in range(3):
        voxels = voxels.with_point_cloud(origin, behind, NOTHING, NOTHING)
    assert value_at(voxels, wall[0]) < 0.0, "three clouds through it against one that hit it"
    assert value_at(voxels.with_point_cloud(origin, NOTHING, behind, NOTHING), behind[0]) < 0.0, "robot: free at once"
    assert value_at(voxels.with_point_cloud(origin, NOTHING, NOTHING, 2 * behind), behind[0]) == pytest.approx(
        value_at(voxels, behind[0]) - 0.405, abs=1e-3
    ), "rays that end beyond the range clear"


def test_points_beyond_the_tree_are_left_out_and_a_sensor_there_is_refused() -> None:
    far = np.array([[1.0e9, 0.0, 0.0], [np.nan, 0.0, 0.0]])
    assert len(empty_map(0.1).with_point_cloud(np.zeros(3), far, NOTHING, NOTHING).keys) == 0
    with pytest.raises(GeometryError, match="reaches 3277 m"):
        empty_map(0.1).with_point_cloud(far[0], NOTHING, NOTHING, NOTHING)
    with pytest.raises(GeometryError, match="resolution"):
        empty_map(0.0)


@pytest.mark.parametrize(
    "geometry",
    [
        coal.Box(0.1, 0.2, 0.3),
        coal.Sphere(0.1),
        coal.Cylinder(0.1, 0.3),
        coal.Cone(0.1, 0.3),
        coal.Plane(np.array([0.0, 0.0, 1.0]), 0.0),
    ],
    ids=["box", "sphere", "cylinder", "cone", "plane"],
)
@pytest.mark.parametrize("margin", [0.0, 0.03])
def test_the_octree_touches_what_one_of_its_cubes_touches(geometry: object, margin: float) -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.3, 0.3, (100, 3))
    octree = Octree(empty_map(0.05).with_point_cloud(np.full(3, 2.0), points, NOTHING, NOTHING))
    cube, here = coal.Box(0.05, 0.05, 0.05), coal.Transform3s.Identity()
    request, verdicts = coal.CollisionRequest(), []
    request.security_margin = margin

    def touch(first: object, at: object, second: object, place: object) -> bool:
        return bool(coal.collide(first, at, second, place, request, coal.CollisionResult()))

    for _ in range(60):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        place = coal.Transform3s(turn * np.sign(np.linalg.det(turn)), rng.uniform(-0.6, 0.6, 3))
        cubes = any(touch(cube, coal.Transform3s(np.eye(3), center), geometry, place) for center in octree.centers)
        assert touch(octree.geometry, here, geometry, place) == cubes
        verdicts.append(cubes)
    assert 5 < sum(verdicts) < 60
