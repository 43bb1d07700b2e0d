# SPDX-License-Identifier: BSD-3-Clause
"""Reads the sensors of models and robots; what cannot be used is named, once, with what is known."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import Model, SensorElement
from modular_framework_simulation.models.sensor_elements import urdf_sensor_elements
from modular_framework_simulation.models.urdf_model import collision_name
from modular_framework_simulation.models.xml_nodes import XmlNode, parse_xml
from modular_framework_simulation.sensors import camera_sensors, contact, force_torque, imu, laser
from modular_framework_simulation.sensors.cameras import Camera
from modular_framework_simulation.sensors.contact import ContactSensor
from modular_framework_simulation.sensors.element_reader import ElementReader
from modular_framework_simulation.sensors.force_torque import ForceTorqueSensor
from modular_framework_simulation.sensors.imu import ImuSensor
from modular_framework_simulation.sensors.laser import LaserSensor
from modular_framework_simulation.sensors.sensor_xml import JointPart, ModelParts, SensorXml
from modular_framework_urdf.mesh_paths import PackageFinder, mesh_path
from modular_framework_urdf.robot import Capsule, MeshFile, Shape
from modular_framework_urdf.urdf_reader import read_urdf

AnySensor = Camera | ImuSensor | LaserSensor | ContactSensor | ForceTorqueSensor

_SENSOR_PLUGINS = {
    **dict.fromkeys(camera_sensors.TYPES, camera_sensors.PLUGINS),
    **dict.fromkeys(imu.TYPES, imu.PLUGINS),
    **dict.fromkeys(laser.TYPES, laser.PLUGINS),
    **dict.fromkeys(contact.TYPES, contact.PLUGINS),
    **dict.fromkeys(force_torque.TYPES, ()),
}
"""The plugins that a <sensor> of each type may have."""
_MODEL_PLUGINS = (*imu.MODEL_PLUGINS, *force_torque.PLUGINS)
"""The plugins of a model that are sensors."""
_NAMESPACE_OF_ROBOTS = "/"
"""With which spawn_model spawns them."""
_DONE_OTHERWISE = ("gazebo_ros_control", "gz_ros2_control-system", "gazebo_ros2_control")
"""Plugins of a model whose work this simulation does without them."""


@dataclass(slots=True)
class Sensors:
    """The sensors of one model.

    Attributes:
        parts: What the model has that they can be in.
        found: Those that can be simulated.
        faults: One sentence for each of the others, by what is wrong: the same fault is named once.
    """

    parts: ModelParts
    found: list[AnySensor] = field(default_factory=list)
    faults: dict[str, str] = field(default_factory=dict)


def read_model_sensors(model: Model, seed: int = 0) -> Sensors:
    """Reads the sensors of a model.

    Args:
        model: Its description, under its name in the world.
        seed: Of the simulation, for noise.
    """
    links = {link.name: link.collisions for link in model.links}
    joints = {joint.name: JointPart(joint.parent, joint.child, joint.kind.value) for joint in model.joints}
    return _read(ModelParts(model.name, links, joints, model.namespace), model.sensors, seed)


def read_robot_sensors(text: str, robot: str, find_package: PackageFinder, seed: int = 0) -> Sensors:
    """Reads the sensors of a robot.

    Args:
        text: URDF that the simulation has read before.
        robot: Name of the robot in the world.
        find_package: Looks up the packages of package:// URIs.
        seed: Of the simulation, for noise.
    """
    root, description = parse_xml(text, "robot_description"), read_urdf(text)
    links: dict[str, tuple[specs.Collision, ...]] = {}
    for element, link in zip(root.find_all("link"), description.links, strict=True):
        collisions = zip(element.find_all("collision"), link.collisions, strict=True)
        links[link.name] = tuple(
            specs.Collision(
                collision_name(node.attributes.get("name", ""), link.name, number),
                Pose.from_xyz_rpy(placed.origin.xyz, placed.origin.rpy),
                shape,
                specs.Friction(),
            )
            for number, (node, placed) in enumerate(collisions)
            for shape in _geometries(placed.shapes, find_package)
        )
    joints = {joint.name: JointPart(joint.parent, joint.child, joint.kind) for joint in description.joints}
    return _read(ModelParts(robot, links, joints, _NAMESPACE_OF_ROBOTS), urdf_sensor_elements(root), seed)


def _geometries(shapes: Iterable[Shape], find_package: PackageFinder) -> list[specs.Geometry]:
    """Returns the shapes that the simulation knows; a capsule as the cylinder around it."""
    known: list[specs.Geometry] = []
    for shape in shapes:
        match shape:
            case specs.Box() | specs.Cylinder() | specs.Sphere():
                known.append(shape)
            case Capsule(radius=radius, length=length):
                known.append(specs.Cylinder(radius, length + 2 * radius))
            case MeshFile(uri=uri, scale=scale):
                known.append(specs.Mesh(mesh_path(uri, find_package), scale))
    return known


def _read(parts: ModelParts, elements: Iterable[SensorElement], seed: int) -> Sensors:
    sensors = Sensors(parts)
    for element in elements:
        node = element.node
        try:
            xml = _xml(parts, element)
            if xml is None:
                continue
            sensors.found.append(_reader(node, xml, seed)(xml))
        except ValueError as error:
            line = f"{node.where}: {error}; this {node.tag} is not simulated"
            sensors.faults.setdefault(_kind(node, str(error)), line)
            continue
        unread = xml.sensor.unread() if xml.sensor is not xml.plugin else []
        unread += [f"plugin/{path}" for path in (xml.plugin.unread() if xml.plugin is not None else [])]
        if unread:
            line = f"{node.where}: without effect here: {', '.join(unread)}"
            sensors.faults.setdefault(_kind(node, line.partition(": without")[2]), line)
    return sensors


def _kind(node: XmlNode, fault: str) -> str:
    """Returns what identifies a fault: models that are spawned many times have it once."""
    return fault if node.tag == "plugin" else f"{node.attributes.get('name', '')}: {fault}"


def _xml(parts: ModelParts, element: SensorElement) -> SensorXml | None:
    """Returns an element with its plugin; None for a plugin whose work is done otherwise."""
    reader = ElementReader(element.node)
    if element.node.tag == "plugin":
        file = _file(element.node)
        if file in _DONE_OTHERWISE:
            return None
        return SensorXml(parts, element.scope, reader, reader, file, "", "", Pose())
    for key in ("always_on", "update_rate", "topic"):
        reader.find(key)
    reader.skip("plugin")
    plugin = element.node.find("plugin")
    if not element.link:
        raise ValueError(
            f"<gazebo reference='{element.reference}'>: there is no such link; name one of the robot: "
            f"{', '.join(parts.links)}"
        )
    of_plugin = ElementReader(plugin) if plugin is not None else None
    if of_plugin is not None:
        of_plugin.find("alwaysOn")
    file = _file(plugin) if plugin is not None else ""
    pose = element.pose if element.pose is not None else reader.pose("pose")
    return SensorXml(parts, element.scope, reader, of_plugin, file, element.link, element.joint, pose)


def _file(plugin: XmlNode) -> str:
    """Returns the file name of a plugin without lib and .so."""
    return plugin.attributes.get("filename", "").rpartition("/")[2].removeprefix("lib").removesuffix(".so")


def _name(plugin: XmlNode) -> str:
    return plugin.attributes.get("filename", "")


def _files(plugins: Iterable[str]) -> str:
    return ", ".join(f"lib{plugin}.so" for plugin in plugins)


def _reader(node: XmlNode, xml: SensorXml, seed: int) -> Callable[[SensorXml], AnySensor]:
    """Returns what reads an element.

    Raises:
        ValueError: Nothing does.
    """
    if node.tag == "plugin":
        if xml.file not in _MODEL_PLUGINS:
            raise ValueError(f"got the plugin '{_name(node)}'; allowed for a model: {_files(_MODEL_PLUGINS)}")
        return imu.read_imu if xml.file in imu.MODEL_PLUGINS else force_torque.read_force_torque
    kind = node.attributes.get("type", "")
    if kind not in _SENSOR_PLUGINS:
        raise ValueError(f"got type '{kind}'; allowed: {', '.join(_SENSOR_PLUGINS)}")
    allowed = _SENSOR_PLUGINS[kind]
    if xml.plugin is not None and xml.file not in allowed:
        names = _files(allowed) or f"none, {_files(force_torque.PLUGINS)} is a plugin of the model"
        raise ValueError(f"got the plugin '{_name(xml.plugin.node)}'; allowed: {names}")
    if kind in camera_sensors.TYPES:
        return lambda each: camera_sensors.read_camera(each, seed)
    if kind in imu.TYPES:
        return imu.read_imu
    if kind in laser.TYPES:
        return laser.read_laser
    return contact.read_contact if kind in contact.TYPES else force_torque.read_force_torque
