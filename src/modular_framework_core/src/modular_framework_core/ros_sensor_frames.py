# SPDX-License-Identifier: BSD-3-Clause
"""Publishes where the sensors stand, so that TF knows their frames."""
from __future__ import annotations

import sys
from pathlib import Path

import rospy
import tf2_ros
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3

from modular_framework_core.sensor_frames import SensorFrame, load_sensor_frames


def transform_message(frame: SensorFrame) -> TransformStamped:
    """Converts a frame to a transform from its parent to itself, stamped now."""
    message = TransformStamped()
    message.header.stamp = rospy.Time.now()
    message.header.frame_id = frame.parent_frame
    message.child_frame_id = frame.frame
    message.transform.translation = Vector3(*frame.position_m)
    message.transform.rotation = Quaternion(*frame.quaternion_xyzw)
    return message


def main() -> int:
    """Runs the node ``sensors_tf2_broadcaster``; argument: the file of sensors.

    Publishers:
        ``/tf_static`` (tf2_msgs/TFMessage): one transform a sensor.

    Returns:
        Exit code: 2 when the argument is missing.
    """
    rospy.init_node("sensors_tf2_broadcaster")
    arguments = rospy.myargv(sys.argv)[1:]
    if len(arguments) != 1:
        rospy.logfatal("sensors_tf2_broadcaster: got %d arguments, expected one: the path of the sensors' YAML file.",
                       len(arguments))
        return 2
    frames, faults = load_sensor_frames(Path(arguments[0]))
    for fault in faults:
        rospy.logwarn("%s. This sensor is skipped.", fault)
    broadcaster = tf2_ros.StaticTransformBroadcaster()
    if frames:
        broadcaster.sendTransform([transform_message(frame) for frame in frames])
        rospy.loginfo("Sensor frames: %s.", ", ".join(f"{frame.frame} in {frame.parent_frame}" for frame in frames))
    rospy.spin()
    return 0
