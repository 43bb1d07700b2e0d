# SPDX-License-Identifier: BSD-3-Clause
"""Reads the hardware and the command interfaces of joints from the `<ros2_control>` tags of a URDF."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from modular_framework_urdf import xml_text

MOCK_PLUGINS = ("mock_components/GenericSystem", "fake_components/GenericSystem")
"""Plugins of hardware that follows its commands exactly."""
SIMULATION_PLUGINS = (
    "gz_ros2_control/GazeboSimSystem",
    "ign_ros2_control/IgnitionSystem",
    "gazebo_ros2_control/GazeboSystem",
)
"""Plugins of simulated hardware: Gazebo, Ignition and Gazebo classic."""

Value = bool | int | float | str


@dataclass(frozen=True, slots=True)
class Ros2ControlJoint:
    """A joint of a `<ros2_control>` tag.

    Attributes:
        name: Name of the joint.
        command_interfaces: Command interfaces in alphabetical order; empty for a joint that is only read.
        initial_position: Initial position [rad or m].
        line: Line in the URDF.
    """

    name: str
    command_interfaces: tuple[str, ...]
    initial_position: float
    line: int = 0


@dataclass(frozen=True, slots=True)
class Ros2ControlHardware:
    """A `<ros2_control>` tag.

    Attributes:
        name: Name of the hardware.
        plugin: Plugin of the hardware.
        parameters: Parameters of the hardware.
        joints: Joints, excluding mimic joints.
    """

    name: str
    plugin: str
    parameters: Mapping[str, Value]
    joints: tuple[Ros2ControlJoint, ...]

    @property
    def is_simulated(self) -> bool:
        """Whether the hardware is simulated."""
        return self.plugin in SIMULATION_PLUGINS


def read_ros2_control(text: str, location: str = "robot_description") -> tuple[Ros2ControlHardware, ...]:
    """Returns the `<ros2_control>` tags of a URDF in file order.

    Args:
        text: URDF text.
        location: Name of the file or parameter, for messages.

    Raises:
        XmlError: The text is not XML, a tag has no plugin, or the initial value of a joint is not a number.
    """
    return tuple(_hardware(tag, location) for tag in xml_text.parse(text, location).iter("ros2_control"))


def _hardware(tag: xml_text.Element, location: str) -> Ros2ControlHardware:
    name = tag.get("name", "")
    plugin = (tag.findtext("hardware/plugin") or "").strip()
    if not plugin:
        raise xml_text.XmlError(
            f"{location}:{tag.sourceline}",
            f"<ros2_control name='{name}'> has no <hardware><plugin>",
            f"allowed: {MOCK_PLUGINS[0]}, {SIMULATION_PLUGINS[0]}, or package/Class of a RobotHW; add it",
        )
    parameters = {
        item.get("name", ""): _number_or_text((item.text or "").strip()) for item in tag.findall("hardware/param")
    }
    joints = [_joint(item, location) for item in tag.findall("joint") if item.find("param[@name='mimic']") is None]
    return Ros2ControlHardware(name, plugin, parameters, tuple(joints))


def _joint(tag: xml_text.Element, location: str) -> Ros2ControlJoint:
    name = tag.get("name", "")
    interfaces = tuple(sorted(item.get("name", "") for item in tag.findall("command_interface")))
    text = tag.findtext("state_interface[@name='position']/param[@name='initial_value']")
    text = text or tag.findtext("param[@name='initial_position']") or "0"
    try:
        return Ros2ControlJoint(name, interfaces, float(text), tag.sourceline)
    except ValueError:
        raise xml_text.XmlError(
            f"{location}:{tag.sourceline}",
            f"<ros2_control>: initial value of joint '{name}' is '{text}'",
            "expected a number [rad or m]; correct it",
        ) from None


def _number_or_text(text: str) -> Value:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for convert in (int, float):
        try:
            return convert(text)
        except ValueError:
            continue
    return text
