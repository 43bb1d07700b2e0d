# SPDX-License-Identifier: BSD-3-Clause
"""What the readers of all kinds of sensors share: the element, its plugin, and names as gazebo_plugins makes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import Collision
from modular_framework_simulation.physics.part_names import SCOPE
from modular_framework_simulation.sensors.element_reader import ElementReader

_WITHOUT_TOPIC = "__default_topic__"


LinkShapes = Mapping[str, tuple[Collision, ...]]
"""Collision shapes by the name of their link."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """What all sensors have.

    Attributes:
        name: model::link::sensor; differs from sensor to sensor.
        model: Instance name of the model it belongs to.
        link: Name of the link it is fastened to.
        pose: In the frame of the link.
        topic: Where its measurements are published.
        frame_id: For the headers of its messages.
        rate_hz: Measurements in a second of simulated time; 0: one in every physics step.
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
        """The link it is fastened to: model::link."""
        return f"{self.model}{SCOPE}{self.link}"


@dataclass(frozen=True, slots=True)
class JointPart:
    """A joint of a model with a sensor.

    Attributes:
        parent: The link that carries it, or "world".
        child: The link it carries.
        kind: Its type, as in the description.
    """

    parent: str
    child: str
    kind: str


@dataclass(frozen=True, slots=True)
class ModelParts:
    """What a model has that sensors can be in.

    Attributes:
        name: Instance name.
        links: Collision shapes of every link, by its name.
        joints: By name.
        namespace: Of its topics, where the description names none.
    """

    name: str
    links: LinkShapes
    joints: Mapping[str, JointPart]
    namespace: str = ""


@dataclass(frozen=True, slots=True)
class SensorXml:
    """One sensor as its file has it.

    Attributes:
        model: The model it is in.
        scope: "inner::" for one in an inner model, which names stand below.
        sensor: The <sensor>; for a <plugin> of the model that one.
        plugin: The <plugin>; None where there is none.
        file: File name of the plugin, without lib and .so.
        link: The link it is in; empty for a <plugin> of the model.
        joint: The joint it is in; mostly empty.
        pose: In the frame of the link.
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
        """The full name: model::link::sensor."""
        own = self.sensor.node.attributes.get("name", "")
        return SCOPE.join(part for part in (self.model.name, self.link, own) if part)

    def require_topic(self, plugins: str) -> str:
        """Returns the <topic> of a sensor without a plugin.

        Args:
            plugins: Those that could be there, for the message.

        Raises:
            ValueError: There is none, so that nothing would be published.
        """
        topic = self.sensor.text("topic")
        if topic in ("", _WITHOUT_TOPIC):
            raise ValueError(f"nothing publishes it; add a <plugin> ({plugins}) or a <topic>")
        return resolved(self.model.namespace, topic)

    def namespace(self) -> str:
        """Returns the <robotNamespace> of the plugin; that of the model where it has none."""
        return self.plugin.text("robotNamespace") or self.model.namespace if self.plugin else self.model.namespace

    def require_link(self, key: str) -> str:
        """Returns the link that a key of the plugin names; by default the one it is in.

        Raises:
            ValueError: The model has no such link.
        """
        given = self.plugin.text(key) if self.plugin is not None else ""
        link = f"{self.scope}{given.rpartition(SCOPE)[2]}" if given else self.link
        if link not in self.model.links:
            raise ValueError(f"<{key}>: got '{given}'; allowed: a link of the model: {', '.join(self.model.links)}")
        return link


def resolved(namespace: str, topic: str) -> str:
    """Returns a topic below a namespace, unless it begins with "/"."""
    base = namespace.rstrip("/")
    return topic if topic.startswith("/") or not base else f"{base}/{topic}"


def prefixed(namespace: str, frame: str) -> str:
    """Returns a frame with the namespace as its prefix, unless it begins with "/"; tf2 has no leading "/"."""
    base = namespace.strip("/")
    return frame.lstrip("/") if frame.startswith("/") or not base else f"{base}/{frame}"


def slower_of(first_hz: float, second_hz: float) -> float:
    """Returns the lower of two rates, of which 0 means no bound."""
    return min((rate for rate in (first_hz, second_hz) if rate), default=0.0)
