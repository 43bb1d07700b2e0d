# SPDX-License-Identifier: BSD-3-Clause
"""Converts camera images into messages."""

from __future__ import annotations

import rospy
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_msgs.msg import Header

from modular_framework_simulation.sensors.cameras import POINT, CameraImage, Pinhole


def header(frame_id: str, time_ns: int) -> Header:
    """Returns the header of messages with a frame and a simulated time [ns]."""
    return Header(frame_id=frame_id, stamp=rospy.Time(*divmod(time_ns, 1_000_000_000)))


def camera_info(pinhole: Pinhole, message_header: Header) -> CameraInfo:
    """Returns the intrinsic parameters of a camera without distortion."""
    info = CameraInfo(header=message_header, width=pinhole.width, height=pinhole.height, distortion_model="plumb_bob")
    k = pinhole.intrinsics()
    info.D, info.K, info.R = [0.0] * 5, list(k), [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    info.P = [*k[:3], 0.0, *k[3:6], 0.0, *k[6:], 0.0]
    return info


def rgb_image(image: CameraImage, message_header: Header) -> Image:
    """Returns the colour image, encoded as rgb8."""
    height, width, channels = image.rgb.shape
    message = Image(header=message_header, width=width, height=height, encoding="rgb8", step=width * channels)
    message.data = image.rgb.tobytes()
    return message


def depth_image(image: CameraImage, message_header: Header) -> Image:
    """Returns the depth image, encoded as 32FC1 [m], with NaN for empty pixels (REP 118)."""
    height, width = image.depth.shape
    message = Image(header=message_header, width=width, height=height, encoding="32FC1", step=width * 4)
    message.data = image.depth.astype("<f4").tobytes()
    return message


def point_cloud(pinhole: Pinhole, image: CameraImage, message_header: Header) -> PointCloud2:
    """Returns one point per pixel, in the order of the image, with the colour in the field rgb.

    Args:
        pinhole: Projection of the image.
        image: The image.
        message_header: Header of the message.
    """
    cloud = PointCloud2(
        header=message_header, width=pinhole.width, height=pinhole.height, is_dense=False, is_bigendian=False
    )
    cloud.fields = [
        PointField(name=name, offset=POINT.fields[name][1], datatype=PointField.FLOAT32, count=1)
        for name in POINT.names
    ]
    cloud.point_step, cloud.row_step = POINT.itemsize, POINT.itemsize * pinhole.width
    cloud.data = pinhole.cloud(image.depth, image.rgb).tobytes()
    return cloud
