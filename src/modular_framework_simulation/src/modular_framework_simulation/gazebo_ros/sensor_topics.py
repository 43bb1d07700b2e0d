# SPDX-License-Identifier: BSD-3-Clause
"""Publishes the measurements of all models' sensors, and follows added and removed models."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import rospy
from gazebo_msgs.msg import ContactsState
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import Imu as ImuMsg
from sensor_msgs.msg import LaserScan

from modular_framework_ros.seeds import MAX_SEED, derived_seed, seed_parameter
from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.gazebo_ros import sensor_messages
from modular_framework_simulation.gazebo_ros.camera_messages import header
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.sensors.cameras import Camera
from modular_framework_simulation.sensors.contact import ContactListener, ContactSensor
from modular_framework_simulation.sensors.force_torque import ForceTorqueSensor, JointLoad
from modular_framework_simulation.sensors.imu import Imu, ImuSensor
from modular_framework_simulation.sensors.laser import Laser, LaserSensor
from modular_framework_simulation.sensors.ray_scene import RayScene
from modular_framework_simulation.sensors.sensor_reader import Sensors, read_model_sensors
from modular_framework_simulation.sensors.sensor_xml import Sensor

_QUEUE_SIZE = 50


class Instrument(Protocol):
    """Interface of measurements for a sensor."""

    def reset(self) -> None:
        """Discards the previous measurement, which the next measurement depends on."""

    def measure(self) -> Any:
        """Returns the current measurement; None if a further call is required first."""


class SensorTopic:
    """Publishes the topic of one sensor; called by the loop's thread.

    Args:
        world: World of the sensor.
        sensor: Description of the sensor.
        kind: Message type of the topic.
        instrument: Measurement of the sensor.
        to_message: Function that converts the sensor, a measurement and a header into a message.
    """

    def __init__(
        self,
        world: PhysicsWorld,
        sensor: Sensor,
        kind: type,
        instrument: Instrument,
        to_message: Callable[[Any, Any, Any], Any],
    ) -> None:
        self._world, self._sensor, self._instrument, self._to_message = world, sensor, instrument, to_message
        self._publisher = rospy.Publisher(sensor.topic, kind, queue_size=_QUEUE_SIZE)
        self._period_ns = round(1e9 / sensor.rate_hz) if sensor.rate_hz else 1
        self._period_index, self._revision = 0, -1

    def tick(self) -> None:
        """Measures and publishes if the period has elapsed and the topic has a subscriber."""
        time_ns = self._world.time_ns
        period_index = time_ns // self._period_ns
        if period_index == self._period_index:
            return
        reset_needed = period_index < self._period_index or self._revision != self._world.revision
        self._period_index, self._revision = period_index, self._world.revision
        subscribed = self._publisher.get_num_connections() > 0
        if reset_needed or not subscribed:
            self._instrument.reset()
        if not subscribed:
            return
        measured = self._instrument.measure()
        if measured is not None:
            self._publisher.publish(self._to_message(self._sensor, measured, header(self._sensor.frame_id, time_ns)))

    def close(self) -> None:
        """Closes the topic."""
        self._publisher.unregister()


@dataclass(frozen=True, slots=True)
class _ModelSensors:
    """Topics and cameras of a model, and the elements that describe the sensors."""

    elements: object
    topics: tuple[SensorTopic, ...]
    cameras: tuple[Camera, ...]


class SensorTopics:
    """Publishes the sensors of all models except cameras, which another process renders.

    Publishes: sensor_msgs/Imu, sensor_msgs/LaserScan, gazebo_msgs/ContactsState and geometry_msgs/WrenchStamped, with
    the names in the descriptions.

    Args:
        world: World of the models.
        robots: Sensors of the robots, whose descriptions the world does not store.
        seed: Random seed of the noise.
        show_cameras: Function that is called with the cameras of all models on every change.
    """

    def __init__(
        self,
        world: PhysicsWorld,
        robots: Sequence[Sensors],
        seed: int,
        show_cameras: Callable[[Sequence[Camera]], None],
    ) -> None:
        self._world, self._seed, self._show_cameras = world, seed, show_cameras
        self._robots = {sensors.parts.name: sensors for sensors in robots}
        self._scene = RayScene(world, {name: sensors.parts.links for name, sensors in self._robots.items()})
        self._models: dict[str, _ModelSensors] = {}
        self._topics: tuple[SensorTopic, ...] = ()
        self._reported: set[str] = set()
        self._revision = -1
        self.follow()

    def tick(self) -> None:
        """Publishes due measurements; called by the loop's thread after every physics step."""
        if self._world.revision != self._revision:
            self.follow()
        for topic in self._topics:
            topic.tick()

    def follow(self) -> None:
        """Opens the topics of added models, and closes the topics of removed models."""
        self._revision = self._world.revision
        elements_by_model = {
            name: self._robots.get(name) or body.spec.sensors
            for name, body in self._world.bodies.items()
            if name in self._robots or (body.spec is not None and body.spec.sensors)
        }
        removed = [name for name, model in self._models.items() if elements_by_model.get(name) is not model.elements]
        added = [name for name in elements_by_model if name not in self._models or name in removed]
        if not removed and not added:
            return
        for name in removed:
            for topic in self._models.pop(name).topics:
                topic.close()
        for name in added:
            self._models[name] = self._open(name, elements_by_model[name])
        self._topics = tuple(topic for model in self._models.values() for topic in model.topics)
        self._show_cameras([camera for model in self._models.values() for camera in model.cameras])

    def close(self) -> None:
        """Closes the copy of the world for rays; may be called twice."""
        self._scene.close()

    def _open(self, name: str, elements: Any) -> _ModelSensors:
        sensors = self._robots.get(name)
        if sensors is None:
            spec = self._world.body(name).spec
            assert spec is not None
            sensors = read_model_sensors(spec, self._seed)
        for kind, fault in sensors.faults.items():
            if kind not in self._reported:
                self._reported.add(kind)
                rospy.logwarn(fault)
        topics, cameras = [], []
        for sensor in sensors.found:
            if isinstance(sensor, Camera):
                cameras.append(sensor)
                continue
            try:
                topics.append(self._topic(sensor, sensors))
            except (SimulationError, rospy.ROSException, ValueError) as error:
                rospy.logwarn("sensor '%s' is not simulated: %s", sensor.name, error)
                continue
            rospy.loginfo("sensor '%s' publishes %s", sensor.name, sensor.topic)
        return _ModelSensors(elements, tuple(topics), tuple(cameras))

    def _topic(self, sensor: Any, sensors: Sensors) -> SensorTopic:
        world = self._world
        match sensor:
            case ImuSensor():
                return SensorTopic(world, sensor, ImuMsg, Imu(world, sensor, self._seed), sensor_messages.imu_message)
            case LaserSensor():
                laser = Laser(world, sensor, self._scene, self._seed)
                return SensorTopic(world, sensor, LaserScan, laser, sensor_messages.scan_message)
            case ContactSensor():
                listener = ContactListener(world, sensor, sensors.parts.links)
                return SensorTopic(world, sensor, ContactsState, listener, sensor_messages.contacts_message)
            case ForceTorqueSensor():
                load = JointLoad(world, sensor, self._seed)
                return SensorTopic(world, sensor, WrenchStamped, load, sensor_messages.wrench_message)
        raise TypeError(f"{type(sensor).__name__} has no topic")


def noise_seed() -> int:
    """Returns the seed of the sensor noise, derived from the parameter /seed or random.

    Raises:
        SeedError: The parameter is not a valid seed.
    """
    seed = seed_parameter()
    return secrets.randbelow(MAX_SEED) if seed is None else derived_seed(seed, "noise of sensors")
