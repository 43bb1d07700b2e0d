# SPDX-License-Identifier: BSD-3-Clause
"""Contact sensors: which collision shapes of a link touch which others, where, and with what force."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.part_names import SCOPE
from modular_framework_simulation.physics.physics_world import ContactPoint, PhysicsWorld
from modular_framework_simulation.physics.simulated_body import add, cross
from modular_framework_simulation.sensors.nearest_shape import nearest_shape
from modular_framework_simulation.sensors.sensor_xml import LinkShapes, Sensor, SensorXml, resolved
from modular_framework_urdf.rotations import Vector3, rotate_vector

TYPES = ("contact",)
PLUGINS = ("gazebo_ros_bumper",)
WORLD_FRAMES = ("world", "map")

_LUMPED = re.compile(r".*_fixed_joint_lump__(.+)")
_NUMBERED = re.compile(r"(.+)_\d+")


@dataclass(frozen=True, slots=True)
class ContactSensor(Sensor):
    """A contact sensor.

    Attributes:
        collisions: Names of the shapes of its link that feel.
        measured_in: Link of the model in whose frame positions and forces are given; empty: the world.
    """

    collisions: tuple[str, ...] = ()
    measured_in: str = ""


@dataclass(frozen=True, slots=True)
class Touch:
    """One point where two shapes touch.

    Attributes:
        position: [m]
        normal: Unit vector, out of the other shape.
        depth: How deep they are in each other [m].
        force: On the link of the sensor [N].
        torque: About the centre of mass of that link [Nm].
    """

    position: Vector3
    normal: Vector3
    depth: float
    force: Vector3
    torque: Vector3


@dataclass(slots=True)
class TouchedPair:
    """Two shapes that touch, each as model::link::collision, that of the sensor first."""

    own: str
    other: str
    touches: list[Touch] = field(default_factory=list)


def read_contact(xml: SensorXml) -> ContactSensor:
    """Reads a <sensor type="contact">.

    Raises:
        ValueError: A value cannot be used.
    """
    rate = xml.sensor.number("update_rate", 0.0, 0.0)
    if xml.plugin is None:
        topic, frame = xml.require_topic(", ".join(PLUGINS)), "world"
    else:
        topic = resolved(xml.namespace(), xml.plugin.text("bumperTopicName", "bumper_states"))
        frame = xml.plugin.text("frameName", "world").lstrip("/")
    measured_in = "" if frame in WORLD_FRAMES else f"{xml.scope}{frame.rpartition(SCOPE)[2]}"
    if measured_in and measured_in not in xml.model.links:
        allowed = f"world, or a link of the model: {', '.join(xml.model.links)}"
        raise ValueError(f"<frameName>: got '{frame}'; allowed: {allowed}")
    link, collisions = _shapes(xml)
    return ContactSensor(xml.name, xml.model.name, link, xml.pose, topic, frame, rate, collisions, measured_in)


def _shapes(xml: SensorXml) -> tuple[str, tuple[str, ...]]:
    """Returns the link of the shapes that a sensor names, and their names."""
    xml.sensor.find("contact/collision")
    contact = xml.sensor.find("contact")
    nodes = contact.find_all("collision") if contact is not None else []
    if not nodes:
        raise ValueError("<contact>: has no <collision>; name a collision shape of the link")
    own = {name: xml.link for name in (each.name for each in xml.model.links.get(xml.link, ()))}
    every = {each.name: link for link, shapes in xml.model.links.items() for each in shapes} | own
    found: dict[str, str] = {}
    for node in nodes:
        given = node.text.strip()
        name = _known(given.rpartition(SCOPE)[2], every)
        if name is None:
            raise ValueError(f"<contact/collision>: got '{given}'; allowed: {', '.join(every)}")
        found[name] = every[name]
    if len(set(found.values())) > 1:
        raise ValueError(f"<contact/collision>: got shapes of {', '.join(set(found.values()))}; allowed: of one link")
    return next(iter(found.values())), tuple(found)


def _known(name: str, every: Mapping[str, str]) -> str | None:
    """Returns the shape of a name; Gazebo renames those of links that it lumps together."""
    lumped = _LUMPED.fullmatch(name)
    short = lumped.group(1) if lumped else name
    numbered = _NUMBERED.fullmatch(short)
    candidates = (name, short, numbered.group(1) if lumped and numbered else name)
    return next((each for each in candidates if each in every), None)


class ContactListener:
    """Measures with a contact sensor.

    Args:
        world: Where it is.
        sensor: The sensor.
        shapes: Collision shapes of the model.
    """

    def __init__(self, world: PhysicsWorld, sensor: ContactSensor, shapes: LinkShapes) -> None:
        self._world, self._sensor, self._shapes = world, sensor, shapes

    def rest(self) -> None:
        """Has nothing to forget."""

    def measure(self) -> list[TouchedPair]:
        """Returns the pairs of shapes that touch in the last physics step."""
        sensor, world = self._sensor, self._world
        points = world.contact_points(sensor.model, sensor.link)
        if not points:
            return []
        centre = world.centre_of_mass(sensor.model, sensor.link)
        frame = world.entity_state(f"{sensor.model}{SCOPE}{sensor.measured_in}").pose if sensor.measured_in else Pose()
        pairs: dict[tuple[str, str], TouchedPair] = {}
        for point in points:
            own_link, own = self._shape(sensor.model, sensor.link, self._shapes, point)
            if own_link != sensor.link or own not in sensor.collisions:
                continue
            other_link, other = self._shape(point.model, point.other_link, self._shapes_of(point.model), point)
            names = (SCOPE.join((sensor.model, own_link, own)), SCOPE.join((point.model, other_link, other)))
            pairs.setdefault(names, TouchedPair(*names)).touches.append(_touch(point, centre, frame.inverse()))
        return list(pairs.values())

    def _shapes_of(self, model: str) -> LinkShapes:
        if model == self._sensor.model:
            return self._shapes
        spec = self._world.body(model).spec
        return {link.name: link.collisions for link in spec.links} if spec is not None else {}

    def _shape(self, model: str, link: str, shapes: LinkShapes, point: ContactPoint) -> tuple[str, str]:
        """Returns the link and the name of the shape at a point.

        A static model is one body for the engine: all its links come into question.
        """
        body = self._world.body(model)
        links: Sequence[str] = list(shapes) if body.static and body.spec is not None else [link]
        candidates = [(each, shape) for each in links for shape in shapes.get(each, ())]
        if len(candidates) == 1:
            return candidates[0][0], candidates[0][1].name
        placed = [(body.link_state(each).pose @ shape.pose, shape.geometry) for each, shape in candidates]
        if not placed:
            return link, f"{link}_collision"
        owner, shape = candidates[nearest_shape(placed, point.position)]
        return owner, shape.name


def _touch(point: ContactPoint, centre: Vector3, to_frame: Pose) -> Touch:
    arm = add(point.position, (-centre[0], -centre[1], -centre[2]))
    turned = [rotate_vector(to_frame.quaternion, each) for each in (point.normal, point.force, cross(arm, point.force))]
    return Touch((to_frame @ Pose(point.position)).position, turned[0], point.depth, turned[1], turned[2])
