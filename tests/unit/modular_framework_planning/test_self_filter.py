# SPDX-License-Identifier: BSD-3-Clause
"""Depth images and clouds become points at the right positions; the robot and known objects are filtered out."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import coal
import numpy as np
import pinocchio as pin
import pytest
import rospy

from modular_framework_planning.errors import GeometryError, PlanningError
from modular_framework_planning.geometry.shapes import Box, Cone, Cylinder, Mesh, Plane, Sphere
from modular_framework_planning.move_group.monitors.joint_history import JointHistory
from modular_framework_planning.move_group.monitors.octomap_monitor import OctomapMonitor
from modular_framework_planning.perception.depth_images import (
    Pinhole,
    SeenPoints,
    cloud_array,
    depth_array,
    points_of_cloud,
    points_of_depth,
)
from modular_framework_planning.perception.self_filter import (
    DEPTH_NOISE,
    RegionCache,
    SelfFilter,
    bodies_in_scene,
    depth_self_filter,
    self_filter_of,
)
from modular_framework_planning.perception.sensor_settings import DepthImageSettings, PointCloudSettings, read_sensors
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel

CAMERA = Pinhole(100.0, 100.0, 31.5, 23.5)
CUBE = Mesh(
    np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * 0.1,
    np.array(
        [
            [0, 1, 3],
            [0, 3, 2],
            [4, 6, 7],
            [4, 7, 5],
            [0, 4, 5],
            [0, 5, 1],
            [2, 3, 7],
            [2, 7, 6],
            [0, 2, 6],
            [0, 6, 4],
            [1, 5, 7],
            [1, 7, 3],
        ]
    ),
)


def test_a_box_in_front_of_a_camera_is_where_the_pixels_say() -> None:
    depth = np.full((48, 64), np.inf)
    depth[20:28, 30:40] = 1.5
    depth[0, 0], depth[47, 63], depth[10, 10] = np.nan, 0.1, 0.0
    seen = points_of_depth(depth, CAMERA, 0.3, 5.0, (0, 0))
    assert len(seen.ends) == 80 and len(seen.beyond) == depth.size - 83
    assert np.allclose(seen.ends.min(axis=0), [1.5 * (30 - 31.5) / 100, 1.5 * (20 - 23.5) / 100, 1.5])
    assert np.allclose(depth.ravel()[seen.pixels], seen.ends[:, 2])
    assert np.allclose(seen.beyond[:, 2], 5.0), "rays without an end clear up to the far plane"
    assert len(points_of_depth(depth, CAMERA, 0.3, 5.0, (24, 0)).ends) == 0


@pytest.mark.parametrize("big_endian", [False, True])
def test_millimetres_and_metres_and_padded_rows_are_read(big_endian: bool) -> None:
    order = ">" if big_endian else "<"
    millimetres = np.zeros((2, 4), order + "u2")
    millimetres[:, :3] = [[1000, 0, 2500], [1, 2, 3]]
    assert np.allclose(
        depth_array(millimetres.tobytes(), "16UC1", (2, 3), 8, big_endian), [[1.0, 0.0, 2.5], [0.001, 0.002, 0.003]]
    )
    metres = np.array([[0.5, np.nan]], order + "f4")
    assert np.array_equal(
        depth_array(metres.tobytes(), "32FC1", (1, 2), 8, big_endian), [[0.5, np.nan]], equal_nan=True
    )
    with pytest.raises(GeometryError, match="rgb8"):
        depth_array(b"", "rgb8", (1, 1), 3, False)
    with pytest.raises(GeometryError, match="need 8"):
        depth_array(b"1234", "16UC1", (2, 2), 4, False)
    with pytest.raises(GeometryError, match="calibrate the camera"):
        Pinhole(0.0, 0.0, 0.0, 0.0)


def cloud_message(points: np.ndarray, **changes: object) -> SimpleNamespace:
    item = np.dtype([("rgb", "<f4"), ("x", "<f4"), ("y", "<f8"), ("z", "<f4")])
    rows = np.zeros(points.shape[:2], item)
    for number, name in enumerate("xyz"):
        rows[name] = points[..., number]
    fields = [
        SimpleNamespace(name=name, offset=item.fields[name][1], datatype=8 if name == "y" else 7) for name in item.names
    ]
    values = {
        "height": points.shape[0],
        "width": points.shape[1],
        "fields": fields,
        "is_bigendian": False,
        "point_step": item.itemsize,
        "row_step": item.itemsize * points.shape[1],
        "data": rows.tobytes(),
    }
    return SimpleNamespace(**{**values, **changes})


def test_clouds_are_read_field_by_field_and_thinned_out() -> None:
    points = np.arange(4 * 6 * 3, dtype=float).reshape(4, 6, 3) / 10
    points[0, 0] = np.nan
    cloud = cloud_array(cloud_message(points))
    assert np.allclose(cloud, points, atol=1e-6, equal_nan=True)
    seen = points_of_cloud(cloud, 5.0, 2)
    assert len(seen.ends) + len(seen.beyond) == 5, "2 x 3 points, one not finite"
    assert np.allclose(np.linalg.norm(seen.beyond, axis=1), 5.0)
    with pytest.raises(GeometryError, match="field x is missing"):
        cloud_array(cloud_message(points, fields=cloud_message(points).fields[2:]))
    with pytest.raises(GeometryError, match="need"):
        cloud_array(cloud_message(points, data=b"12"))
    assert cloud_array(cloud_message(np.empty((0, 0, 3)))).shape == (0, 0, 3)


@pytest.mark.parametrize(
    "shape",
    [Box(0.2, 0.3, 0.4), Sphere(0.15), Cylinder(0.4, 0.1), Cone(0.4, 0.1), CUBE],
    ids=lambda shape: type(shape).__name__,
)
@pytest.mark.parametrize("padding", [0.0, 0.05])
def test_a_region_holds_all_of_the_padded_shape_and_little_more(shape: object, padding: float) -> None:
    rng = np.random.default_rng(1)
    pose = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.8, 1.2), np.array([0.5, -0.2, 1.0]))
    mask = self_filter_of(RegionCache(), [(shape.geometry, pose)], 1.0, padding)
    points = pose.translation + rng.uniform(-0.4, 0.4, (1500, 3))
    solid = coal.Box(0.2, 0.2, 0.2) if shape is CUBE else shape.geometry
    place, point = coal.Transform3s(pose.rotation, pose.translation), coal.Sphere(1.0e-6)
    distances = np.array(
        [
            coal.distance(
                solid, place, point, coal.Transform3s(np.eye(3), at), coal.DistanceRequest(), coal.DistanceResult()
            )
            for at in points
        ]
    )
    hidden = mask.hides(points, np.zeros(3))
    assert hidden[distances <= padding - 1e-4].all()
    assert not hidden[distances > 1.8 * padding + 0.02].any()
    assert 0 < hidden.sum() < len(points)


def test_what_lies_just_behind_a_body_is_its_shadow() -> None:
    ball = Sphere(0.1).geometry, pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
    mask = self_filter_of(RegionCache(), [ball], 1.0, 0.0)
    line = np.column_stack([np.array([0.85, 0.95, 1.05, 1.15, 1.25]), np.zeros((5, 2))])
    assert mask.hides(line, np.zeros(3)).tolist() == [False, True, True, False, False]
    assert mask.hides(line, np.zeros(3), shadow=0.1).tolist() == [False, True, True, True, False]
    assert mask.hides(line, np.array([3.0, 0.0, 0.0]), shadow=0.1).tolist() == [True, True, True, False, False]


def test_depth_noise_grows_with_the_square_of_the_distance() -> None:
    body = [(Sphere(0.1).geometry, pin.SE3(np.eye(3), np.array([0.0, 0.0, 2.9])))]
    mask = depth_self_filter(RegionCache(), body, np.zeros(3), 4.0, 0.03)
    assert mask.spheres[0, 3] == pytest.approx(0.1 + 0.03 + 4.0 * DEPTH_NOISE * 9.0)


def test_links_and_objects_are_masked_and_planes_are_not(model: RobotModel) -> None:
    scene = empty_scene(model)
    turned = model.merge(scene.positions, {"shoulder_pan_joint": 1.0})
    wall = CollisionObject(
        "wall",
        pin.SE3(np.eye(3), np.array([3.0, 0, 0])),
        ((Box(0.1, 1, 1), pin.SE3.Identity()), (Plane(0, 0, 1, 0), pin.SE3.Identity())),
    )
    bodies = bodies_in_scene(scene.with_object(wall), turned)
    assert len(bodies) == len(model.link_geometries) + 1
    mask = self_filter_of(RegionCache(), bodies, 1.0, 0.0)
    points = np.vstack([[3.0, 0.3, 0.3], [3.0, 0.3, 2.0]])
    assert mask.hides(points, np.zeros(3)).tolist() == [True, False]
    for item, (_, pose) in zip(model.link_geometries, bodies, strict=False):
        link = model.link_transforms(turned)[item.link]
        expected = link * model.pin_model.frames[item.frame_id].placement.actInv(item.placement)
        assert np.allclose(pose.homogeneous, expected.homogeneous)


def test_sensors_are_read_as_moveit_writes_them_and_faults_are_named() -> None:
    cloud = {
        "sensor_plugin": "occupancy_map_monitor/PointCloudOctomapUpdater",
        "point_cloud_topic": "/points",
        "padding_offset": 0.1,
        "point_subsample": 2,
        "filtered_cloud_topic": "left",
        "ns": "kinect",
    }
    image = {
        "sensor_plugin": "occupancy_map_monitor/DepthImageOctomapUpdater",
        "image_topic": "/depth",
        "shadow_threshold": 0.2,
        "padding_scale": 4.0,
        "queue_size": 3,
        "sensor_type": "kinect",
    }
    off = {"sensor_plugin": "~occupancy_map_monitor/DepthImageOctomapUpdater"}
    sensors, faults = read_sensors([cloud, image, off, {}], 2.5)
    assert sensors == [
        PointCloudSettings("/points", 2.5, 2, 0.1, filtered_cloud_topic="left", ns="kinect"),
        DepthImageSettings("/depth", 3, shadow_threshold=0.2, padding_scale=4.0),
    ]
    assert not faults
    wrong = [
        {"sensor_plugin": "x"},
        {**cloud, "max_rang": 1},
        {**cloud, "max_range": "far"},
        {**cloud, "point_subsample": 0},
        {**cloud, "point_cloud_topic": ""},
        "cloud",
    ]
    sensors, faults = read_sensors(wrong, None)
    assert not sensors
    for fault, text in zip(
        faults,
        [
            "supported plugins: occupancy",
            "unknown key 'max_rang'",
            "type float",
            "at least 1",
            "point_cloud_topic is missing",
            "str",
        ],
        strict=True,
    ):
        assert text in fault
    assert read_sensors({}, None)[1]


def test_joints_are_remembered_and_interpolated() -> None:
    history = JointHistory(np.array([False]))
    with pytest.raises(PlanningError, match="none"):
        history.positions_at(1.0)
    for stamp, value in ((10.0, 0.0), (10.1, 1.0), (10.1, 2.0), (10.3, 4.0)):
        history.add(stamp, np.array([value]))
    assert history.positions_at(10.05) == pytest.approx(1.0) and history.positions_at(10.2) == pytest.approx(3.0)
    assert history.has_reached(10.3) and not history.has_reached(10.4)
    for stamp in (9.0, 10.4):
        with pytest.raises(PlanningError, match="10.000 to 10.300"):
            history.positions_at(stamp)
    history.add(1.0, np.array([7.0]))
    assert history.positions_at(1.0) == 7.0, "a clock that was set back begins anew"


def test_a_joint_without_ends_that_jumps_by_a_turn_was_never_half_a_turn_away() -> None:
    history = JointHistory(np.array([True, False]))
    for stamp, value in ((1.0, 3.1), (2.0, -3.1)):
        history.add(stamp, np.array([value, value]))
    endless, bounded = history.positions_at(1.5)
    assert np.cos(endless) == pytest.approx(-1.0) and bounded == 0.0


def test_a_filter_keeps_no_geometry_of_objects_that_are_gone(model: RobotModel) -> None:
    """Needs no master: whatever is asked of the scene monitor is answered here."""
    scene, caches = empty_scene(model), []

    def mask(cache: RegionCache, bodies: Sequence[object], _: np.ndarray) -> SelfFilter:
        caches.append(cache)
        return self_filter_of(cache, bodies, 1.0, 0.0)

    monitor = SimpleNamespace(
        model=model, positions_at=lambda *_: scene.positions, snapshot=lambda: seen, apply=lambda change: change(seen)
    )
    octomap, looked = OctomapMonitor(monitor), SeenPoints(np.full((1, 3), 3.0), np.empty((0, 3)))
    for number in range(5):
        thing = CollisionObject("thing", pin.SE3.Identity(), ((Box(0.1, 0.1, 1.0 + number), pin.SE3.Identity()),))
        seen = scene.with_object(thing)
        octomap.insert_point_cloud("", rospy.Time(1), looked, mask)
    seen = scene
    octomap.insert_point_cloud("", rospy.Time(1), looked, mask)
    assert len(caches[-1]) == len(model.link_geometries)
