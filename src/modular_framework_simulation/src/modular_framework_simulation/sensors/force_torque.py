# SPDX-License-Identifier: BSD-3-Clause
"""Force-torque sensors, which measure the load on a joint as in Gazebo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modular_framework_simulation.errors import UnknownEntityError
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import WORLD
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.sensors.noise import NO_NOISE, Noise, NoiseSource
from modular_framework_simulation.sensors.sensor_xml import JointPart, Sensor, SensorXml, resolved_topic
from modular_framework_urdf.rotations import Vector3, rotate_vector

TYPES = ("force_torque",)
PLUGINS = ("gazebo_ros_ft_sensor",)
DEFAULT_RATE_HZ = 100.0

_MEASURED_JOINTS = ("fixed", "revolute", "continuous")
"""Joint types of the sensors; the engine's reaction on a prismatic joint differs from the carried weight."""
_FRAMES = ("child", "parent", "sensor")
_DIRECTIONS = ("child_to_parent", "parent_to_child")

Noises = tuple[Noise, Noise, Noise, Noise, Noise, Noise]
_NO_NOISES: Noises = (NO_NOISE, NO_NOISE, NO_NOISE, NO_NOISE, NO_NOISE, NO_NOISE)


@dataclass(frozen=True, slots=True)
class ForceTorqueSensor(Sensor):
    """Force-torque sensor of a joint; the sensor's link is the child of the joint.

    Attributes:
        joint: Name of the joint.
        parent_link: Name of the joint's parent link.
        in_frame: Frame of the wrench: "child", "parent" or "sensor".
        of_child: Whether the child's wrench on the parent is measured, instead of the parent's wrench on the child.
        noise: Noise of the force x, y, z [N] and of the torque x, y, z [Nm].
    """

    joint: str = ""
    parent_link: str = ""
    in_frame: str = "child"
    of_child: bool = True
    noise: Noises = _NO_NOISES


@dataclass(frozen=True, slots=True)
class Wrench:
    """Force [N] and torque [Nm]."""

    force: Vector3
    torque: Vector3


def read_force_torque(xml: SensorXml) -> ForceTorqueSensor:
    """Reads a <sensor type="force_torque"> of a joint, or libgazebo_ros_ft_sensor.so.

    Raises:
        ValueError: A value is unsupported or invalid.
    """
    in_plugin = xml.plugin is not None and not xml.joint
    joint = f"{xml.scope}{xml.plugin.text('jointName')}" if in_plugin and xml.plugin else xml.joint
    allowed = [name for name, part in xml.model.joints.items() if part.kind in _MEASURED_JOINTS]
    if joint not in allowed:
        key = "<jointName>: got" if in_plugin else "is in joint"
        raise ValueError(f"{key} '{joint}'; allowed are fixed and revolute joints: {', '.join(allowed)}")
    part = xml.model.joints[joint]
    if xml.plugin is None:
        return _read_joint_sensor(xml, joint, part)
    noise = Noise(stddev=xml.plugin.number("gaussianNoise", 0.0, 0.0))
    return ForceTorqueSensor(
        *(xml.name, xml.model.name, part.child, Pose()),
        resolved_topic(xml.namespace(), xml.plugin.text("topicName", "wrench")),
        xml.plugin.text("frameName", part.child.rpartition("::")[2]),
        xml.plugin.number("updateRate", 0.0, 0.0) or DEFAULT_RATE_HZ,
        joint,
        part.parent,
        noise=(noise,) * 6,
    )


def _read_joint_sensor(xml: SensorXml, joint: str, part: JointPart) -> ForceTorqueSensor:
    topic = xml.require_topic(f"{PLUGINS[0]}, of the model")
    in_frame = xml.sensor.text("force_torque/frame", "child")
    direction = xml.sensor.text("force_torque/measure_direction", "child_to_parent")
    for key, value, allowed in (("frame", in_frame, _FRAMES), ("measure_direction", direction, _DIRECTIONS)):
        if value not in allowed:
            raise ValueError(f"<force_torque/{key}>: got '{value}'; allowed: {', '.join(allowed)}")
    noises = [xml.sensor.noise(f"force_torque/{kind}/{axis}/noise") for kind in ("force", "torque") for axis in "xyz"]
    return ForceTorqueSensor(
        *(xml.name, xml.model.name, part.child, xml.pose, topic, part.child.rpartition("::")[2]),
        xml.sensor.number("update_rate", 0.0, 0.0) or DEFAULT_RATE_HZ,
        joint,
        part.parent,
        in_frame,
        direction == "child_to_parent",
        (noises[0], noises[1], noises[2], noises[3], noises[4], noises[5]),
    )


class JointLoad:
    """Measures the load on a joint of a model.

    Args:
        world: World of the model.
        sensor: Description of the sensor.
        seed: Random seed of the simulation.

    Raises:
        UnknownEntityError: The model or the joint does not exist.
    """

    def __init__(self, world: PhysicsWorld, sensor: ForceTorqueSensor, seed: int = 0) -> None:
        self._world, self._sensor = world, sensor
        self._noise = NoiseSource(seed, sensor.name, sensor.noise)
        self._body_ids: tuple[int, ...] = ()  # instance and body ids of the model at the last search of the joint
        self._measured = False
        self._find()

    def _find(self) -> None:
        """Finds the joint in the engine."""
        body = self._world.body(self._sensor.model)
        known: list[str] = []
        for tree in body.parts:
            joints = {joint.name: joint.index for joint in self._world.engine.joints(tree.number)}
            index = joints.get(self._sensor.joint)
            if index is not None:
                break
            known += joints
        else:
            raise UnknownEntityError("joint", f"{self._sensor.model}::{self._sensor.joint}", known)
        self._tree, self._index = tree, index
        joints_of_spec = body.spec.joints if body.spec is not None else ()
        self._joint_in_child = next((each.pose for each in joints_of_spec if each.name == self._sensor.joint), Pose())

    def reset(self) -> None:
        """Discards the state of the measurement; the next call of `measure` starts again."""
        self._measured = False

    def measure(self) -> Wrench | None:
        """Returns the wrench of the last physics step; None for the first step, which the engine has not measured."""
        model = self._sensor.model
        body_ids = (self._world.instance(model), *(part.number for part in self._world.body(model).parts))
        if body_ids != self._body_ids:  # restarts and changes of the mass create a new body
            self._body_ids, self._measured = body_ids, False
            self._find()
            self._world.engine.measure_joint_load(self._tree.number, self._index)
            self._world.rest.disturb()
        measured, self._measured = self._measured, True
        return self._with_noise(self._wrench()) if measured else None

    def _wrench(self) -> Wrench:
        """Returns the wrench of the child link on its parent, or of the parent on the child, as the sensor specifies.

        The reference point is the origin of the joint, and the default frame is the child link's, as in Gazebo.
        """
        rotation = self._axes_of_joint().quaternion
        load = self._world.engine.joint_load(self._tree.number, self._index)
        force, torque = (rotate_vector(rotation, each) for each in load)
        return Wrench(force, torque) if self._sensor.of_child else Wrench(_negative(force), _negative(torque))

    def _axes_of_joint(self) -> Pose:
        """Returns the pose of the joint in the frame of the wrench."""
        sensor = self._sensor
        match sensor.in_frame:
            case "child":
                return self._joint_in_child
            case "sensor":
                return sensor.pose.inverse() @ self._joint_in_child
        body = self._world.body(sensor.model)
        parent_in_world = body.link_state(sensor.parent_link).pose if sensor.parent_link != WORLD else Pose()
        return parent_in_world.inverse() @ body.link_state(sensor.link).pose @ self._joint_in_child

    def _with_noise(self, wrench: Wrench) -> Wrench:
        exact = np.array([*wrench.force, *wrench.torque])
        noisy = self._noise.add_noise(exact, self._world.time_ns)
        if noisy is exact:
            return wrench
        fx, fy, fz, tx, ty, tz = noisy.tolist()
        return Wrench((fx, fy, fz), (tx, ty, tz))


def _negative(vector: Vector3) -> Vector3:
    x, y, z = vector
    return (-x, -y, -z)
