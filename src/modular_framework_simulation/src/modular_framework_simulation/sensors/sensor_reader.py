# SPDX-License-Identifier: BSD-3-Clause
"""Reads the sensors of models and robots, and reports each unsupported element once with the allowed values."""

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
"""Allowed plugins of a <sensor>, by sensor type."""
_MODEL_PLUGINS = (*imu.MODEL_PLUGINS, *force_torque.PLUGINS)
"""Plugins of a model that are sensors."""
_ROBOT_NAMESPACE = "/"
"""Namespace that spawn_model assigns to robots."""
_REPLACED_PLUGINS = ("gazebo_ros_control", "gz_ros2_control-system", "gazebo_ros2_control")
"""Plugins of a model that this simulation replaces."""


@dataclass(slots=True)
class Sensors:
    """Sensors of a model.

    Attributes:
        parts: Links and joints of the model.
        found: Supported sensors.
        faults: One sentence per fault, keyed by the fault, so that each fault is reported once.
    """

    parts: ModelParts
    found: list[AnySensor] = field(default_factory=list)
    faults: dict[str, str] = field(default_factory=dict)


def read_model_sensors(model: Model, seed: int = 0) -> Sensors:
    """Reads the sensors of a model.

    Args:
        model: Description of the model, with its name in the world.
        seed: Random seed of the simulation, for noise.
    """
    links = {link.name: link.collisions for link in model.links}
    joints = {joint.name: JointPart(joint.parent, joint.child, joint.kind.value) for joint in model.joints}
    return _read(ModelParts(model.name, links, joints, model.namespace), model.sensors, seed)


def read_robot_sensors(text: str, robot: str, find_package: PackageFinder, seed: int = 0) -> Sensors:
    """Reads the sensors of a robot.

    Args:
        text: URDF that the simulation has accepted.
        robot: Name of the robot in the world.
        find_package: Function that finds the packages of package:// URIs.
        seed: Random seed of the simulation, for noise.
    """
    root, description = parse_xml(text, "robot_description"), read_urdf(text)
    links: dict[str, tuple[specs.Collision, ...]] = {}
    for element, link in zip(root.find_all("link"), description.links, strict=True):
        collisions = zip(element.find_all("collision"), link.collisions, strict=True)
        links[link.name] = tuple(
            specs.Collision(
                collision_name(node.attributes.get("name", ""), link.name, index),
                Pose.from_xyz_rpy(collision.origin.xyz, collision.origin.rpy),
                shape,
                specs.Friction(),
            )
            for index, (node, collision) in enumerate(collisions)
            for shape in _geometries(collision.shapes, find_package)
        )
    joints = {joint.name: JointPart(joint.parent, joint.child, joint.kind) for joint in description.joints}
    return _read(ModelParts(robot, links, joints, _ROBOT_NAMESPACE), urdf_sensor_elements(root), seed)


def _geometries(shapes: Iterable[Shape], find_package: PackageFinder) -> list[specs.Geometry]:
    """Returns the supported shapes; an enclosing cylinder replaces a capsule."""
    geometries: list[specs.Geometry] = []
    for shape in shapes:
        match shape:
            case specs.Box() | specs.Cylinder() | specs.Sphere():
                geometries.append(shape)
            case Capsule(radius=radius, length=length):
                geometries.append(specs.Cylinder(radius, length + 2 * radius))
            case MeshFile(uri=uri, scale=scale):
                geometries.append(specs.Mesh(mesh_path(uri, find_package), scale))
    return geometries


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
            line = f"{node.location}: {error}; this {node.tag} is not simulated"
            sensors.faults.setdefault(_fault_key(node, str(error)), line)
            continue
        unread = xml.sensor.unread() if xml.sensor is not xml.plugin else []
        unread += [f"plugin/{path}" for path in (xml.plugin.unread() if xml.plugin is not None else [])]
        if unread:
            line = f"{node.location}: elements without effect: {', '.join(unread)}"
            sensors.faults.setdefault(_fault_key(node, line.partition(": elements")[2]), line)
    return sensors


def _fault_key(node: XmlNode, fault: str) -> str:
    """Returns the key of a fault, which is the same for models that are spawned repeatedly."""
    return fault if node.tag == "plugin" else f"{node.attributes.get('name', '')}: {fault}"


def _xml(parts: ModelParts, element: SensorElement) -> SensorXml | None:
    """Returns an element with its plugin; None for a plugin that this simulation replaces."""
    reader = ElementReader(element.node)
    if element.node.tag == "plugin":
        file = _file(element.node)
        if file in _REPLACED_PLUGINS:
            return None
        return SensorXml(
            model=parts, scope=element.scope, sensor=reader, plugin=reader, file=file, link="", joint="", pose=Pose()
        )
    for key in ("always_on", "update_rate", "topic"):
        reader.find(key)
    reader.skip("plugin")
    plugin = element.node.find("plugin")
    if not element.link:
        raise ValueError(
            f"<gazebo reference='{element.reference}'>: the robot has no such link; allowed: {', '.join(parts.links)}"
        )
    plugin_reader = ElementReader(plugin) if plugin is not None else None
    if plugin_reader is not None:
        plugin_reader.find("alwaysOn")
    file = _file(plugin) if plugin is not None else ""
    pose = element.pose if element.pose is not None else reader.pose("pose")
    return SensorXml(
        model=parts,
        scope=element.scope,
        sensor=reader,
        plugin=plugin_reader,
        file=file,
        link=element.link,
        joint=element.joint,
        pose=pose,
    )


def _file(plugin: XmlNode) -> str:
    """Returns the file name of a plugin without "lib" and ".so"."""
    return plugin.attributes.get("filename", "").rpartition("/")[2].removeprefix("lib").removesuffix(".so")


def _name(plugin: XmlNode) -> str:
    return plugin.attributes.get("filename", "")


def _files(plugins: Iterable[str]) -> str:
    return ", ".join(f"lib{plugin}.so" for plugin in plugins)


def _reader(node: XmlNode, xml: SensorXml, seed: int) -> Callable[[SensorXml], AnySensor]:
    """Returns the function that reads an element.

    Args:
        node: The <sensor> or <plugin> element.
        xml: The element with its plugin.
        seed: Random seed of the simulation, for noise.

    Raises:
        ValueError: The sensor type or plugin is not supported.
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
