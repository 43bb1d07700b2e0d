# SPDX-License-Identifier: BSD-3-Clause
"""Force-torque sensors: the load on a joint, as Gazebo's sensor measures it."""

from __future__ import annotations

from dataclasses import dataclass

from modular_framework_simulation.errors import UnknownEntityError
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_urdf import xml_text
from modular_framework_urdf.rotations import Vector3
from modular_framework_urdf.xml_text import Element

DEFAULT_RATE_HZ = 100.0
_PLUGIN = "gazebo_ros_ft_sensor"


@dataclass(frozen=True, slots=True)
class ForceTorqueSensor:
    """A sensor in a joint of a robot.

    Attributes:
        joint: Name of the joint.
        child_link: The link that the joint carries, in whose frame is measured.
        topic: Where its measurements are published.
        frame_id: For the headers of its messages.
        rate_hz: Measurements in a second of simulated time.
    """

    joint: str
    child_link: str
    topic: str
    frame_id: str
    rate_hz: float = DEFAULT_RATE_HZ


@dataclass(frozen=True, slots=True)
class Wrench:
    """Force [N] and torque [Nm]."""

    force: Vector3
    torque: Vector3


def read_force_torque_sensors(text: str) -> tuple[list[ForceTorqueSensor], list[str]]:
    """Reads the sensors of a robot's URDF: `<plugin filename="libgazebo_ros_ft_sensor.so">` in a `<gazebo>`.

    Args:
        text: URDF that the simulation has read before.

    Returns:
        The usable sensors, and one sentence for each that is not usable.
    """
    root = xml_text.parse(text, "robot_description")
    # The engine's reaction on a slide differs from the weight it carries.
    joints = [joint for joint in root.findall("joint") if joint.get("type") in ("fixed", "revolute", "continuous")]
    children = {joint.get("name"): joint.find("child").get("link") for joint in joints}
    sensors, faults = [], []
    for plugin in root.iterfind("gazebo/plugin"):
        if _PLUGIN not in plugin.get("filename", ""):
            continue
        try:
            sensors.append(_sensor(plugin, children))
        except ValueError as error:
            where = f"robot_description:{plugin.sourceline}: <plugin name='{plugin.get('name', '')}'>"
            faults.append(f"{where}: {error}; this sensor is not simulated")
    return sensors, faults


def _sensor(plugin: Element, children: dict[str, str]) -> ForceTorqueSensor:
    def text(key: str, default: str) -> str:
        return (plugin.findtext(key) or "").strip() or default

    joint = text("jointName", "")
    if joint not in children:
        raise ValueError(
            f"<jointName>: got '{joint}'; allowed are joints that are fixed or turn: {', '.join(children)}"
        )
    numbers = {}
    for key in ("updateRate", "gaussianNoise"):
        try:
            numbers[key] = float(text(key, "0"))
        except ValueError:
            raise ValueError(f"<{key}>: got '{text(key, '')}'; expected a number") from None
    if numbers["gaussianNoise"] != 0.0:
        raise ValueError(f"<gaussianNoise>: got {numbers['gaussianNoise']:g}; allowed: 0, noise is not simulated")
    namespace, topic, child = text("robotNamespace", "").rstrip("/"), text("topicName", "wrench"), children[joint]
    name = topic if topic.startswith("/") or not namespace else f"{namespace}/{topic}"
    return ForceTorqueSensor(joint, child, name, text("frameName", child), numbers["updateRate"] or DEFAULT_RATE_HZ)


class JointLoad:
    """Measures the load on a joint of a model.

    Args:
        world: Where the model is.
        model: Its name.
        sensor: The joint.

    Raises:
        UnknownEntityError: There is no such model or joint.
    """

    def __init__(self, world: PhysicsWorld, model: str, sensor: ForceTorqueSensor) -> None:
        self._world, self._model, self._sensor = world, model, sensor
        self._instance = -1
        self._find()

    def _find(self) -> None:
        """Finds the joint in the engine."""
        joints = {joint.name: joint for joint in self._world.engine.joints(self._world.body(self._model).number)}
        joint = joints.get(self._sensor.joint)
        if joint is None:
            raise UnknownEntityError("joint", f"{self._model}::{self._sensor.joint}", list(joints))
        self._index = joint.index

    def start(self) -> None:
        """Lets the engine measure from the next step on; to be called before each measurement."""
        instance = self._world.instance(self._model)
        if instance != self._instance:  # also after a restart, which creates the body again
            self._instance = instance
            self._find()
            self._world.engine.measure_joint_load(self._world.body(self._model).number, self._index)

    def measure(self) -> Wrench:
        """Returns the wrench with which the child link acts on its parent, in the last physics step.

        It is given about the origin of the child link, which is that of the joint, and in its axes: Gazebo's defaults.
        """
        return Wrench(*self._world.engine.joint_load(self._world.body(self._model).number, self._index))
