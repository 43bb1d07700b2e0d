# SPDX-License-Identifier: BSD-3-Clause
"""Contact sensors, which measure the contacts of a link's collision shapes: partner, position and force."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import load_mesh
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.part_names import SCOPE
from modular_framework_simulation.physics.physics_world import ContactPoint, PhysicsWorld
from modular_framework_simulation.physics.simulated_body import add, cross
from modular_framework_simulation.sensors.sensor_xml import LinkShapes, Sensor, SensorXml, resolved_topic
from modular_framework_urdf.rotations import Vector3, rotate_vector

TYPES = ("contact",)
PLUGINS = ("gazebo_ros_bumper",)
WORLD_FRAMES = ("world", "map")

_MERGED_NAME = re.compile(r".*_fixed_joint_lump__(.+)")
_NUMBERED_NAME = re.compile(r"(.+)_\d+")


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactSensor(Sensor):
    """Contact sensor.

    Attributes:
        collisions: Names of the link's collision shapes that the sensor observes.
        reference_link: Link of the model that is the frame of positions and forces; empty for the world frame.
    """

    collisions: tuple[str, ...] = ()
    reference_link: str = ""


@dataclass(frozen=True, slots=True)
class MeasuredContact:
    """Contact point between two shapes, in the frame of the measurement.

    Attributes:
        position: Position of the point [m].
        normal: Unit normal that points out of the other shape.
        depth: Penetration depth [m].
        force: Force on the sensor's link [N].
        torque: Torque about the centre of mass of the sensor's link [Nm].
    """

    position: Vector3
    normal: Vector3
    depth: float
    force: Vector3
    torque: Vector3


@dataclass(slots=True)
class ContactPair:
    """Two shapes in contact, as model::link::collision, with the sensor's shape first."""

    own: str
    other: str
    contacts: list[MeasuredContact] = field(default_factory=list)


def read_contact(xml: SensorXml) -> ContactSensor:
    """Reads a <sensor type="contact">.

    Raises:
        ValueError: A value is unsupported or invalid.
    """
    rate = xml.sensor.number("update_rate", 0.0, 0.0)
    if xml.plugin is None:
        topic, frame = xml.require_topic(", ".join(PLUGINS)), "world"
    else:
        topic = resolved_topic(xml.namespace(), xml.plugin.text("bumperTopicName", "bumper_states"))
        frame = xml.plugin.text("frameName", "world").lstrip("/")
    reference_link = "" if frame in WORLD_FRAMES else f"{xml.scope}{frame.rpartition(SCOPE)[2]}"
    if reference_link and reference_link not in xml.model.links:
        allowed = f"world, or a link of the model: {', '.join(xml.model.links)}"
        raise ValueError(f"<frameName>: got '{frame}'; allowed: {allowed}")
    link, collisions = _shapes(xml)
    return ContactSensor(
        name=xml.name,
        model=xml.model.name,
        link=link,
        pose=xml.pose,
        topic=topic,
        frame_id=frame,
        rate_hz=rate,
        collisions=collisions,
        reference_link=reference_link,
    )


def _shapes(xml: SensorXml) -> tuple[str, tuple[str, ...]]:
    """Returns the link and the names of the collision shapes that a sensor observes."""
    xml.sensor.find("contact/collision")
    contact = xml.sensor.find("contact")
    nodes = contact.find_all("collision") if contact is not None else []
    if not nodes:
        raise ValueError("<contact>: has no <collision>; add the name of a collision shape of the link")
    own = {name: xml.link for name in (each.name for each in xml.model.links.get(xml.link, ()))}
    known_shapes = {each.name: link for link, shapes in xml.model.links.items() for each in shapes} | own
    found: dict[str, str] = {}
    for node in nodes:
        full_name = node.text.strip()
        name = _known_shape(full_name.rpartition(SCOPE)[2], known_shapes)
        if name is None:
            raise ValueError(f"<contact/collision>: got '{full_name}'; allowed: {', '.join(known_shapes)}")
        found[name] = known_shapes[name]
    if len(set(found.values())) > 1:
        raise ValueError(f"<contact/collision>: got shapes of {', '.join(set(found.values()))}; allowed: one link")
    return next(iter(found.values())), tuple(found)


def _known_shape(name: str, known_shapes: Mapping[str, str]) -> str | None:
    """Returns the shape that a name refers to; Gazebo renames the shapes of links merged by fixed joints."""
    merged = _MERGED_NAME.fullmatch(name)
    short = merged.group(1) if merged else name
    numbered = _NUMBERED_NAME.fullmatch(short)
    candidates = (name, short, numbered.group(1) if merged and numbered else name)
    return next((each for each in candidates if each in known_shapes), None)


class ContactListener:
    """Measures the contacts of a contact sensor.

    Args:
        world: World of the sensor.
        sensor: Description of the sensor.
        shapes: Collision shapes of the model.
    """

    def __init__(self, world: PhysicsWorld, sensor: ContactSensor, shapes: LinkShapes) -> None:
        self._world, self._sensor, self._shapes = world, sensor, shapes

    def reset(self) -> None:
        """Does nothing, because the sensor has no state."""

    def measure(self) -> list[ContactPair]:
        """Returns the pairs of shapes in contact during the last physics step."""
        sensor, world = self._sensor, self._world
        points = world.contact_points(sensor.model, sensor.link)
        if not points:
            return []
        centre = world.centre_of_mass(sensor.model, sensor.link)
        frame = (
            world.entity_state(f"{sensor.model}{SCOPE}{sensor.reference_link}").pose
            if sensor.reference_link
            else Pose()
        )
        pairs: dict[tuple[str, str], ContactPair] = {}
        for point in points:
            own_link, own = self._shape(sensor.model, sensor.link, self._shapes, point)
            if own_link != sensor.link or own not in sensor.collisions:
                continue
            other_link, other = self._shape(point.model, point.other_link, self._shapes_of(point.model), point)
            names = (SCOPE.join((sensor.model, own_link, own)), SCOPE.join((point.model, other_link, other)))
            pairs.setdefault(names, ContactPair(*names)).contacts.append(
                _measured_contact(point, centre, frame.inverse())
            )
        return list(pairs.values())

    def _shapes_of(self, model: str) -> LinkShapes:
        if model == self._sensor.model:
            return self._shapes
        spec = self._world.body(model).spec
        return {link.name: link.collisions for link in spec.links} if spec is not None else {}

    def _shape(self, model: str, link: str, shapes: LinkShapes, point: ContactPoint) -> tuple[str, str]:
        """Returns the link and the name of the shape at a contact point.

        The engine represents a static model as one body, so the point can belong to any link of the model.
        """
        body = self._world.body(model)
        links: Sequence[str] = list(shapes) if body.static and body.spec is not None else [link]
        candidates = [(each, shape) for each in links for shape in shapes.get(each, ())]
        if len(candidates) == 1:
            return candidates[0][0], candidates[0][1].name
        posed_shapes = [(body.link_state(each).pose @ shape.pose, shape.geometry) for each, shape in candidates]
        if not posed_shapes:
            return link, f"{link}_collision"
        owner, shape = candidates[nearest_shape(posed_shapes, point.position)]
        return owner, shape.name


def _measured_contact(point: ContactPoint, centre: Vector3, to_frame: Pose) -> MeasuredContact:
    arm = add(point.position, (-centre[0], -centre[1], -centre[2]))
    rotated = [
        rotate_vector(to_frame.quaternion, each) for each in (point.normal, point.force, cross(arm, point.force))
    ]
    return MeasuredContact((to_frame @ Pose(point.position)).position, rotated[0], point.depth, rotated[1], rotated[2])


def nearest_shape(posed_shapes: Sequence[tuple[Pose, specs.Geometry]], point: Vector3) -> int:
    """Returns the index of the shape whose surface is nearest to a point; the bounding box represents a mesh.

    Args:
        posed_shapes: Shapes with their poses in the world frame.
        point: Point in the world frame [m].
    """
    distances = [abs(_distance(shape, (pose.inverse() @ Pose(point)).position)) for pose, shape in posed_shapes]
    return distances.index(min(distances))


def _distance(shape: specs.Geometry, point: Vector3) -> float:
    """Returns the signed distance of a point to the surface of a shape [m], negative inside the shape.

    Args:
        shape: The shape.
        point: Point in the frame of the shape [m].
    """
    x, y, z = point
    match shape:
        case specs.Box(size=(a, b, c)):
            return _box_distance((abs(x) - a / 2, abs(y) - b / 2, abs(z) - c / 2))
        case specs.Cylinder(radius=radius, length=length):
            return _box_distance((math.hypot(x, y) - radius, abs(z) - length / 2))
        case specs.Sphere(radius=radius):
            return math.hypot(x, y, z) - radius
        case specs.Plane(normal=(a, b, c)):
            return a * x + b * y + c * z
        case specs.Mesh():
            low, high = _bounds(shape)
            return _box_distance(tuple(max(p - b, a - p) for p, a, b in zip(point, low, high, strict=True)))


def _box_distance(face_distances: Sequence[float]) -> float:
    """Returns the signed distance to a box from the signed distances to its faces along each axis."""
    return math.hypot(*(max(each, 0.0) for each in face_distances)) + min(max(face_distances), 0.0)


@functools.lru_cache(maxsize=256)
def _bounds(mesh: specs.Mesh) -> tuple[tuple[float, ...], tuple[float, ...]]:
    vertices = np.asarray(load_mesh(mesh).vertices)
    return tuple(vertices.min(axis=0).tolist()), tuple(vertices.max(axis=0).tolist())
