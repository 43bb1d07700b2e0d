# SPDX-License-Identifier: BSD-3-Clause
"""Messages of what sensors measure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from gazebo_msgs.msg import ContactsState, ContactState
from geometry_msgs.msg import Quaternion, Vector3, WrenchStamped
from geometry_msgs.msg import Wrench as WrenchMsg
from sensor_msgs.msg import Imu, LaserScan
from std_msgs.msg import Header

from modular_framework_simulation.sensors.contact import ContactSensor, Touch, TouchedPair
from modular_framework_simulation.sensors.force_torque import ForceTorqueSensor, Wrench
from modular_framework_simulation.sensors.imu import ImuReading, ImuSensor, Noises
from modular_framework_simulation.sensors.laser import LaserSensor


def wrench_message(sensor: ForceTorqueSensor, wrench: Wrench, head: Header) -> WrenchStamped:
    """Returns force [N] and torque [Nm]."""
    del sensor
    return WrenchStamped(head, WrenchMsg(Vector3(*wrench.force), Vector3(*wrench.torque)))


def imu_message(sensor: ImuSensor, reading: ImuReading, head: Header) -> Imu:
    """Returns orientation, angular velocity [rad/s] and specific force [m/s^2] with their variances."""
    message = Imu(header=head, orientation=Quaternion(*reading.orientation))
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


def scan_message(sensor: LaserSensor, ranges: npt.NDArray[np.float64], head: Header) -> LaserScan:
    """Returns a scan, all of it at one instant; intensities are 0, as from shapes without laser_retro."""
    return LaserScan(
        header=head,
        angle_min=sensor.min_angle,
        angle_max=sensor.max_angle,
        angle_increment=sensor.angle_increment,
        range_min=sensor.min_range,
        range_max=sensor.max_range,
        ranges=ranges.tolist(),
        intensities=[0.0] * len(ranges),
    )


def contacts_message(sensor: ContactSensor, pairs: Sequence[TouchedPair], head: Header) -> ContactsState:
    """Returns one state a pair of shapes; none while nothing touches."""
    del sensor
    states = []
    for number, pair in enumerate(pairs, 1):
        info = f"contact {number} of {len(pairs)}: {pair.own} touches {pair.other} in {len(pair.touches)} points"
        state = ContactState(info=info, collision1_name=pair.own, collision2_name=pair.other)
        state.wrenches = [_wrench([touch]) for touch in pair.touches]
        state.total_wrench = _wrench(pair.touches)
        state.contact_positions = [Vector3(*touch.position) for touch in pair.touches]
        state.contact_normals = [Vector3(*touch.normal) for touch in pair.touches]
        state.depths = [touch.depth for touch in pair.touches]
        states.append(state)
    return ContactsState(header=head, states=states)


def _wrench(touches: Sequence[Touch]) -> WrenchMsg:
    forces, torques = zip(*((touch.force, touch.torque) for touch in touches), strict=True)
    return WrenchMsg(*(Vector3(*(sum(axis) for axis in zip(*each, strict=True))) for each in (forces, torques)))
