# SPDX-License-Identifier: BSD-3-Clause
"""The method does what every grasp generator does, with a camera that sees the scene; and says what its cloud lacks."""

from __future__ import annotations

import functools
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2, PointField

from modular_framework_testing.grasping.fake_move_group import FakeMoveGroup
from modular_framework_testing.grasping.generator_conformance import (
    BOX_SIZE,
    GraspGeneratorConformance,
    assert_holds_box,
    next_grasp,
    renew_grasps,
)
from modular_framework_testing.ros_session import until as wait_until

sys.path.insert(0, str(Path(__file__).parents[2] / "unit"))
from depth_camera import AXES, EYE, Box, image  # noqa: E402

TOPIC, FRAME = "camera/points", "camera_optical"
TABLE = Box((2.0, 2.0, 0.02), (0.0, 0.5, 0.83))
until = functools.partial(wait_until, timeout_s=30.0)


class FakeCamera:
    """Publishes what a camera above the table sees of the boxes of a scene, while somebody subscribes.

    Attributes:
        scene: Has the boxes.
        unknown: Boxes that the scene does not have.
        change: Makes the points (rows, columns, 3) that are published of those that are seen.
        frame: Frame in the header.
    """

    def __init__(self, scene: FakeMoveGroup) -> None:
        self.scene, self.frame = scene, FRAME
        self.change = lambda points: points
        self.unknown: list[Box] = []
        self._static = tf2_ros.StaticTransformBroadcaster()
        found = TransformStamped()
        found.header.frame_id, found.child_frame_id = "world", FRAME
        place, turn = found.transform.translation, found.transform.rotation
        place.x, place.y, place.z = EYE
        turn.x, turn.y, turn.z, turn.w = Rotation.from_matrix(AXES).as_quat()
        self._static.sendTransform(found)
        self._publisher = rospy.Publisher(TOPIC, PointCloud2, queue_size=1)
        self._seen: tuple[object, np.ndarray] = ((), np.empty(0))
        threading.Thread(target=self._run, daemon=True).start()

    @property
    def watched(self) -> bool:
        return bool(self._publisher.get_num_connections())

    def _run(self) -> None:
        while not rospy.is_shutdown():
            if self.watched:
                self._publisher.publish(self._cloud())
            rospy.rostime.wallsleep(0.1)

    def _cloud(self) -> PointCloud2:
        stamp, shapes = rospy.Time.now(), [TABLE, *self.unknown]
        for item in self.scene.objects:
            at = item.pose.position
            shapes.append(Box(tuple(item.primitives[0].dimensions), (at.x, at.y, at.z)))
        key = [(shape.size, shape.centre) for shape in shapes]
        if key != self._seen[0]:  # to draw an image takes as long as the method needs to find grasps in it
            self._seen = (key, image(shapes))
        points = self.change(self._seen[1])
        cloud = PointCloud2(height=points.shape[0], width=points.shape[1], point_step=12, row_step=12 * points.shape[1])
        cloud.header.stamp, cloud.header.frame_id = stamp, self.frame
        cloud.fields = [PointField(name, 4 * place, PointField.FLOAT32, 1) for place, name in enumerate("xyz")]
        cloud.data = points.astype("<f4").tobytes()
        return cloud

    @contextmanager
    def changed(self, **values: object) -> Iterator[None]:
        before = {name: getattr(self, name) for name in values}
        for name, value in values.items():
            setattr(self, name, value)
        yield
        for name, value in before.items():
            setattr(self, name, value)


class TestPointCloudGrasps(GraspGeneratorConformance):
    """Grasps between opposite sides that a camera sees."""

    package, node = "point_cloud_grasps", "point_cloud_grasp_generator"
    manner = "between two opposite sides that the camera sees"
    camera: FakeCamera

    @classmethod
    def prepare(cls) -> None:
        cls.camera = FakeCamera(cls.scene)
        rospy.set_param("pointcloud_topic_name", TOPIC)

    def test_the_camera_is_subscribed_to_only_while_a_cloud_is_waited_for(self) -> None:
        until(lambda: not self.camera.watched, "the camera without a subscriber")
        seen = []

        def remember(points: np.ndarray) -> np.ndarray:
            seen.append(self.camera.watched)
            return points

        with self.camera.changed(change=remember):
            assert self.generate()[0]
        assert seen and seen[0]
        until(lambda: not self.camera.watched, "the camera without a subscriber")

    def test_an_unorganised_cloud_with_holes_does_too(self) -> None:
        def unorganised(points: np.ndarray) -> np.ndarray:
            flat = points.reshape(1, -1, 3).copy()
            flat[:, ::10] = np.nan
            return flat[:, np.random.default_rng(1).permutation(flat.shape[1])]

        with self.camera.changed(change=unorganised):
            success, text = self.generate()
        assert success, text

    @pytest.mark.parametrize(
        ("change", "cause"),
        [
            (lambda points: np.full_like(points, np.nan), "has no finite point among 640 x 480"),
            (lambda points: points[:0], "has no finite point among 640 x 0"),
            (lambda points: points + [0.0, 0.0, -0.6], "the cloud has 0 points on 'box__link'"),
        ],
    )
    def test_a_cloud_that_shows_nothing_is_a_failure_with_its_cause(self, change, cause: str) -> None:
        with self.camera.changed(change=change):
            success, text = self.generate()
        assert not success and cause in text

    def test_a_cloud_in_a_frame_that_nobody_knows_is_a_failure_that_names_it(self) -> None:
        with self.camera.changed(frame="nowhere"):
            success, text = self.generate()
        assert not success
        assert f"'/{TOPIC}' is in frame 'nowhere', which has no transform to 'world'" in text and FRAME in text

    def test_no_cloud_in_time_is_a_failure_that_names_the_topic(self) -> None:
        self.set_parameter("cloud_timeout", 1.0)
        self.set_parameter("point_cloud_topic", "other/points")
        success, text = self.generate()
        assert not success
        assert "no point cloud arrived on topic '/other/points' within 1 s, nobody publishes it" in text
        self.set_parameter("point_cloud_topic", "")
        self.set_parameter("cloud_timeout", 60.0)
        assert self.generate()[0]

    def test_a_task_waits_for_an_object_that_the_first_cloud_did_not_show(self) -> None:
        box = self.scene.objects.pop()
        answers: list[tuple[bool, str]] = []
        self.set_parameter("scene_timeout", 60.0)
        task = threading.Thread(target=lambda: answers.append(renew_grasps()))
        until(lambda: not self.camera.watched, "the camera without a subscriber")
        task.start()
        until(lambda: self.camera.watched, "the generator waits for a cloud")
        until(lambda: not self.camera.watched, "the generator has a cloud without an object")
        assert not answers
        self.scene.objects.append(box)
        task.join(60.0)
        assert answers and answers[0][0], answers

    def test_what_the_scene_does_not_know_is_found_in_the_cloud(self) -> None:
        known, self.scene.objects = (
            self.scene.objects,
            [item for item in self.scene.objects if not item.id.startswith("box")],
        )
        try:
            success, text = self.generate()
            assert not success
            assert "in the crop box" in text and "is on the plane at 0.840 m" in text
            with self.camera.changed(unknown=[Box(BOX_SIZE, (-0.1, 0.4, 0.89))]):
                success, text = self.generate()
            assert success, text
            grasp = next_grasp().grasp_message
            assert grasp.object_id == "seen_1"
            assert_holds_box(grasp, -0.1, 0.4)
        finally:
            self.scene.objects = known
