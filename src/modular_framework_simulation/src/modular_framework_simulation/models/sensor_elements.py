# SPDX-License-Identifier: BSD-3-Clause
"""Finds the elements of a description that are or may be sensors; `sensors/` interprets the elements.

An SDF `<sensor>` is the child of a link or joint, a URDF `<sensor>` is the child of a `<gazebo reference="...">`. A
`<plugin>` of the model may also be a sensor.
"""

from __future__ import annotations

from modular_framework_simulation.models.sdf_frames import FrameTree, base_of
from modular_framework_simulation.models.sdf_specs import SensorElement
from modular_framework_simulation.models.xml_nodes import XmlNode


def sdf_sensor_elements(model: XmlNode, frames: FrameTree) -> tuple[SensorElement, ...]:
    """Returns the sensor elements of an SDF model, without the elements of inner models.

    Args:
        model: The <model> element.
        frames: Frames of the model.

    Raises:
        DescriptionError: The pose of a sensor is relative to an unknown frame.
    """
    elements = []
    for link in model.find_all("link"):
        name = link.name()
        for node in link.find_all("sensor"):
            pose = node.find("pose")
            in_other_frame = pose is not None and base_of(pose) not in ("", name)
            elements.append(SensorElement(node, name, pose=frames.pose_in_link(name, pose) if in_other_frame else None))
    for joint in model.find_all("joint"):
        for node in joint.find_all("sensor"):
            elements.append(SensorElement(node, frames.link_of(joint.require("child")), joint.name()))
    return (*elements, *(SensorElement(node) for node in model.find_all("plugin")))


def urdf_sensor_elements(robot: XmlNode) -> tuple[SensorElement, ...]:
    """Returns the sensor elements of a URDF; a sensor without a reference has no link.

    Args:
        robot: Root element.
    """
    links = {node.attributes.get("name", "") for node in robot.find_all("link")}
    children = {
        joint.attributes.get("name", ""): child.attributes.get("link", "")
        for joint in robot.find_all("joint")
        if (child := joint.find("child")) is not None
    }
    elements = []
    for gazebo in robot.find_all("gazebo"):
        owner = gazebo.attributes.get("reference", "")
        joint = owner if owner not in links and owner in children else ""
        link = children[joint] if joint else owner if owner in links else ""
        elements += [SensorElement(node, link, joint, reference=owner) for node in gazebo.find_all("sensor")]
        elements += [SensorElement(node) for node in gazebo.find_all("plugin")]
    return tuple(elements)
