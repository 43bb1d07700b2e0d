# SPDX-License-Identifier: BSD-3-Clause
"""Laser scanners, which measure distances to collision shapes along rays in the sensor's x-y plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.sensors.noise import NO_NOISE, Noise, NoiseSource
from modular_framework_simulation.sensors.ray_scene import RayScene
from modular_framework_simulation.sensors.sensor_xml import Sensor, SensorXml, prefixed_frame, resolved_topic
from modular_framework_urdf.rotations import rotate_vector

TYPES = ("ray", "gpu_ray", "lidar", "gpu_lidar")
PLUGINS = ("gazebo_ros_laser", "gazebo_ros_gpu_laser")
_MAX_SAMPLES = 100_000
_DEFAULT_TOPIC = _DEFAULT_FRAME = "/world"
"""Default names of gazebo_plugins."""


@dataclass(frozen=True, slots=True)
class LaserSensor(Sensor):
    """Laser scanner.

    Attributes:
        samples: Number of rays per scan.
        min_angle: Angle of the first ray about the z axis, from the x axis [rad].
        max_angle: Angle of the last ray [rad].
        min_range: Minimum measured distance [m].
        max_range: Maximum measured distance [m].
        noise: Noise of a distance [m].
    """

    samples: int = 640
    min_angle: float = 0.0
    max_angle: float = 0.0
    min_range: float = 0.0
    max_range: float = 10.0
    noise: Noise = NO_NOISE

    def angles(self) -> npt.NDArray[np.float64]:
        """Returns the angles of the rays, shape (samples,) [rad]; a single ray points along x."""
        if self.samples == 1:
            return np.zeros(1)
        return np.linspace(self.min_angle, self.max_angle, self.samples)

    @property
    def angle_increment(self) -> float:
        """Returns the angle between neighbouring rays [rad]."""
        return (self.max_angle - self.min_angle) / (self.samples - 1) if self.samples > 1 else 0.0


def read_laser(xml: SensorXml) -> LaserSensor:
    """Reads a <sensor> of a type in `TYPES`.

    Raises:
        ValueError: A value is unsupported or invalid.
    """
    topic, frame = _names(xml)
    root = "ray" if xml.sensor.find("ray") is not None else "lidar"
    scan, bounds = f"{root}/scan", f"{root}/range"
    rows = xml.sensor.number(f"{scan}/vertical/samples", 1.0)
    if rows > 1:
        raise ValueError(f"<{scan}/vertical/samples>: got {rows:g}; allowed: 1, because LaserScan has a single row")
    per_sample = xml.sensor.number(f"{scan}/horizontal/resolution", 1.0)
    samples = round(xml.sensor.number(f"{scan}/horizontal/samples", 640.0) * per_sample)
    if not 1 <= samples <= _MAX_SAMPLES:
        raise ValueError(f"<{scan}/horizontal/samples>: got {samples}; allowed: 1 to {_MAX_SAMPLES:,}")
    low, high = (xml.sensor.number(f"{scan}/horizontal/{key}_angle", 0.0) for key in ("min", "max"))
    if high < low:
        raise ValueError(f"<{scan}/horizontal/max_angle>: got {high:g} rad; allowed: {low:g} (min_angle) or more")
    near, far = xml.sensor.number(f"{bounds}/min", 0.0, 0.0), xml.sensor.number(f"{bounds}/max", 0.0)
    if not near < far:
        raise ValueError(f"<{bounds}/max>: got {far:g} m; allowed: more than {near:g} (min)")
    return LaserSensor(
        *(xml.name, xml.model.name, xml.link, xml.pose, topic, frame, xml.sensor.number("update_rate", 0.0, 0.0)),
        samples=samples,
        min_angle=low,
        max_angle=high,
        min_range=near,
        max_range=far,
        noise=xml.sensor.noise(f"{root}/noise"),
    )


def _names(xml: SensorXml) -> tuple[str, str]:
    if xml.plugin is None:
        return xml.require_topic(", ".join(PLUGINS)), xml.link
    namespace = xml.namespace()
    topic, frame = xml.plugin.text("topicName", _DEFAULT_TOPIC), xml.plugin.text("frameName", _DEFAULT_FRAME)
    return resolved_topic(namespace, topic), prefixed_frame(namespace, frame)


class Laser:
    """Measures the distances of a laser scanner.

    Args:
        world: World of the sensor.
        sensor: Description of the sensor.
        scene: Collision shapes of the world.
        seed: Random seed of the simulation.
    """

    def __init__(self, world: PhysicsWorld, sensor: LaserSensor, scene: RayScene, seed: int) -> None:
        self._world, self._sensor, self._scene = world, sensor, scene
        self._noise = NoiseSource(seed, sensor.name, (sensor.noise,))
        angles = sensor.angles()
        self._directions = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)

    def reset(self) -> None:
        """Does nothing, because the sensor has no state."""

    def measure(self) -> npt.NDArray[np.float64]:
        """Returns the distances along the rays, shape (samples,) [m].

        A distance is infinity without a hit, and minus infinity if a shape is closer than `min_range` (REP 117).
        """
        sensor = self._sensor
        pose = self._world.entity_state(sensor.parent).pose @ sensor.pose
        directions = self._directions @ _axes(pose)
        starts, ends = (pose.position + directions * distance for distance in (sensor.min_range, sensor.max_range))
        span = sensor.max_range - sensor.min_range
        ranges = sensor.min_range + span * self._scene.cast(starts, ends)
        ranges[np.isnan(ranges)] = np.inf
        ranges[ranges <= sensor.min_range] = -np.inf
        measured = np.isfinite(ranges)
        noisy = self._noise.add_noise(ranges[None, :], self._world.time_ns)[0]
        return np.where(measured, np.clip(noisy, sensor.min_range, sensor.max_range), ranges)


def _axes(pose: Pose) -> npt.NDArray[np.float64]:
    """Returns the axes of a frame as rows, shape (3, 3)."""
    units = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return np.array([rotate_vector(pose.quaternion, unit) for unit in units])
