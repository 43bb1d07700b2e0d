# SPDX-License-Identifier: BSD-3-Clause
"""Cameras see what is there: where a pinhole projects it, at the depth it is, in the right colour."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.visual_meshes import VisualMeshes
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState, Twist
from modular_framework_simulation.sensors import drawing_choice
from modular_framework_simulation.sensors.cameras import OPTICAL_IN_BODY, Camera, CameraImage, CameraTopics, Pinhole
from modular_framework_simulation.sensors.renderer import Drawing, Renderer
from modular_framework_simulation.sensors.visible_scene import SceneTracker
from modular_framework_testing.simulation.simulated_samples import solid
from modular_framework_urdf.rotations import rotate_vector

LOOKING_DOWN = (1.0, 0.0, 0.0, 0.0)
RED = (0.9, 0.0, 0.0, 1.0)
SIDE = 0.2


def visible(name: str, geometry: specs.Geometry, pose: Pose, colour: tuple[float, ...] = RED) -> specs.Model:
    """A model that does not move, of one shape that is seen."""
    model = solid(name, geometry, pose, static=True)
    visual = specs.Visual("visual", Pose(), geometry, (colour[0], colour[1], colour[2], colour[3]))
    link = specs.Link("link", Pose(), model.links[0].inertial, model.links[0].collisions, (visual,))
    return specs.Model(name, pose, True, (link,), (), "test")


def camera(pose: Pose, parent: str = "world", pinhole: Pinhole | None = None) -> Camera:
    """A camera at a pose of its optical frame."""
    return Camera(
        name="camera",
        frame_id="optical",
        parent=parent,
        optical_in_parent=pose,
        rate_hz=10.0,
        topics=CameraTopics(),
        pinhole=pinhole or Pinhole(far=5.0),
    )


@pytest.fixture(params=list(Drawing), ids=lambda drawing: drawing.name)
def renderer(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Renderer]:
    """A renderer of each kind."""
    try:
        renderer = Renderer(request.param, VisualMeshes(tmp_path), print)
    except SimulationError as error:
        pytest.skip(str(error))
    yield renderer
    renderer.close()


@pytest.fixture
def empty(make_world: Callable[[], PhysicsWorld]) -> PhysicsWorld:
    """A world in which nothing is seen."""
    return make_world()


def test_the_renderer_is_resolved_by_what_works_and_not_by_how_long_it_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    for code, resolved in ((0, Drawing.EGL), (1, Drawing.TINY), (-11, Drawing.TINY)):
        done = SimpleNamespace(returncode=code)
        monkeypatch.setattr(drawing_choice.subprocess, "run", lambda *_, done=done, **__: done)
        assert drawing_choice.resolved_drawing("auto") is resolved
        assert drawing_choice.resolved_drawing("opengl") is Drawing.EGL
        assert drawing_choice.resolved_drawing("tiny") is Drawing.TINY


def test_the_trial_of_opengl_succeeds_where_opengl_draws(tmp_path: Path) -> None:
    try:
        Renderer(Drawing.EGL, VisualMeshes(tmp_path), print).close()
    except SimulationError as error:
        pytest.skip(str(error))
    assert drawing_choice.main() == 0


def look(world: PhysicsWorld, renderer: Renderer, viewer: Camera, tracker: SceneTracker | None = None) -> Any:
    """What a camera sees of a world."""
    update = (tracker or SceneTracker(world, {})).update([viewer])
    renderer.apply(update)
    return renderer.image(viewer.pinhole, update.cameras[viewer.name])


def projected(pinhole: Pinhole, optical_in_world: Pose, point: tuple[float, float, float]) -> tuple[float, float]:
    """Column and row of a point by the matrix K, as users of camera_info compute it [pixel]."""
    back = optical_in_world.inverse()
    in_optical = np.array(rotate_vector(back.quaternion, point)) + back.position
    column, row, scale = np.array(pinhole.intrinsics()).reshape(3, 3) @ in_optical
    return column / scale, row / scale


def measured_edge(seen: Any, begin: Any, end: Any) -> Any:
    """Two points of the border of what is seen, near the expected edge (begin, end) of an outline [pixel].

    The border is as far from the expected edge as the number of pixels beyond it says, in each half of the edge.
    """
    along = (end - begin) / np.linalg.norm(end - begin)
    outwards = np.array([along[1], -along[0]])
    rows, columns = np.nonzero(seen)
    pixels = np.column_stack([columns, rows]) - begin
    share, height, reach = pixels @ along / np.linalg.norm(end - begin), pixels @ outwards, 6.0
    points = []
    for low, high in ((0.15, 0.5), (0.5, 0.85)):
        counted = np.sum((share >= low) & (share < high) & (np.abs(height) < reach))
        offset = counted / ((high - low) * np.linalg.norm(end - begin)) - reach
        points.append(begin + (end - begin) * (low + high) / 2 + outwards * offset)
    return points


def intersection(one: Any, other: Any) -> Any:
    """Where two lines meet, each given by two points."""
    (a, b), (c, d) = one, other
    steps = np.linalg.solve(np.column_stack([b - a, c - d]), c - a)
    return a + (b - a) * steps[0]


@pytest.mark.parametrize("seed", range(3))
def test_corners_of_a_cube_are_seen_where_the_intrinsics_project_them(
    empty: PhysicsWorld, renderer: Renderer, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    cube = Pose.from_xyz_rpy((0.05, -0.03, 0.1), (0.0, 0.0, float(rng.uniform(0, 1.5))))
    empty.spawn(visible("cube", specs.Box((SIDE, SIDE, SIDE)), cube))
    lean = tuple(float(value) for value in rng.uniform(-0.2, 0.2, 3))
    eye = Pose((0.0, 0.0, 1.1), LOOKING_DOWN) @ Pose.from_xyz_rpy((0.0, 0.0, 0.0), (lean[0], lean[1], lean[2]))
    viewer = camera(eye)
    seen = ~np.isnan(look(empty, renderer, viewer).depth)
    corners = [cube @ Pose(each) for each in itertools.product((-SIDE / 2, SIDE / 2), repeat=3)]
    expected = np.array([projected(viewer.pinhole, eye, corner.position) for corner in corners])
    outline = expected[ConvexHull(expected).vertices]
    edges = [measured_edge(seen, *pair) for pair in zip(outline, np.roll(outline, -1, axis=0), strict=True)]
    for corner, before, after in zip(outline, edges[-1:] + edges[:-1], edges, strict=True):
        assert np.linalg.norm(intersection(before, after) - corner) < 1.0


SMALL = Pinhole(320, 240, 1.1)


def rays(pinhole: Pinhole) -> Any:
    """Directions of the pixels' centres by the matrix K, (height, width, 3), z = 1."""
    column, row = np.meshgrid(np.arange(pinhole.width), np.arange(pinhole.height))
    pixels = np.stack([column, row, np.ones_like(column)], axis=-1)
    return pixels @ np.linalg.inv(np.array(pinhole.intrinsics()).reshape(3, 3)).T


@pytest.mark.parametrize("axis", [0, 1])
def test_an_oblique_plane_is_seen_where_the_rays_of_the_pixels_meet_it(
    empty: PhysicsWorld, renderer: Renderer, axis: int
) -> None:
    distance, slope = 3.6, 0.9
    normal = np.array([0.0, 0.0, -math.cos(slope)])
    normal[axis] = math.sin(slope)
    wall = specs.Plane((float(normal[0]), float(normal[1]), float(normal[2])), (40.0, 40.0))
    empty.spawn(visible("wall", wall, Pose((0.0, 0.0, distance))))
    depth = look(empty, renderer, camera(Pose(), pinhole=SMALL)).depth
    expected = normal[2] * distance / (rays(SMALL) @ normal)
    near = np.abs(expected - distance) < 0.5
    per_pixel = np.gradient(expected, axis=1 - axis)
    assert abs(float(np.median((depth - expected)[near] / per_pixel[near]))) < 0.06  # [pixel]
    assert np.abs(depth - expected)[near].max() < 0.004  # half of what OpenGL's depth buffer resolves there


def test_a_sphere_is_seen_where_the_rays_of_the_pixels_meet_it(empty: PhysicsWorld, renderer: Renderer) -> None:
    centre, radius = np.array([0.1, 0.07, 2.0]), 0.3
    empty.spawn(visible("ball", specs.Sphere(radius), Pose((0.1, 0.07, 2.0))))
    image = look(empty, renderer, camera(Pose(), pinhole=SMALL))
    ray = rays(SMALL)
    along, square = ray @ centre, np.sum(ray**2, axis=-1)
    root = along**2 - square * (centre @ centre - radius**2)
    hit = root > 0.0
    expected = (along - np.sqrt(np.where(hit, root, np.nan))) / square
    seen = ~np.isnan(image.depth)
    red = image.rgb[..., 0] > 2.0 * image.rgb[..., 1]
    for found in (seen, red):
        assert np.abs(np.argwhere(found).mean(axis=0) - np.argwhere(hit).mean(axis=0)).max() < 0.1  # [pixel]
        assert found.sum() == pytest.approx(hit.sum(), rel=0.01)
    inside = seen & (root > 0.1 * np.nanmax(root))  # where depth is not too steep
    assert np.abs(image.depth - expected)[inside].max() < 0.004


@pytest.mark.parametrize("distance", [0.5, 1.0, 2.72])
def test_depth_is_that_of_the_surface(empty: PhysicsWorld, renderer: Renderer, distance: float) -> None:
    empty.spawn(visible("wall", specs.Plane((0.0, 0.0, 1.0), (10.0, 10.0)), Pose()))
    depth = look(empty, renderer, camera(Pose((0.0, 0.0, distance), LOOKING_DOWN))).depth
    assert np.abs(depth - distance).max() < 0.002


def test_planes_of_the_cloud_are_those_of_the_world(empty: PhysicsWorld, renderer: Renderer) -> None:
    empty.spawn(visible("ground", specs.Plane((0.0, 0.0, 1.0), (20.0, 20.0)), Pose()))
    empty.spawn(visible("cube", specs.Box((SIDE, SIDE, SIDE)), Pose((0.0, 0.0, SIDE / 2))))
    eye = Pose.from_xyz_rpy((-0.8, 0.1, 0.7), (0.0, 0.7, 0.0)) @ OPTICAL_IN_BODY
    viewer = camera(eye)
    image = look(empty, renderer, viewer)
    cloud = viewer.pinhole.cloud(image.depth, image.rgb)
    points = np.column_stack([cloud[axis][~np.isnan(image.depth)] for axis in "xyz"]).astype(float)
    world = np.array([rotate_vector(eye.quaternion, (float(x), float(y), float(z))) for x, y, z in points[::97]])
    world += eye.position
    near = np.linalg.norm(points[::97], axis=1) < 1.5
    off_cube = np.max(np.abs(world - (0.0, 0.0, SIDE / 2)), axis=1) - SIDE / 2
    assert np.minimum(np.abs(world[:, 2]), np.abs(off_cube))[near].max() < 0.002
    assert np.sum(np.abs(off_cube) < 0.002) > 20


def test_colours_are_those_of_the_shapes_and_their_points(empty: PhysicsWorld, renderer: Renderer) -> None:
    empty.spawn(visible("left", specs.Box((0.2, 0.4, 0.1)), Pose((-0.2, 0.0, 0.0)), (0.9, 0.0, 0.0, 1.0)))
    empty.spawn(visible("right", specs.Box((0.2, 0.4, 0.1)), Pose((0.2, 0.0, 0.0)), (0.0, 0.0, 0.9, 1.0)))
    viewer = camera(Pose((0.0, 0.0, 1.0), LOOKING_DOWN))
    image = look(empty, renderer, viewer)
    row, left, right = 240, 200, 440
    assert image.rgb[row, left].argmax() == 0
    assert image.rgb[row, right].argmax() == 2
    cloud = viewer.pinhole.cloud(image.depth, image.rgb)
    assert cloud["rgb"][row, left] >> 16 == image.rgb[row, left, 0] > 100
    assert cloud["rgb"][row, right] & 0xFF == image.rgb[row, right, 2] > 100
    assert cloud["x"][row, left] < 0 < cloud["x"][row, right]


def test_a_mesh_is_drawn_in_its_size_and_colour(empty: PhysicsWorld, renderer: Renderer, tmp_path: Path) -> None:
    import trimesh

    file = tmp_path / "block.stl"
    trimesh.creation.box((200.0, 200.0, 200.0)).export(file)
    empty.spawn(visible("block", specs.Mesh(file, (0.001, 0.001, 0.001)), Pose(), (0.0, 0.0, 0.9, 1.0)))
    image = look(empty, renderer, camera(Pose((0.0, 0.0, 1.0), LOOKING_DOWN)))
    assert image.depth[240, 320] == pytest.approx(0.9, abs=0.002)
    assert image.rgb[240, 320].argmax() == 2
    assert np.sum(~np.isnan(image.depth[240])) == pytest.approx(0.2 / 0.9 * Pinhole().focal_length, abs=2)


def test_what_moves_appears_and_goes_is_followed(empty: PhysicsWorld, renderer: Renderer) -> None:
    tracker, viewer = SceneTracker(empty, {}), camera(Pose((0.0, 0.0, 1.0), LOOKING_DOWN))
    assert np.isnan(look(empty, renderer, viewer, tracker).depth).all()
    empty.spawn(visible("cube", specs.Box((SIDE, SIDE, SIDE)), Pose((0.0, 0.0, 0.1))))
    assert look(empty, renderer, viewer, tracker).depth[240, 320] == pytest.approx(0.8, abs=0.002)
    empty.set_state("cube", BodyState(Pose((0.0, 0.0, 0.3)), Twist()))
    assert look(empty, renderer, viewer, tracker).depth[240, 320] == pytest.approx(0.6, abs=0.002)
    empty.delete("cube")
    assert np.isnan(look(empty, renderer, viewer, tracker).depth).all()


def test_a_camera_on_a_model_moves_along(empty: PhysicsWorld, renderer: Renderer) -> None:
    empty.spawn(visible("ground", specs.Plane((0.0, 0.0, 1.0), (20.0, 20.0)), Pose()))
    empty.spawn(solid("carrier", specs.Box((0.1, 0.1, 0.1)), Pose((0.0, 0.0, 1.0)), static=True))
    viewer = camera(Pose((0.0, 0.0, 0.0), LOOKING_DOWN), "carrier::link")
    assert look(empty, renderer, viewer).depth[240, 320] == pytest.approx(1.0, abs=0.002)
    empty.set_state("carrier", BodyState(Pose((0.0, 0.0, 1.5)), Twist()))
    tracker = SceneTracker(empty, {})
    assert tracker.update([viewer]).cameras["camera"].position[2] == pytest.approx(1.5)
    empty.delete("carrier")
    assert tracker.update([viewer]).cameras == {}


def test_what_does_not_move_is_not_sent_again(empty: PhysicsWorld) -> None:
    empty.spawn(visible("wall", specs.Box((1.0, 1.0, 1.0)), Pose()))
    tracker = SceneTracker(empty, {})
    number = empty.instance("wall")
    assert number in tracker.update([]).added
    empty.step()
    assert number not in tracker.update([]).poses
    empty.set_state("wall", BodyState(Pose((1.0, 0.0, 0.0)), Twist()))
    assert tracker.update([]).poses[number][0].position[0] == pytest.approx(1.0)


def test_depth_outside_the_range_is_no_number() -> None:
    image = CameraImage(np.zeros((1, 4, 3), np.uint8), np.array([[0.3, 0.5, 2.0, np.nan]], np.float32))
    kept = image.with_depth_range((0.4, 1.0)).depth
    assert np.isnan(kept).tolist() == [[True, False, True, True]]


@pytest.mark.parametrize(
    ("key", "pinhole"),
    [
        ("width", Pinhole(width=0)),
        ("height", Pinhole(height=100_000)),
        ("horizontal_fov", Pinhole(horizontal_fov=math.pi)),
        ("near", Pinhole(near=0.0)),
        ("near", Pinhole(near=0.1, far=0.1)),
        ("far", Pinhole(far=math.inf)),
        ("near", Pinhole(near=math.nan)),
    ],
)
def test_a_camera_that_cannot_be_is_refused_with_the_reason(key: str, pinhole: Pinhole) -> None:
    with pytest.raises(ValueError, match=rf"{key}: got .*allowed"):
        camera(Pose(), pinhole=pinhole)
