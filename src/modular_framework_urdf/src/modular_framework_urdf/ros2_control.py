# SPDX-License-Identifier: BSD-3-Clause
"""Reads `<ros2_control>` of a robot description: which hardware its joints have, and how they are commanded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from modular_framework_urdf import xml_text

MOCK_PLUGINS = ("mock_components/GenericSystem", "fake_components/GenericSystem")
"""Names of hardware that follows its commands exactly."""
SIMULATION_PLUGINS = (
    "gz_ros2_control/GazeboSimSystem",
    "ign_ros2_control/IgnitionSystem",
    "gazebo_ros2_control/GazeboSystem",
)
"""Names of hardware that is simulated: those of Gazebo, of its time as Ignition, and of Gazebo classic."""

Value = bool | int | float | str


@dataclass(frozen=True, slots=True)
class Ros2ControlJoint:
    """A joint of a `<ros2_control>` tag.

    Attributes:
        name: Its name.
        command_interfaces: What it is commanded, in alphabetical order; none for a joint that is only read.
        initial_position: Where it begins [rad|m].
        line: Of the description.
    """

    name: str
    command_interfaces: tuple[str, ...]
    initial_position: float
    line: int = 0


@dataclass(frozen=True, slots=True)
class Ros2ControlHardware:
    """A `<ros2_control>` tag.

    Attributes:
        name: Its name.
        plugin: Its hardware.
        parameters: Parameters of the hardware.
        joints: Its joints, without those that follow another one.
    """

    name: str
    plugin: str
    parameters: Mapping[str, Value]
    joints: tuple[Ros2ControlJoint, ...]

    @property
    def simulated(self) -> bool:
        """Whether it is a simulation."""
        return self.plugin in SIMULATION_PLUGINS


def read_ros2_control(text: str, where: str = "robot_description") -> tuple[Ros2ControlHardware, ...]:
    """Returns the `<ros2_control>` tags of a robot description, in its order.

    Args:
        text: The description.
        where: What to call it in messages.

    Raises:
        XmlError: It is no XML, a tag names no hardware, or the initial value of a joint is no number.
    """
    return tuple(_hardware(tag, where) for tag in xml_text.parse(text, where).iter("ros2_control"))


def _hardware(tag: xml_text.Element, where: str) -> Ros2ControlHardware:
    name = tag.get("name", "")
    plugin = (tag.findtext("hardware/plugin") or "").strip()
    if not plugin:
        raise xml_text.XmlError(
            f"{where}:{tag.sourceline}",
            f"<ros2_control name='{name}'> has no <hardware><plugin>",
            f"allowed: {MOCK_PLUGINS[0]}, {SIMULATION_PLUGINS[0]}, or package/Class of a RobotHW; add it",
        )
    parameters = {
        each.get("name", ""): _number_or_text((each.text or "").strip()) for each in tag.findall("hardware/param")
    }
    joints = [_joint(each, where) for each in tag.findall("joint") if each.find("param[@name='mimic']") is None]
    return Ros2ControlHardware(name, plugin, parameters, tuple(joints))


def _joint(tag: xml_text.Element, where: str) -> Ros2ControlJoint:
    name = tag.get("name", "")
    interfaces = tuple(sorted(each.get("name", "") for each in tag.findall("command_interface")))
    text = tag.findtext("state_interface[@name='position']/param[@name='initial_value']")
    text = text or tag.findtext("param[@name='initial_position']") or "0"
    try:
        return Ros2ControlJoint(name, interfaces, float(text), tag.sourceline)
    except ValueError:
        raise xml_text.XmlError(
            f"{where}:{tag.sourceline}",
            f"<ros2_control>: initial value of joint '{name}' is '{text}'",
            "expected a number [rad or m]; correct it",
        ) from None


def _number_or_text(text: str) -> Value:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for number in (int, float):
        try:
            return number(text)
        except ValueError:
            continue
    return text
