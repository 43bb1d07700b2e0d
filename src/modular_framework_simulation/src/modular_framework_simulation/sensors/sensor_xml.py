# SPDX-License-Identifier: BSD-3-Clause
"""Elements, plugins and names of sensors, shared by the readers of all sensor types.

Names follow the rules of gazebo_plugins.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import Collision
from modular_framework_simulation.physics.part_names import SCOPE
from modular_framework_simulation.sensors.element_reader import ElementReader

_NO_TOPIC = "__default_topic__"


LinkShapes = Mapping[str, tuple[Collision, ...]]
"""Collision shapes, by link name."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """Properties of all sensors.

    Attributes:
        name: Unique name, model::link::sensor.
        model: Name of the model in the world.
        link: Name of the link that the sensor is fixed to.
        pose: Pose of the sensor in the link frame.
        topic: Topic of the measurements.
        frame_id: Frame in message headers.
        rate_hz: Measurements per second of simulated time [Hz]; 0 for every physics step.
    """

    name: str
    model: str
    link: str
    pose: Pose
    topic: str
    frame_id: str
    rate_hz: float

    @property
    def parent(self) -> str:
        """Returns the link that the sensor is fixed to, as model::link."""
        return f"{self.model}{SCOPE}{self.link}"


@dataclass(frozen=True, slots=True)
class JointPart:
    """Joint of a model with sensors.

    Attributes:
        parent: Name of the parent link, or "world".
        child: Name of the child link.
        kind: Joint type in the description.
    """

    parent: str
    child: str
    kind: str


@dataclass(frozen=True, slots=True)
class ModelParts:
    """Parts of a model that sensors refer to.

    Attributes:
        name: Name of the model in the world.
        links: Collision shapes, by link name.
        joints: Joints, by joint name.
        namespace: Default namespace of the sensors' topics.
    """

    name: str
    links: LinkShapes
    joints: Mapping[str, JointPart]
    namespace: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorXml:
    """Sensor element of a description.

    Attributes:
        model: Model of the sensor.
        scope: Prefix "inner::" of names in an inner model; empty for the outer model.
        sensor: The <sensor>; for a plugin of the model, the <plugin>.
        plugin: The <plugin>; None for a sensor without a plugin.
        file: File name of the plugin without "lib" and ".so".
        link: Name of the sensor's link; empty for a plugin of the model.
        joint: Name of the sensor's joint; empty for a sensor of a link.
        pose: Pose of the sensor in the link frame.
    """

    model: ModelParts
    scope: str
    sensor: ElementReader
    plugin: ElementReader | None
    file: str
    link: str
    joint: str
    pose: Pose

    @property
    def name(self) -> str:
        """Returns the full name, model::link::sensor."""
        own = self.sensor.node.attributes.get("name", "")
        return SCOPE.join(part for part in (self.model.name, self.link, own) if part)

    def require_topic(self, plugins: str) -> str:
        """Returns the <topic> of a sensor without a plugin.

        Args:
            plugins: Names of the possible plugins for the message.

        Raises:
            ValueError: The sensor has no <topic>, so its measurements would not be published.
        """
        topic = self.sensor.text("topic")
        if topic in ("", _NO_TOPIC):
            raise ValueError(f"has no topic; add a <plugin> ({plugins}) or a <topic>")
        return resolved_topic(self.model.namespace, topic)

    def namespace(self) -> str:
        """Returns the plugin's <robotNamespace>; by default, the model's namespace."""
        return self.plugin.text("robotNamespace") or self.model.namespace if self.plugin else self.model.namespace

    def require_link(self, key: str) -> str:
        """Returns the link that an element of the plugin names; by default, the sensor's link.

        Raises:
            ValueError: The model has no link of this name.
        """
        name = self.plugin.text(key) if self.plugin is not None else ""
        link = f"{self.scope}{name.rpartition(SCOPE)[2]}" if name else self.link
        if link not in self.model.links:
            raise ValueError(f"<{key}>: got '{name}'; allowed: a link of the model: {', '.join(self.model.links)}")
        return link


def resolved_topic(namespace: str, topic: str) -> str:
    """Returns the full name of a topic in a namespace; a name that starts with "/" is not changed."""
    base = namespace.rstrip("/")
    return topic if topic.startswith("/") or not base else f"{base}/{topic}"


def prefixed_frame(namespace: str, frame: str) -> str:
    """Returns a frame with the namespace as prefix; a leading "/" prevents the prefix and is removed, as in tf2."""
    base = namespace.strip("/")
    return frame.lstrip("/") if frame.startswith("/") or not base else f"{base}/{frame}"


def slower_of(first_hz: float, second_hz: float) -> float:
    """Returns the lower of two rates [Hz]; 0 stands for no limit."""
    return min((rate for rate in (first_hz, second_hz) if rate), default=0.0)
