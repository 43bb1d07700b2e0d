# SPDX-License-Identifier: BSD-3-Clause
"""Publishes sensor frames on /tf_static."""

from __future__ import annotations

import sys
from pathlib import Path

import rospy
import tf2_ros
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from std_srvs.srv import Trigger, TriggerResponse

from modular_framework_core.managers.named_poses import NamedPose, Placement
from modular_framework_core.scene.sensor_frames import SensorFrame, load_sensor_frames
from modular_framework_core.srv import GetPoseStamped
from modular_framework_ros.calls import CallError, wait_for_service
from modular_framework_ros.start_up import start_timeout


def transform_message(frame: SensorFrame) -> TransformStamped:
    """Returns the transform from the parent frame to a sensor frame, stamped with the current time."""
    message = TransformStamped()
    message.header.stamp = rospy.Time.now()
    message.header.frame_id = frame.parent_frame
    message.child_frame_id = frame.frame
    message.transform.translation = Vector3(*frame.placement.position_m)
    message.transform.rotation = Quaternion(*frame.placement.quaternion_xyzw)
    return message


def stored_pose(name: str) -> NamedPose | None:
    """Returns a pose from the pose manager, or None if the name is unknown or the manager does not answer."""
    get_pose = rospy.ServiceProxy("get_pose", GetPoseStamped)
    try:
        wait_for_service(get_pose, start_timeout())
        response = get_pose(name)
    except (CallError, rospy.ROSException, rospy.ServiceException) as error:
        rospy.logerr("Service '%s' did not return the pose '%s': %s", get_pose.resolved_name, name, error)
        return None
    if not response.success:
        return None
    position, rotation = response.pose_stamped.pose.position, response.pose_stamped.pose.orientation
    placement = Placement((position.x, position.y, position.z), (rotation.x, rotation.y, rotation.z, rotation.w))
    return NamedPose(name, response.pose_stamped.header.frame_id, {"": placement})


class SensorFrames:
    """Sensor frames of a file.

    Publishers:
        ``/tf_static`` (tf2_msgs/TFMessage): One transform per sensor.
    Services:
        ``reload_sensor_frames`` (std_srvs/Trigger): Reads the file again.
    """

    def __init__(self, path: Path) -> None:
        """Stores the path of the file; :meth:`connect` reads and publishes it."""
        self._path = path
        self._broadcaster: tf2_ros.StaticTransformBroadcaster | None = None
        self._published: set[str] = set()

    def connect(self) -> None:
        """Reads the file, publishes the frames and advertises the service."""
        self._broadcaster = tf2_ros.StaticTransformBroadcaster()
        self._load()
        rospy.Service("reload_sensor_frames", Trigger, self._reload)

    def _load(self) -> list[str]:
        frames, faults = load_sensor_frames(self._path, stored_pose)
        for fault in faults:
            rospy.logwarn("%s. This sensor is skipped.", fault)
        if frames and self._broadcaster is not None:
            self._broadcaster.sendTransform([transform_message(frame) for frame in frames])
            rospy.loginfo("Sensor frames: %s.", ", ".join(f"{frame.frame} in {frame.parent_frame}" for frame in frames))
        removed = sorted(self._published - {frame.frame for frame in frames})
        self._published |= {frame.frame for frame in frames}
        warnings = [
            f"frame '{name}' was removed from the file; TF keeps it until this node is restarted" for name in removed
        ]
        return [*map(str, faults), *warnings]

    def _reload(self, request: object) -> TriggerResponse:
        problems = self._load()
        return TriggerResponse(success=not problems, message="\n".join(problems))


def main() -> int:
    """Runs the node ``sensors_tf2_broadcaster``; argument: path of the sensors' YAML file.

    Returns:
        Exit code: 0 for success, 2 if the argument is missing.
    """
    rospy.init_node("sensors_tf2_broadcaster")
    arguments = rospy.myargv(sys.argv)[1:]
    if len(arguments) != 1:
        rospy.logfatal(
            "sensors_tf2_broadcaster: got %d arguments, expected one: the path of the sensors' YAML file.",
            len(arguments),
        )
        return 2
    SensorFrames(Path(arguments[0])).connect()
    rospy.spin()
    return 0
