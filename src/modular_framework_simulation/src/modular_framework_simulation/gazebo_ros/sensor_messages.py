# SPDX-License-Identifier: BSD-3-Clause
"""Converts measurements of sensors into messages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from gazebo_msgs.msg import ContactsState, ContactState
from geometry_msgs.msg import Quaternion, Vector3, WrenchStamped
from geometry_msgs.msg import Wrench as WrenchMsg
from sensor_msgs.msg import Imu, LaserScan
from std_msgs.msg import Header

from modular_framework_simulation.sensors.contact import ContactPair, ContactSensor, MeasuredContact
from modular_framework_simulation.sensors.force_torque import ForceTorqueSensor, Wrench
from modular_framework_simulation.sensors.imu import ImuReading, ImuSensor, Noises
from modular_framework_simulation.sensors.laser import LaserSensor


def wrench_message(sensor: ForceTorqueSensor, wrench: Wrench, message_header: Header) -> WrenchStamped:
    """Returns the message of a wrench, with force [N] and torque [Nm].

    Args:
        sensor: Description of the sensor.
        wrench: The measurement.
        message_header: Header of the message.
    """
    del sensor
    return WrenchStamped(message_header, WrenchMsg(Vector3(*wrench.force), Vector3(*wrench.torque)))


def imu_message(sensor: ImuSensor, reading: ImuReading, message_header: Header) -> Imu:
    """Returns the message of an IMU reading, with the variances of the noise.

    Args:
        sensor: Description of the sensor.
        reading: The measurement.
        message_header: Header of the message.
    """
    message = Imu(header=message_header, orientation=Quaternion(*reading.orientation))
    message.angular_velocity = Vector3(*reading.angular_velocity)
    message.linear_acceleration = Vector3(*reading.specific_force)
    message.orientation_covariance = _diagonal([sensor.orientation_noise.stddev] * 3)
    message.angular_velocity_covariance = _covariance(sensor.rate_noise)
    message.linear_acceleration_covariance = _covariance(sensor.acceleration_noise)
    return message


def _covariance(noises: Noises) -> list[float]:
    return _diagonal([noise.stddev for noise in noises])


def _diagonal(deviations: Sequence[float]) -> list[float]:
    x, y, z = (deviation**2 for deviation in deviations)
    return [x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z]


def scan_message(sensor: LaserSensor, ranges: npt.NDArray[np.float64], message_header: Header) -> LaserScan:
    """Returns the message of a scan; all rays have the same time, and the intensities are 0.

    Args:
        sensor: Description of the sensor.
        ranges: Distances along the rays, shape (samples,) [m].
        message_header: Header of the message.
    """
    return LaserScan(
        header=message_header,
        angle_min=sensor.min_angle,
        angle_max=sensor.max_angle,
        angle_increment=sensor.angle_increment,
        range_min=sensor.min_range,
        range_max=sensor.max_range,
        ranges=ranges.tolist(),
        intensities=[0.0] * len(ranges),
    )


def contacts_message(sensor: ContactSensor, pairs: Sequence[ContactPair], message_header: Header) -> ContactsState:
    """Returns the message of the contacts, with one state per pair of shapes.

    Args:
        sensor: Description of the sensor.
        pairs: The measurement; empty without contacts.
        message_header: Header of the message.
    """
    del sensor
    states = []
    for index, pair in enumerate(pairs, 1):
        info = f"contact {index} of {len(pairs)}: {pair.own} touches {pair.other} in {len(pair.contacts)} points"
        state = ContactState(info=info, collision1_name=pair.own, collision2_name=pair.other)
        state.wrenches = [_wrench([contact]) for contact in pair.contacts]
        state.total_wrench = _wrench(pair.contacts)
        state.contact_positions = [Vector3(*contact.position) for contact in pair.contacts]
        state.contact_normals = [Vector3(*contact.normal) for contact in pair.contacts]
        state.depths = [contact.depth for contact in pair.contacts]
        states.append(state)
    return ContactsState(header=message_header, states=states)


def _wrench(contacts: Sequence[MeasuredContact]) -> WrenchMsg:
    forces, torques = zip(*((contact.force, contact.torque) for contact in contacts), strict=True)
    return WrenchMsg(*(Vector3(*(sum(axis) for axis in zip(*each, strict=True))) for each in (forces, torques)))
