# SPDX-License-Identifier: BSD-3-Clause
"""Updates of the scene's octomap from depth sensors, and services to save and load the octomap."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import rospy
from moveit_msgs.srv import LoadMap, LoadMapResponse, SaveMap, SaveMapResponse

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform, make_transform
from modular_framework_planning.messages.octomap_conversions import voxels_of
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.markers.octomap_markers import OctomapMarkers
from modular_framework_planning.move_group.monitors.octomap_updaters import updater_of
from modular_framework_planning.move_group.monitors.scene_monitor import SceneMonitor
from modular_framework_planning.move_group.node_parameters import parameter
from modular_framework_planning.octomap.encoding import read_file, write_file
from modular_framework_planning.octomap.octree import Octree
from modular_framework_planning.octomap.voxel_map import VoxelMap, empty_map
from modular_framework_planning.perception.depth_images import SeenPoints
from modular_framework_planning.perception.self_filter import (
    FilterMaker,
    RegionCache,
    SelfFilter,
    bodies_in_scene,
    self_filter_of,
)
from modular_framework_planning.perception.sensor_settings import read_sensors
from modular_framework_planning.planning_scene.planning_scene import PlanningScene

DEFAULT_RESOLUTION = 0.1  # [m]
ATTEMPTS = 3
WAIT_S = 1.0  # wait for transforms and joint positions at the time of a sensor message


class OctomapMonitor:
    """Inserts sensor data into the octomap of the scene, which is the only copy of the map.

    Parameters: ~octomap_resolution (0.1 m), ~octomap_frame (planning frame), ~max_range (default for clouds), ~sensors
    (list, see perception/sensor_settings).
    Publishes: ~octomap_markers (MarkerArray).
    Services: ~save_map (SaveMap), ~load_map (LoadMap) for .bt files; only octomap files are overwritten.
    """

    def __init__(self, monitor: SceneMonitor) -> None:
        self._monitor = monitor
        self._regions = RegionCache()
        self._resolution = DEFAULT_RESOLUTION
        self._frame = ""
        self._transforms: Any = None
        self._known_bodies: dict[str, Any] = {}

    def connect(self) -> None:
        """Reads the parameters, subscribes to the sensors and advertises the services."""
        self._resolution = empty_map(parameter("~octomap_resolution")).resolution
        self._frame = parameter("~octomap_frame")
        sensors, faults = read_sensors(parameter("~sensors"), parameter("~max_range"))
        for fault in faults:
            rospy.logerr("%s: this sensor is ignored", fault)
        self._monitor.listeners.append(OctomapMarkers().show)
        rospy.Service(names.SAVE_MAP_SERVICE, SaveMap, self._save)
        rospy.Service(names.LOAD_MAP_SERVICE, LoadMap, self._load)
        if not sensors:
            return
        import tf2_ros

        self._transforms = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._transforms)
        self._monitor.listeners.append(self.free_new_objects)
        _compile_loops()
        for settings in sensors:
            updater_of(settings, self.insert_point_cloud).connect()

    def insert_point_cloud(
        self, frame: str, stamp: rospy.Time, seen: SeenPoints, make_filter: FilterMaker, shadow: float = 0.0
    ) -> Array:
        """Inserts one point cloud of a sensor into the map.

        Args:
            frame: Frame of the points.
            stamp: Time of the measurement, at which the poses of robot and sensor are looked up.
            seen: Points in the sensor's frame.
            make_filter: Function that builds the self filter from bodies and the sensor's position.
            shadow: Maximum distance of a point behind a known body that still belongs to the body [m].

        Returns:
            Whether each point within range lies on the robot or on a known object, shape (n,).

        Raises:
            PlanningError: The pose of sensor or robot is unknown, or the map changes too often.
        """
        positions = self._monitor.positions_at(stamp.to_sec(), WAIT_S)
        sensor = self._pose_in_planning_frame(frame, stamp, positions)
        into_map = self._pose_in_planning_frame(self._frame, stamp, positions)
        ends, beyond = (points @ sensor.rotation.T + sensor.translation for points in (seen.ends, seen.beyond))
        origin, clipped = (
            _transformed_points(into_map, sensor.translation[None])[0],
            _transformed_points(into_map, beyond),
        )
        for _ in range(ATTEMPTS):
            scene = self._monitor.snapshot()
            bodies = bodies_in_scene(scene, positions)
            self._regions.keep_only(geometry for geometry, _ in bodies)
            known = make_filter(self._regions, bodies, sensor.translation)
            hidden = np.asarray(known.hides(ends, sensor.translation, shadow))
            hits, masked = _transformed_points(into_map, ends[~hidden]), _transformed_points(into_map, ends[hidden])
            voxels = self._map(scene, into_map).with_point_cloud(origin, hits, masked, clipped)
            if self._replace(scene, voxels, into_map):
                return hidden
        raise PlanningError(
            ErrorCode.FAILURE,
            f"octomap: the map changed during each of {ATTEMPTS} attempts to insert a point cloud; "
            "change the map less often, or use larger voxels (octomap_resolution)",
        )

    def _map(self, scene: PlanningScene, pose: Transform) -> VoxelMap:
        """Returns the scene's map, or an empty map if frame or resolution differ or the scene has no map."""
        voxels = voxels_of(scene)
        if (
            voxels is None
            or voxels.resolution != self._resolution
            or scene.octomap is None
            or not np.allclose(scene.octomap.pose.homogeneous, pose.homogeneous, atol=1.0e-9)
        ):
            return empty_map(self._resolution)
        return voxels

    def _replace(self, base: PlanningScene, voxels: VoxelMap, pose: Transform) -> bool:
        """Inserts an updated map into the current scene; bodies added meanwhile are freed in the map afterwards.

        Returns:
            False if the map has changed meanwhile; a map cleared meanwhile stays cleared and counts as success.
        """
        octree = Octree(voxels)
        if len(octree.centers):
            octree.geometry  # noqa: B018 - built here, so that planning requests need not wait
        is_done = []

        def change(scene: PlanningScene) -> PlanningScene:
            cleared = scene.octomap is None and base.octomap is not None
            same = scene.octomap is base.octomap
            if scene.objects is not base.objects or scene.attached is not base.attached:
                self._known_bodies = {}
            is_done.append(cleared or same)
            return scene.with_octomap(octree, pose) if same else scene

        self._monitor.apply(change)
        return is_done[0]

    def free_new_objects(self, scene: PlanningScene) -> None:
        """Frees the voxels inside objects that are new in the scene."""
        bodies = {**scene.objects, **scene.attached}
        new_objects = [name for name, body in bodies.items() if self._known_bodies.get(name) is not body]
        self._known_bodies = bodies
        voxels = voxels_of(scene)
        if not new_objects or voxels is None or scene.octomap is None:
            return
        objects = bodies_in_scene(scene, scene.positions)[len(scene.model.link_geometries) :]
        known = self_filter_of(self._regions, objects, 1.0, voxels.resolution * np.sqrt(0.75))
        centers = scene.octomap.shapes[0][0].centers  # type: ignore[attr-defined]
        points = centers @ scene.octomap.pose.rotation.T + scene.octomap.pose.translation
        is_inside = known.hides(points, np.zeros(3))
        if not is_inside.any():
            return
        keys, resolution = voxels.occupied_keys[is_inside], voxels.resolution

        def change(now: PlanningScene) -> PlanningScene:
            newest = voxels_of(now)
            if newest is None or newest.resolution != resolution or now.octomap is None:
                return now
            return now.with_octomap(Octree(newest.with_free_cells(keys)), now.octomap.pose)

        self._monitor.apply(change)

    def _pose_in_planning_frame(self, frame: str, stamp: rospy.Time, positions: Array) -> Transform:
        frame, model = frame.removeprefix("/"), self._monitor.model
        if not frame:
            return pin.SE3.Identity()
        if model.has_link(frame):
            return model.link_transforms(positions)[frame]
        import tf2_ros

        try:
            stamped = self._transforms.lookup_transform(model.planning_frame, frame, stamp, rospy.Duration(WAIT_S))
        except tf2_ros.TransformException as error:
            raise PlanningError(
                ErrorCode.FRAME_TRANSFORM_FAILURE,
                f"sensor data in frame '{frame}': no transform to '{model.planning_frame}' at "
                f"{stamp.to_sec():.3f} s after {WAIT_S} s ({error}); "
                "is the transform published on tf?",
            ) from error
        t, q = stamped.transform.translation, stamped.transform.rotation
        return make_transform((t.x, t.y, t.z), (q.x, q.y, q.z, q.w), f"transform of '{frame}'")

    def _save(self, request: Any) -> SaveMapResponse:
        voxels = voxels_of(self._monitor.snapshot())
        try:
            if voxels is None:
                raise OSError("the planning scene has no octomap; save after sensor data has been inserted")
            write_file(Path(request.filename), voxels)
        except OSError as error:
            rospy.logerr(
                "%s: cannot write '%s': %s", rospy.resolve_name(names.SAVE_MAP_SERVICE), request.filename, error
            )
            return SaveMapResponse(success=False)
        return SaveMapResponse(success=True)

    def _load(self, request: Any) -> LoadMapResponse:
        try:
            octree = Octree(read_file(Path(request.filename)))
            pose = self._pose_in_planning_frame(self._frame, rospy.Time(0), self._monitor.positions())
            self._monitor.apply(lambda scene: scene.with_octomap(octree, pose))
        except PlanningError as error:
            rospy.logerr("%s: %s", rospy.resolve_name(names.LOAD_MAP_SERVICE), error.reason)
            return LoadMapResponse(success=False)
        return LoadMapResponse(success=True)


def _compile_loops() -> None:
    """Compiles the kernels by inserting a point into an empty map, so that the first sensor message need not wait."""
    origin, point = np.zeros(3), np.ones((1, 3))
    empty_map(DEFAULT_RESOLUTION).with_point_cloud(origin, point, point, point)
    SelfFilter(np.zeros((1, 4)), np.zeros((0, 4)), np.zeros(2, np.int64)).hides(point, origin)


def _transformed_points(pose: Transform, points: Array) -> Array:
    """Transforms points, shape (n, 3), into the frame with the given pose."""
    return np.asarray((points - pose.translation) @ pose.rotation)
