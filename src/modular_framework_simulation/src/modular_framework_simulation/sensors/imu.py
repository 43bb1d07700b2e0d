# SPDX-License-Identifier: BSD-3-Clause
"""Inertial measurement units, which measure orientation, angular velocity and specific force (REP 145).

The specific force is the acceleration minus the acceleration of gravity; at rest, it points up with the magnitude of
gravity. The measured value is the mean since the previous measurement.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState, twist_at
from modular_framework_simulation.sensors.noise import NO_NOISE, Noise, NoiseSource
from modular_framework_simulation.sensors.sensor_xml import Sensor, SensorXml, prefixed_frame, resolved_topic, slower_of
from modular_framework_urdf.rotations import Quaternion, Vector3, multiply_quaternions, rotate_vector

TYPES = ("imu",)
MODEL_PLUGINS = ("gazebo_ros_imu", "hector_gazebo_ros_imu")
PLUGINS = ("gazebo_ros_imu_sensor", *MODEL_PLUGINS)

Noises = tuple[Noise, Noise, Noise]
_NO_NOISES: Noises = (NO_NOISE, NO_NOISE, NO_NOISE)


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuSensor(Sensor):
    """Inertial measurement unit.

    Attributes:
        rate_noise: Noise of the angular velocity about x, y, z [rad/s].
        acceleration_noise: Noise of the specific force along x, y, z [m/s^2].
        orientation_noise: Noise of the elements of the quaternion.
        offset_rotation: Rotation that left-multiplies the orientation, as a quaternion xyzw.
        from_initial: Whether the orientation is relative to the initial orientation, instead of the world frame.
    """

    rate_noise: Noises = _NO_NOISES
    acceleration_noise: Noises = _NO_NOISES
    orientation_noise: Noise = NO_NOISE
    offset_rotation: Quaternion = (0.0, 0.0, 0.0, 1.0)
    from_initial: bool = False


@dataclass(frozen=True, slots=True)
class ImuReading:
    """Measurement of an inertial measurement unit.

    Attributes:
        orientation: Orientation of the sensor, quaternion xyzw.
        angular_velocity: Angular velocity in the sensor frame [rad/s].
        specific_force: Specific force in the sensor frame [m/s^2].
    """

    orientation: Quaternion
    angular_velocity: Vector3
    specific_force: Vector3


def read_imu(xml: SensorXml) -> ImuSensor:
    """Reads a <sensor type="imu">, or an IMU plugin of the model.

    Raises:
        ValueError: A value is unsupported or invalid.
    """
    noiseless = ImuSensor(
        name=xml.name,
        model=xml.model.name,
        link=xml.link,
        pose=xml.pose,
        topic="",
        frame_id="",
        rate_hz=xml.sensor.number("update_rate", 0.0, 0.0),
    )
    rates, forces = (_noises(xml, kind) for kind in ("angular_velocity", "linear_acceleration"))
    sensor = replace(noiseless, rate_noise=rates, acceleration_noise=forces)
    if xml.plugin is None:
        return replace(sensor, topic=xml.require_topic(", ".join(PLUGINS)), frame_id=xml.link)
    return _read_sensor_plugin(xml, sensor) if xml.file == PLUGINS[0] else _read_model_plugin(xml, sensor)


def _noises(xml: SensorXml, kind: str) -> Noises:
    """Returns the noise along x, y and z."""
    x, y, z = (xml.sensor.noise(f"imu/{kind}/{axis}/noise") for axis in "xyz")
    return (x, y, z)


def _read_sensor_plugin(xml: SensorXml, sensor: ImuSensor) -> ImuSensor:
    """Reads libgazebo_ros_imu_sensor.so, whose topics are always relative to the robot namespace."""
    plugin = xml.plugin
    assert plugin is not None
    namespace = xml.namespace() or f"/{xml.model.name}"
    frame = plugin.text("frameName")
    if not frame:
        raise ValueError("<frameName>: is empty; expected the frame of the messages")
    stddev = plugin.number("gaussianNoise", 0.0, 0.0)
    return replace(
        _with_more_noise(sensor, stddev, stddev),
        topic=f"{namespace.rstrip('/')}/{plugin.text('topicName', 'imu_data').strip('/')}",
        frame_id=frame,
        rate_hz=slower_of(sensor.rate_hz, plugin.number("updateRateHZ", 1.0, 0.0)),
        orientation_noise=Noise(stddev=stddev),
        offset_rotation=Pose.from_xyz_rpy((0.0, 0.0, 0.0), plugin.vector("rpyOffset")).quaternion,
        from_initial=plugin.flag("initialOrientationAsReference", False),
    )


def _read_model_plugin(xml: SensorXml, sensor: ImuSensor) -> ImuSensor:
    """Reads libgazebo_ros_imu.so or hector's plugin, which belong to the model and name a link."""
    plugin = xml.plugin
    assert plugin is not None
    hector = xml.file == "hector_gazebo_ros_imu"
    link = xml.require_link("bodyName")
    sensor_in_link = xml.pose @ Pose.from_xyz_rpy(plugin.vector("xyzOffset"), plugin.vector("rpyOffset"))
    stddev = plugin.number("gaussianNoise", 0.0, 0.0)
    accelerations = plugin.number("accelGaussianNoise", 0.0, 0.0) if hector else stddev
    rates = plugin.number("rateGaussianNoise", 0.0, 0.0) if hector else stddev
    namespace = xml.namespace()
    frame = plugin.text("frameId" if hector else "frameName", link.rpartition("::")[2])
    return replace(
        _with_more_noise(sensor, rates, accelerations),
        link=link,
        pose=sensor_in_link,
        topic=resolved_topic(namespace, plugin.text("topicName", "imu" if hector else "/default_imu")),
        frame_id=prefixed_frame("", frame),
        rate_hz=slower_of(sensor.rate_hz, plugin.number("updateRate", 0.0, 0.0)),
    )


def _with_more_noise(sensor: ImuSensor, rates: float, accelerations: float) -> ImuSensor:
    """Adds independent noise to the angular velocity and the specific force.

    Args:
        sensor: Description of the sensor.
        rates: Standard deviation of the additional noise of the angular velocity [rad/s].
        accelerations: Standard deviation of the additional noise of the specific force [m/s^2].
    """

    def increased_noises(noises: Noises, stddev: float) -> Noises:
        x, y, z = (replace(noise, stddev=math.hypot(noise.stddev, stddev)) for noise in noises)
        return (x, y, z)

    return replace(
        sensor,
        rate_noise=increased_noises(sensor.rate_noise, rates),
        acceleration_noise=increased_noises(sensor.acceleration_noise, accelerations),
    )


class Imu:
    """Simulates an inertial measurement unit.

    Args:
        world: World of the sensor.
        sensor: Description of the sensor.
        seed: Random seed of the simulation.

    Raises:
        UnknownEntityError: The model does not have the link.
    """

    def __init__(self, world: PhysicsWorld, sensor: ImuSensor, seed: int) -> None:
        self._world, self._sensor = world, sensor
        channels = (*sensor.rate_noise, *sensor.acceleration_noise, *(sensor.orientation_noise,) * 4)
        self._noise = NoiseSource(seed, sensor.name, channels)
        self._previous: tuple[int, Vector3] | None = None
        self._initial = self._motion().pose.quaternion

    def reset(self) -> None:
        """Discards the last measurement; the next call of `measure` starts again."""
        self._previous = None

    def _motion(self) -> BodyState:
        """Returns the motion of the sensor in the world frame."""
        state = self._world.entity_state(self._sensor.parent)
        pose = state.pose @ self._sensor.pose
        return BodyState(pose, twist_at(state.twist, state.pose, pose))

    def measure(self) -> ImuReading | None:
        """Returns the current measurement; None for the first call, because a previous velocity is missing."""
        motion = self._motion()
        now_ns, previous = self._world.time_ns, self._previous
        self._previous = (now_ns, motion.twist.linear)
        if previous is None or previous[0] >= now_ns:
            return None
        elapsed_s = (now_ns - previous[0]) * 1e-9
        change = zip(motion.twist.linear, previous[1], self._world.gravity, strict=True)
        x, y, z = ((after - earlier) / elapsed_s - gravity for after, earlier, gravity in change)
        to_sensor = motion.pose.inverse().quaternion
        rate, force = rotate_vector(to_sensor, motion.twist.angular), rotate_vector(to_sensor, (x, y, z))
        return self._with_noise(ImuReading(self._orientation(motion.pose), rate, force), now_ns)

    def _orientation(self, pose: Pose) -> Quaternion:
        orientation = pose.quaternion
        if self._sensor.from_initial:
            orientation = multiply_quaternions(Pose(quaternion=self._initial).inverse().quaternion, orientation)
        return multiply_quaternions(self._sensor.offset_rotation, orientation)

    def _with_noise(self, reading: ImuReading, time_ns: int) -> ImuReading:
        exact = np.array([*reading.angular_velocity, *reading.specific_force, *reading.orientation])
        noisy = self._noise.add_noise(exact, time_ns)
        if noisy is exact:
            return reading
        wx, wy, wz, ax, ay, az = noisy[:6].tolist()
        qx, qy, qz, qw = (noisy[6:] / np.linalg.norm(noisy[6:])).tolist()
        return ImuReading((qx, qy, qz, qw), (wx, wy, wz), (ax, ay, az))
