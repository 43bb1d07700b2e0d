# SPDX-License-Identifier: BSD-3-Clause
"""Depth images and clouds become obstacles of the scene; robot and known objects do not; maps are cleared and kept."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rospy
import tf2_ros
from geometry_msgs.msg import Point, Pose, Quaternion, TransformStamped, Vector3
from moveit_msgs.msg import Constraints, PlanningScene, PlanningSceneComponents, PlanningSceneWorld, RobotState
from moveit_msgs.srv import ApplyPlanningScene, GetPlanningScene, GetPositionFK, GetStateValidity, LoadMap, SaveMap
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2, PointField
from std_msgs.msg import Header
from std_srvs.srv import Empty
from visualization_msgs.msg import MarkerArray

from modular_framework_planning.octomap.encoding import read_file, read_stream
from modular_framework_planning.octomap.voxel_map import VoxelMap
from modular_framework_testing.planning.planning_wire import ARM, START, FakeArm, add, box, call
from modular_framework_testing.ros_session import until

CAMERA_AT = np.array([-2.5, 0.0, 1.2])
CAMERA_ALONG_X = Quaternion(-0.5, 0.5, -0.5, 0.5)  # optical frame: z forward along the world's x, x right along -y
FOCUS, CENTER = 525.0, (319.5, 239.5)
WALL_X = 1.0  # world x of a wall behind the robot
pytestmark = pytest.mark.move_group(service="get_planning_scene")


@pytest.fixture(scope="module")
def camera(arm: FakeArm) -> Camera:
    return Camera()


class Camera:
    """A depth camera that looks along the world's x axis at boxes, by ray casting of its own."""

    def __init__(self) -> None:
        self._broadcaster = tf2_ros.StaticTransformBroadcaster()
        transform = TransformStamped(child_frame_id="camera_optical")
        transform.header.frame_id = "world"
        transform.transform.translation, transform.transform.rotation = Vector3(*CAMERA_AT), CAMERA_ALONG_X
        self._broadcaster.sendTransform(transform)
        self._image = rospy.Publisher("/camera/depth/image_rect_raw", Image, queue_size=1)
        self._info = rospy.Publisher("/camera/depth/camera_info", CameraInfo, queue_size=1, latch=True)
        info = CameraInfo(height=480, width=640)
        info.K = [FOCUS, 0, CENTER[0], 0, FOCUS, CENTER[1], 0, 0, 1]
        self._info.publish(info)
        until(
            lambda: self._image.get_num_connections() > 0 and self._info.get_num_connections() > 0,
            "move_group listens to the camera",
        )

    @staticmethod
    def depth(boxes: list[tuple[tuple[float, float, float], tuple[float, float, float]]]) -> np.ndarray:
        """Distance along x to the first of some boxes (centre, edges), or to the wall."""
        columns, rows = np.meshgrid(np.arange(640), np.arange(480))
        along = np.stack([np.ones((480, 640)), -(columns - CENTER[0]) / FOCUS, -(rows - CENTER[1]) / FOCUS], axis=-1)
        result = np.full((480, 640), WALL_X - CAMERA_AT[0])
        for center, edges in boxes:
            low, high = (np.array(center) + sign * np.array(edges) / 2 - CAMERA_AT for sign in (-1, 1))
            with np.errstate(divide="ignore"):
                ends = np.sort(np.stack([low / along, high / along]), axis=0)
            enter, leave = ends[0].max(axis=-1), ends[1].min(axis=-1)
            hit = (enter <= leave) & (enter > 0)
            result[hit] = np.minimum(result[hit], enter[hit])
        return result

    def show(self, depth: np.ndarray, encoding: str = "16UC1") -> None:
        """Sends one image."""
        kind, unit = {"16UC1": ("<u2", 1000.0), "32FC1": ("<f4", 1.0)}[encoding]
        data = (depth * unit).astype(kind)
        image = Image(height=480, width=640, encoding=encoding, step=640 * data.itemsize, data=data.tobytes())
        image.header.frame_id, image.header.stamp = "camera_optical", rospy.Time.now()
        self._image.publish(image)


def octomap() -> VoxelMap | None:
    wanted = PlanningSceneComponents(PlanningSceneComponents.OCTOMAP)
    tree = call("get_planning_scene", GetPlanningScene, wanted).scene.world.octomap.octomap
    if not tree.data:
        return None
    return read_stream(np.array(tree.data, np.int8).tobytes(), tree.resolution, tree.binary)


def occupied(point: tuple[float, float, float], reach: float = 0.06) -> bool:
    voxels = octomap()
    return voxels is not None and bool((np.abs(voxels.occupied_centers() - np.array(point)) < reach).all(axis=1).any())


def clear() -> None:
    call("clear_octomap", Empty)


def until_seen(send: Callable[[], None], condition: Callable[[], bool], what: str) -> None:
    """Sends what a sensor sees, again every 5 s, until a condition holds.

    move_group leaves out what it sees while joint states come more than a second late, as on a busy computer.
    """

    def sent_and_seen() -> bool:
        send()
        end = time.monotonic() + 5.0
        while not condition():
            if time.monotonic() > end:
                return False
            time.sleep(0.01)
        return True

    until(sent_and_seen, what)


OBSTACLE = ((-0.6, 0.9, 1.2), (0.2, 0.2, 0.2))


def test_a_box_in_a_depth_image_is_an_obstacle_and_goes_when_it_is_gone(camera: Camera) -> None:
    clear()
    depth = camera.depth([OBSTACLE])
    for encoding in ("16UC1", "32FC1"):
        until_seen(
            partial(camera.show, depth, encoding),
            lambda: occupied((-0.7, 0.9, 1.2)),
            f"the box's front is occupied ({encoding})",
        )
        assert not occupied((-1.5, 0.5, 1.2)), "the ray to it is free"
        clear()
        assert octomap() is None
    until_seen(lambda: camera.show(depth), lambda: occupied((-0.7, 0.9, 1.2)), "the box's front is occupied")
    until(
        lambda: (camera.show(camera.depth([])), time.sleep(0.3), not occupied((-0.7, 0.9, 1.2)))[-1],
        "three empty looks clear it",
    )
    assert occupied((WALL_X, 1.0, 1.2)), "the wall behind is still there"


def validity(**joints: float) -> Any:
    state = RobotState(joint_state=JointState(name=list(joints), position=list(joints.values())), is_diff=True)
    return call("check_state_validity", GetStateValidity, state, "", Constraints())


def wrist(elbow: float = START[2]) -> np.ndarray:
    """Where the robot is between its elbow and its hand, with the elbow at an angle."""
    state = RobotState(joint_state=JointState(name=ARM, position=[*START[:2], elbow, *START[3:]]))
    pose = call("compute_fk", GetPositionFK, Header(frame_id="world"), ["wrist_2_link"], state).pose_stamped[0].pose
    return np.array([pose.position.x, pose.position.y, pose.position.z])


def test_the_robot_and_known_objects_are_no_obstacles_and_others_are(camera: Camera) -> None:
    clear()
    seen = tuple(wrist())
    near_robot = (seen, (0.08, 0.08, 0.08))
    known = ((-0.6, -0.9, 1.3), (0.2, 0.2, 0.2))
    assert add(box("known", *known[0], known[1]))
    filtered: list[Image] = []
    listener = rospy.Subscriber("/move_group/camera/filtered_depth", Image, filtered.append, queue_size=1)
    until(lambda: listener.get_num_connections() > 0, "the filtered image has its listener")
    depth = camera.depth([near_robot, known, OBSTACLE])
    until_seen(lambda: camera.show(depth), lambda: occupied((-0.7, 0.9, 1.2)), "the unknown box is occupied")
    assert not occupied((-0.7, -0.9, 1.3), 0.09), "a known object is not seen twice"
    assert not occupied((seen[0] - 0.04, seen[1], seen[2]), 0.09), "nor is the robot"
    assert validity().valid
    until(lambda: bool(filtered), "the filtered image came")
    left = np.frombuffer(filtered[-1].data, "<u2").reshape(480, 640) / 1000.0
    masked = (left == 0) & (depth < WALL_X - CAMERA_AT[0] - 0.01)
    assert masked[4:-4, 6:-6].sum() > 1000 and np.allclose(left[left > 0], depth[left > 0], atol=2e-3)


def test_an_object_that_becomes_known_leaves_the_octomap(camera: Camera) -> None:
    clear()
    depth = camera.depth([OBSTACLE])
    until_seen(lambda: camera.show(depth), lambda: occupied((-0.7, 0.9, 1.2)), "the box's front is occupied")
    assert add(box("became_known", *OBSTACLE[0], OBSTACLE[1]))
    until(lambda: not occupied((-0.7, 0.9, 1.2), 0.09), "its voxels are free")


def cloud(points: np.ndarray, frame: str) -> PointCloud2:
    fields = [PointField(name, 4 * number, PointField.FLOAT32, 1) for number, name in enumerate("xyz")]
    message = PointCloud2(
        height=1,
        width=len(points),
        fields=fields,
        point_step=12,
        row_step=12 * len(points),
        data=points.astype("<f4").tobytes(),
    )
    message.header.frame_id, message.header.stamp = frame, rospy.Time.now()
    return message


REACHED = 0.4  # of the elbow [rad]; there the wrist is in the ball


def ball() -> np.ndarray:
    """Points around the place where the wrist could be."""
    return wrist(REACHED) + 0.05 * np.random.default_rng(0).uniform(-1, 1, (200, 3))


def test_points_in_a_cloud_are_obstacles_that_can_be_allowed(camera: Camera) -> None:
    clear()
    publisher = rospy.Publisher("/scanner/points", PointCloud2, queue_size=1)
    filtered: list[PointCloud2] = []
    listener = rospy.Subscriber("/move_group/filtered_points", PointCloud2, filtered.append, queue_size=1)
    until(lambda: listener.get_num_connections() > 0, "the filtered cloud has its listener")
    until(lambda: publisher.get_num_connections() > 0, "move_group listens to the scanner")
    assert validity(elbow_joint=REACHED).valid
    points = np.vstack([ball(), [[np.nan] * 3, [90.0, 0.0, 0.0]], wrist()[None]])
    until_seen(
        lambda: publisher.publish(cloud(points, "world")),
        lambda: occupied(tuple(wrist(REACHED))),
        "the ball is occupied",
    )
    until(lambda: bool(filtered), "the rest is published")
    assert filtered[-1].width == 200, "without the point on the robot and those without a place or out of range"
    touching = validity(elbow_joint=REACHED)
    assert not touching.valid
    assert "<octomap>" in {name for item in touching.contacts for name in (item.contact_body_1, item.contact_body_2)}
    matrix = call(
        "get_planning_scene",
        GetPlanningScene,
        PlanningSceneComponents(PlanningSceneComponents.ALLOWED_COLLISION_MATRIX),
    ).scene.allowed_collision_matrix
    for allowed in (True, False):
        matrix.default_entry_names, matrix.default_entry_values = ["<octomap>"], [allowed]
        change = PlanningScene(is_diff=True, allowed_collision_matrix=matrix)
        assert call("apply_planning_scene", ApplyPlanningScene, change).success
        assert validity(elbow_joint=REACHED).valid is allowed


def test_points_in_a_moving_links_frame_lie_where_the_link_was_when_they_were_seen(
    camera: Camera, arm: FakeArm
) -> None:
    clear()
    publisher = rospy.Publisher("/scanner/points", PointCloud2, queue_size=1)
    until(lambda: publisher.get_num_connections() > 0, "move_group listens to the scanner")
    ahead = np.array([[0.0, 0.0, 0.4]])
    poses = {}
    for turn in (0.0, 0.7):
        state = RobotState(joint_state=JointState(name=ARM, position=[START[0] + turn, *START[1:]]))
        pose = call("compute_fk", GetPositionFK, Header(frame_id="world"), ["wrist_1_link"], state).pose_stamped[0].pose
        q = pose.orientation
        axis = np.array([2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x), 1 - 2 * (q.x**2 + q.y**2)])
        poses[turn] = np.array([pose.position.x, pose.position.y, pose.position.z]) + 0.4 * axis
    message = cloud(np.repeat(ahead, 5, axis=0), "wrist_1_link")
    arm.publish()
    arm.positions["shoulder_pan_joint"] = START[0] + 0.7
    arm.settle()
    publisher.publish(message)
    until(lambda: occupied(tuple(poses[0.0])), "the point is where the link was")
    assert not occupied(tuple(poses[0.7]))
    until_seen(
        lambda: publisher.publish(cloud(ahead, "wrist_1_link")),
        lambda: occupied(tuple(poses[0.7])),
        "and then where it is",
    )
    arm.positions["shoulder_pan_joint"] = START[0]


def test_maps_are_saved_loaded_sent_and_published(camera: Camera, tmp_path: Path) -> None:
    clear()
    scenes: list[PlanningScene] = []
    rospy.Subscriber("/move_group/monitored_planning_scene", PlanningScene, scenes.append, queue_size=50)
    cubes: list[MarkerArray] = []
    rospy.Subscriber("/move_group/octomap_markers", MarkerArray, cubes.append, queue_size=5)
    until(lambda: bool(scenes), "the whole scene came first")
    depth = camera.depth([OBSTACLE])
    until_seen(
        lambda: camera.show(depth),
        lambda: any(item.world.octomap.octomap.id == "OcTree" for item in scenes),
        "the map is published",
    )
    path = tmp_path / "room.bt"
    assert call("/move_group/save_map", SaveMap, str(path)).success
    before = octomap()
    assert before is not None and np.array_equal(read_file(path).occupied_keys, before.occupied_keys)
    until(lambda: bool(cubes) and len(cubes[-1].markers[-1].points) == len(before.occupied_keys), "the cubes are shown")
    known = len(scenes)
    clear()
    until(
        lambda: any(item.world.octomap.octomap.id == "cleared" for item in scenes[known:]), "the clearing is published"
    )
    assert call("/move_group/load_map", LoadMap, str(path)).success
    after = octomap()
    assert after is not None and np.array_equal(after.occupied_keys, before.occupied_keys)
    (tmp_path / "no.bt").write_text("no map")
    for name in (tmp_path / "no.bt", tmp_path / "missing.bt", tmp_path):
        assert not call("/move_group/load_map", LoadMap, str(name)).success
    assert not call("/move_group/save_map", SaveMap, "/no/such/folder/room.bt").success
    (tmp_path / "notes.txt").write_text("x" * 1000)
    (tmp_path / "link.bt").symlink_to(tmp_path / "notes.txt")
    for name in ("notes.txt", "link.bt", "no.bt", ""):
        assert not call("/move_group/save_map", SaveMap, str(tmp_path / name)).success
    assert (tmp_path / "notes.txt").read_text() == "x" * 1000 and (tmp_path / "no.bt").read_text() == "no map"
    assert call("/move_group/save_map", SaveMap, str(path)).success, "an octomap is overwritten"
    clear()
    saved = path.read_bytes()
    assert not call("/move_group/save_map", SaveMap, str(path)).success, "there is no map"
    assert path.read_bytes() == saved
    assert call("/move_group/load_map", LoadMap, str(path)).success
    sent = call(
        "get_planning_scene", GetPlanningScene, PlanningSceneComponents(PlanningSceneComponents.OCTOMAP)
    ).scene.world
    clear()
    publisher = rospy.Publisher("/planning_scene_world", PlanningSceneWorld, queue_size=1)
    until(lambda: publisher.get_num_connections() > 0, "move_group listens to planning_scene_world")
    sent.octomap.origin = Pose(Point(0, 0, 0.5), Quaternion(0, 0, 0, 1))
    publisher.publish(sent)
    until(lambda: octomap() is not None, "an octomap that was sent is in the scene")


def test_point_clouds_that_cannot_be_placed_are_left_out(camera: Camera) -> None:
    clear()
    publisher = rospy.Publisher("/scanner/points", PointCloud2, queue_size=5)
    until(lambda: publisher.get_num_connections() > 0, "move_group listens to the scanner")
    good = np.array([[1.0, 1.0, 1.0]])
    broken = cloud(good, "world")
    broken.data = b"12"
    old = cloud(good, "world")
    old.header.stamp = rospy.Time(1.0)
    for message in (cloud(good, "nowhere"), broken, old):
        publisher.publish(message)
        time.sleep(1.5)
    assert octomap() is None
    until_seen(
        lambda: publisher.publish(cloud(good, "world")),
        lambda: occupied((1.0, 1.0, 1.0)),
        "the node lives, the next cloud counts",
    )
