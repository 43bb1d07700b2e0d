# SPDX-License-Identifier: BSD-3-Clause
"""Publishes what the sensors of all models measure; models and their sensors come and go."""

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
    """What measures for a sensor."""

    def rest(self) -> None:
        """Forgets what it would compare the next measurement with."""

    def measure(self) -> Any:
        """Returns the measurement of now; None where it has to be called again first."""


class SensorTopic:
    """The topic of one sensor; called by the loop's thread.

    Args:
        world: Where the sensor is.
        sensor: The sensor.
        kind: Type of its messages.
        instrument: What measures.
        to_message: Makes the message of a measurement.
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
        self._turn, self._revision = 0, -1

    def tick(self) -> None:
        """Measures and publishes, if it is time to and there is a subscriber."""
        time_ns = self._world.time_ns
        turn = time_ns // self._period_ns
        if turn == self._turn:
            return
        resting = turn < self._turn or self._revision != self._world.revision
        self._turn, self._revision = turn, self._world.revision
        subscribed = self._publisher.get_num_connections() > 0
        if resting or not subscribed:
            self._instrument.rest()
        if not subscribed:
            return
        measured = self._instrument.measure()
        if measured is not None:
            self._publisher.publish(self._to_message(self._sensor, measured, header(self._sensor.frame_id, time_ns)))

    def close(self) -> None:
        """Ends the topic."""
        self._publisher.unregister()


@dataclass(frozen=True, slots=True)
class _ModelSensors:
    """The sensors of one model, and the elements they were read from."""

    elements: object
    topics: tuple[SensorTopic, ...]
    cameras: tuple[Camera, ...]


class SensorTopics:
    """The topics of the sensors of all models but cameras, whose images another process draws.

    Publishes: sensor_msgs/Imu, sensor_msgs/LaserScan, gazebo_msgs/ContactsState and geometry_msgs/WrenchStamped, under
    the names in the descriptions.

    Args:
        world: The models.
        robots: The sensors of robots, which the world has no description of.
        seed: Of noise.
        show_cameras: Takes the cameras of all models whenever they change.
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
        self._said: set[str] = set()
        self._revision = -1
        self.follow()

    def tick(self) -> None:
        """Publishes what is due; called by the loop's thread after every physics step."""
        if self._world.revision != self._revision:
            self.follow()
        for topic in self._topics:
            topic.tick()

    def follow(self) -> None:
        """Opens the topics of new models, and closes those of models that are gone."""
        self._revision = self._world.revision
        wanted = {
            name: self._robots.get(name) or body.spec.sensors
            for name, body in self._world.bodies.items()
            if name in self._robots or (body.spec is not None and body.spec.sensors)
        }
        gone = [name for name, model in self._models.items() if wanted.get(name) is not model.elements]
        new = [name for name in wanted if name not in self._models or name in gone]
        if not gone and not new:
            return
        for name in gone:
            for topic in self._models.pop(name).topics:
                topic.close()
        for name in new:
            self._models[name] = self._open(name, wanted[name])
        self._topics = tuple(topic for model in self._models.values() for topic in model.topics)
        self._show_cameras([camera for model in self._models.values() for camera in model.cameras])

    def close(self) -> None:
        """Frees what rays are cast at; may be called twice."""
        self._scene.close()

    def _open(self, name: str, elements: Any) -> _ModelSensors:
        sensors = self._robots.get(name)
        if sensors is None:
            spec = self._world.body(name).spec
            assert spec is not None
            sensors = read_model_sensors(spec, self._seed)
        for kind, fault in sensors.faults.items():
            if kind not in self._said:
                self._said.add(kind)
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
        raise TypeError(f"no topic for {type(sensor).__name__}")


def noise_seed() -> int:
    """Returns the seed of the noise of sensors: it follows from the parameter /seed, and is random without that.

    Raises:
        SeedError: The parameter is no seed.
    """
    seed = seed_parameter()
    return secrets.randbelow(MAX_SEED) if seed is None else derived_seed(seed, "noise of sensors")
