# SPDX-License-Identifier: BSD-3-Clause
"""Inertial measurement units: orientation, angular velocity and specific force, in the frame of the sensor (REP 145).

The specific force is the acceleration without that of gravity: at rest it points up with the size of gravity. It is the
mean over the time since the measurement before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import twist_at
from modular_framework_simulation.sensors.noise import NO_NOISE, Noise, NoiseSource
from modular_framework_simulation.sensors.sensor_xml import Sensor, SensorXml, prefixed, resolved, slower_of
from modular_framework_urdf.rotations import Quaternion, Vector3, multiply_quaternions, rotate_vector

TYPES = ("imu",)
MODEL_PLUGINS = ("gazebo_ros_imu", "hector_gazebo_ros_imu")
PLUGINS = ("gazebo_ros_imu_sensor", *MODEL_PLUGINS)

Noises = tuple[Noise, Noise, Noise]
_QUIET: Noises = (NO_NOISE, NO_NOISE, NO_NOISE)


@dataclass(frozen=True, slots=True)
class ImuSensor(Sensor):
    """An inertial measurement unit.

    Attributes:
        rate_noise: Of the angular velocity about each axis [rad/s].
        acceleration_noise: Of the specific force along each axis [m/s^2].
        orientation_noise: Of the elements of the quaternion.
        turn: Rotation that is put before the orientation.
        from_initial: Whether the orientation is that since the sensor appeared, not that in the world.
    """

    rate_noise: Noises = _QUIET
    acceleration_noise: Noises = _QUIET
    orientation_noise: Noise = NO_NOISE
    turn: Quaternion = (0.0, 0.0, 0.0, 1.0)
    from_initial: bool = False


@dataclass(frozen=True, slots=True)
class ImuReading:
    """What an inertial measurement unit says.

    Attributes:
        orientation: Of the sensor, xyzw.
        angular_velocity: In the frame of the sensor [rad/s].
        specific_force: In the frame of the sensor [m/s^2].
    """

    orientation: Quaternion
    angular_velocity: Vector3
    specific_force: Vector3


def read_imu(xml: SensorXml) -> ImuSensor:
    """Reads a <sensor type="imu">, or one of the plugins of the model that are one.

    Raises:
        ValueError: A value cannot be used.
    """
    quiet = ImuSensor(xml.name, xml.model.name, xml.link, xml.pose, "", "", xml.sensor.number("update_rate", 0.0, 0.0))
    rates, forces = (_noises(xml, kind) for kind in ("angular_velocity", "linear_acceleration"))
    sensor = replace(quiet, rate_noise=rates, acceleration_noise=forces)
    if xml.plugin is None:
        return replace(sensor, topic=xml.require_topic(", ".join(PLUGINS)), frame_id=xml.link)
    return _of_sensor(xml, sensor) if xml.file == PLUGINS[0] else _of_model(xml, sensor)


def _noises(xml: SensorXml, kind: str) -> Noises:
    """Returns the noise along each axis."""
    x, y, z = (xml.sensor.noise(f"imu/{kind}/{axis}/noise") for axis in "xyz")
    return (x, y, z)


def _of_sensor(xml: SensorXml, sensor: ImuSensor) -> ImuSensor:
    """Reads libgazebo_ros_imu_sensor.so, whose topics are always below the namespace."""
    plugin = xml.plugin
    assert plugin is not None
    namespace = xml.namespace() or f"/{xml.model.name}"
    frame = plugin.text("frameName")
    if not frame:
        raise ValueError("<frameName>: got nothing; expected the frame of its messages")
    stddev = plugin.number("gaussianNoise", 0.0, 0.0)
    return replace(
        _noisier(sensor, stddev, stddev),
        topic=f"{namespace.rstrip('/')}/{plugin.text('topicName', 'imu_data').strip('/')}",
        frame_id=frame,
        rate_hz=slower_of(sensor.rate_hz, plugin.number("updateRateHZ", 1.0, 0.0)),
        orientation_noise=Noise(stddev=stddev),
        turn=Pose.from_xyz_rpy((0.0, 0.0, 0.0), plugin.vector("rpyOffset")).quaternion,
        from_initial=plugin.flag("initialOrientationAsReference", False),
    )


def _of_model(xml: SensorXml, sensor: ImuSensor) -> ImuSensor:
    """Reads libgazebo_ros_imu.so or hector's, which are plugins of the model and name a link."""
    plugin = xml.plugin
    assert plugin is not None
    hector = xml.file == "hector_gazebo_ros_imu"
    link = xml.require_link("bodyName")
    mounted = xml.pose @ Pose.from_xyz_rpy(plugin.vector("xyzOffset"), plugin.vector("rpyOffset"))
    stddev = plugin.number("gaussianNoise", 0.0, 0.0)
    accelerations = plugin.number("accelGaussianNoise", 0.0, 0.0) if hector else stddev
    rates = plugin.number("rateGaussianNoise", 0.0, 0.0) if hector else stddev
    namespace = xml.namespace()
    frame = plugin.text("frameId" if hector else "frameName", link.rpartition("::")[2])
    return replace(
        _noisier(sensor, rates, accelerations),
        link=link,
        pose=mounted,
        topic=resolved(namespace, plugin.text("topicName", "imu" if hector else "/default_imu")),
        frame_id=prefixed("", frame),
        rate_hz=slower_of(sensor.rate_hz, plugin.number("updateRate", 0.0, 0.0)),
    )


def _noisier(sensor: ImuSensor, rates: float, accelerations: float) -> ImuSensor:
    """Adds independent noise with standard deviations for the angular velocity [rad/s] and the force [m/s^2]."""

    def more(noises: Noises, stddev: float) -> Noises:
        x, y, z = (replace(noise, stddev=math.hypot(noise.stddev, stddev)) for noise in noises)
        return (x, y, z)

    return replace(
        sensor,
        rate_noise=more(sensor.rate_noise, rates),
        acceleration_noise=more(sensor.acceleration_noise, accelerations),
    )


class Imu:
    """Measures with an inertial measurement unit.

    Args:
        world: Where it is.
        sensor: The sensor.
        seed: Of the simulation.

    Raises:
        UnknownEntityError: The model has no such link.
    """

    def __init__(self, world: PhysicsWorld, sensor: ImuSensor, seed: int) -> None:
        self._world, self._sensor = world, sensor
        channels = (*sensor.rate_noise, *sensor.acceleration_noise, *(sensor.orientation_noise,) * 4)
        self._noise = NoiseSource(seed, sensor.name, channels)
        self._before: tuple[int, Vector3] | None = None
        pose, _, _ = self._motion()
        self._initial = pose.quaternion

    def rest(self) -> None:
        """Forgets the last measurement: the next call of `measure` begins again."""
        self._before = None

    def _motion(self) -> tuple[Pose, Vector3, Vector3]:
        """Returns the pose of the sensor, and its linear and angular velocity, in the world."""
        state = self._world.entity_state(self._sensor.parent)
        pose = state.pose @ self._sensor.pose
        twist = twist_at(state.twist, state.pose, pose)
        return pose, twist.linear, twist.angular

    def measure(self) -> ImuReading | None:
        """Returns the measurement of now; None at first, when there is no velocity before it."""
        pose, linear, angular = self._motion()
        now_ns, before = self._world.time_ns, self._before
        self._before = (now_ns, linear)
        if before is None or before[0] >= now_ns:
            return None
        passed_s = (now_ns - before[0]) * 1e-9
        change = zip(linear, before[1], self._world.gravity, strict=True)
        x, y, z = ((after - earlier) / passed_s - gravity for after, earlier, gravity in change)
        to_sensor = pose.inverse().quaternion
        rate, force = rotate_vector(to_sensor, angular), rotate_vector(to_sensor, (x, y, z))
        return self._noisy(ImuReading(self._orientation(pose), rate, force), now_ns)

    def _orientation(self, pose: Pose) -> Quaternion:
        orientation = pose.quaternion
        if self._sensor.from_initial:
            orientation = multiply_quaternions(Pose(quaternion=self._initial).inverse().quaternion, orientation)
        return multiply_quaternions(self._sensor.turn, orientation)

    def _noisy(self, reading: ImuReading, time_ns: int) -> ImuReading:
        exact = np.array([*reading.angular_velocity, *reading.specific_force, *reading.orientation])
        noisy = self._noise.added_to(exact, time_ns)
        if noisy is exact:
            return reading
        wx, wy, wz, ax, ay, az = noisy[:6].tolist()
        qx, qy, qz, qw = (noisy[6:] / np.linalg.norm(noisy[6:])).tolist()
        return ImuReading((qx, qy, qz, qw), (wx, wy, wz), (ax, ay, az))
