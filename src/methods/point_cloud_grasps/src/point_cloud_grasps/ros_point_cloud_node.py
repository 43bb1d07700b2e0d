# SPDX-License-Identifier: BSD-3-Clause
"""The ROS node of the method: its parameters, its point cloud, and its grasps as candidates."""

from __future__ import annotations

import time

import numpy as np
import numpy.typing as npt
import rospy

from modular_framework_core.grasp_generation.grasp_candidates import (
    GraspCandidate,
    GraspQuery,
    NoCandidatesError,
    ReadNumber,
)
from modular_framework_core.grasp_generation.pair_grasps import candidates_of, quality_with_travel
from modular_framework_core.grasp_generation.planning_scene_objects import CropBox, SceneObject
from modular_framework_core.grasp_generation.ros_generator_settings import (
    ParameterisedMethod,
    read_pair_grasps,
)
from modular_framework_core.grasp_generation.ros_grasp_generator import run_grasp_generator
from point_cloud_grasps.cloud_grasps import CloudSettings, Region, cloud_grasps, relevant_region
from point_cloud_grasps.cloud_pairs import CloudPairSettings
from point_cloud_grasps.robot_bodies import RobotBodies
from point_cloud_grasps.ros_cloud_source import CloudSource
from point_cloud_grasps.seen_objects import crop_region, seen_objects

Array = npt.NDArray[np.float64]

TOPIC_PARAMETERS = ("~point_cloud_topic", "pointcloud_topic_name")


class PointCloudMethod(ParameterisedMethod):
    """Antipodal grasps on a point cloud, which is received again for every object.

    Parameters: the parameters of :func:`read_cloud_settings`, read again for every object; ``~point_cloud_topic``
        (empty for the topic in ``pointcloud_topic_name``), ``~cloud_timeout`` [s], ``~robot_padding`` [m],
        ``origin_frame_name``, ``robot_description``.
    Subscribers: see :class:`CloudSource`.
    """

    manner = "between two opposite sides that the camera sees"
    declared_in = ("point_cloud_grasps", "point_cloud_grasp_generator")

    def __init__(self, read: ReadNumber | None = None) -> None:
        """Creates the method without any subscription."""
        super().__init__(read)
        self._source = CloudSource()
        self._robot: RobotBodies | None = None

    def connect(self) -> None:
        """Subscribes to TF."""
        self._source.connect()

    def candidates(self, query: GraspQuery) -> list[GraspCandidate]:
        """Returns the grasps in the order of :func:`cloud_grasps`, then the same grasps with the hand rotated by pi.

        Raises:
            NoCandidatesError: The object has no feasible grasp; the message gives the reason.
        """
        settings = read_cloud_settings(self.read)
        start_s = time.perf_counter()
        points = self._points(relevant_region(query, settings))
        cloud_taken_s = time.perf_counter()
        grasps = cloud_grasps(query, points, settings)
        rospy.logdebug(
            "%d points around '%s': %d grasps; cloud %.2f s, search %.2f s",
            len(points), query.target.name, len(grasps), cloud_taken_s - start_s, time.perf_counter() - cloud_taken_s,
        )  # fmt: skip
        return candidates_of(grasps, query.gripper, settings)

    def seen_objects(self, crop: CropBox, seed: int) -> list[SceneObject]:
        """Returns the objects in the crop box for an empty planning scene, see :func:`seen_objects`.

        Raises:
            NoCandidatesError: The crop box has no object; the message gives the reason.
        """
        return seen_objects(self._points(crop_region(crop)), crop, read_cloud_settings(self.read), seed)

    def _points(self, region: Region) -> Array:
        """Receives a cloud and returns its points in a region and off the robot, in the planning frame, (n, 3) [m]."""
        if not rospy.core.is_initialized():
            raise NoCandidatesError("the method needs a camera, in a simulation or on a robot; use the mode `task`")
        topic = next((name for name in map(_text, TOPIC_PARAMETERS) if name), "")
        if not topic:
            raise NoCandidatesError(
                f"no point cloud topic is set; set parameter '{rospy.resolve_name(TOPIC_PARAMETERS[0])}' in "
                f"generative_methods_config.yaml, or '{TOPIC_PARAMETERS[1]}' in sensors_config.yaml"
            )
        frame = _text("origin_frame_name") or "world"
        cloud = self._source.take(topic, frame, self.read("~cloud_timeout"))
        points = cloud.points[region.contains(cloud.points)]
        robot = self._robot_bodies()
        poses = self._source.link_poses(robot.links, frame, cloud.stamp)
        return points[~robot.hide(points, poses, self.read("~robot_padding"))]

    def reached_quality(self, candidate: GraspCandidate, joint_travel: float) -> float:
        """Returns the grasp quality combined with the joint travel between the poses of the grasp."""
        return quality_with_travel(candidate.quality, joint_travel)

    def _robot_bodies(self) -> RobotBodies:
        if self._robot is None:
            self._robot = RobotBodies(_text("robot_description"))
            for fault in self._robot.faults:
                rospy.logwarn("%s: %s; points on it count as obstacles.", rospy.get_name(), fault)
        return self._robot


def read_cloud_settings(read: ReadNumber) -> CloudSettings:
    """Reads the parameters of the method.

    Args:
        read: Function that reads a parameter.
    """
    pairs = CloudPairSettings(contact_samples=int(read("~contact_samples")), friction=read("~friction"))
    shared = read_pair_grasps(pairs.cone_cosine, read)
    return CloudSettings(
        shared.hand,
        shared.full_clearance_m,
        shared.max_poses,
        shared.max_candidates,
        pairs=pairs,
        region_padding_m=read("~region_padding"),
        min_height_m=read("~min_height"),
    )


def _text(name: str) -> str:
    return str(rospy.get_param(name, ""))


def main() -> int:
    """Runs the node ``point_cloud_grasp_generator``; returns 1 if a requirement is missing."""
    return run_grasp_generator("point_cloud_grasp_generator", PointCloudMethod())
