# SPDX-License-Identifier: BSD-3-Clause
"""Reads the <transmission> elements of a robot description, in the layout of ros_control; names all faults at once."""
from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from typing import Any

from modular_framework_control.hardware_interface.interfaces import (
    EffortJointInterface,
    HardwareInterface,
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from modular_framework_control.hardware_interface.transmissions import (
    DifferentialTransmission,
    FourBarLinkageTransmission,
    SimpleTransmission,
    Transmission,
    TransmissionError,
)
from modular_framework_control.hardware_interface.urdf_xml import line_of, parse_description

Interfaces = tuple[type[HardwareInterface[Any]], ...]
SIMPLE, DIFFERENTIAL, FOUR_BAR = (f"transmission_interface/{name}" for name in (
    "SimpleTransmission", "DifferentialTransmission", "FourBarLinkageTransmission"))
INTERFACES = {interface.type_name: interface for interface in (
    JointStateInterface, PositionJointInterface, VelocityJointInterface, EffortJointInterface)}
WHERE = "robot_description"


@dataclass(frozen=True, slots=True)
class TransmissionInfo:
    """One transmission of a description.

    Attributes:
        name: of the transmission.
        line: of the description in which it begins.
        transmission: its formulas.
        actuators: names, in the order of the formulas.
        joints: names, in the order of the formulas.
        interfaces: through which its joints are seen and commanded.
    """

    name: str
    line: int
    transmission: Transmission
    actuators: tuple[str, ...]
    joints: tuple[str, ...]
    interfaces: Interfaces

    @property
    def where(self) -> str:
        """How a message about it begins."""
        return f"{WHERE}:{self.line}: transmission '{self.name}'"


class _FaultError(Exception):
    """One fault of one transmission."""

    def __init__(self, element: ElementTree.Element, text: str) -> None:
        super().__init__(f"{WHERE}:{line_of(element)}: {text}")


def read_transmissions(description: str) -> list[TransmissionInfo]:
    """The transmissions of a robot description, in their order.

    Raises:
        TransmissionError: some are faulty; each is named, with the line, what was found and what is allowed.
        ParameterError: the description is not XML.
    """
    infos: list[TransmissionInfo] = []
    faults: list[str] = []
    for element in parse_description(description, WHERE).findall("transmission"):
        try:
            info = _Reader(element).read()
        except _FaultError as fault:
            faults.append(str(fault))
            continue
        for kind, mine, taken in (
                ("transmission", {info.name}, {other.name for other in infos}),
                ("joint", set(info.joints), {name for other in infos for name in other.joints}),
                ("actuator", set(info.actuators), {name for other in infos for name in other.actuators})):
            faults += [f"{info.where}: {kind} '{name}' is named by another transmission too; name each once"
                       for name in sorted(mine & taken)]
        infos.append(info)
    if faults:
        raise TransmissionError("; ".join(faults))
    return infos


class _Reader:
    """Reads one <transmission>."""

    def __init__(self, element: ElementTree.Element) -> None:
        self._element = element
        self._name = element.get("name", "")
        self._label = f"transmission '{self._name}'"

    def read(self) -> TransmissionInfo:
        if not self._name:
            raise _FaultError(self._element, "<transmission> has no name; give it an attribute name")
        kind = (self._element.findtext("type") or "").strip()
        if kind not in (SIMPLE, DIFFERENTIAL, FOUR_BAR):
            found = f"<type> is '{kind}'" if kind else "it has no <type>"
            raise _FaultError(self._element, f"{self._label}: {found}; allowed: {SIMPLE}, {DIFFERENTIAL}, {FOUR_BAR}")
        joints, actuators = self._parts("joint", kind), self._parts("actuator", kind)
        return TransmissionInfo(self._name, line_of(self._element), self._formulas(kind, actuators, joints),
                                tuple(part.get("name", "") for part in actuators),
                                tuple(part.get("name", "") for part in joints), self._interfaces(joints))

    def _formulas(self, kind: str, actuators: list[ElementTree.Element],
                  joints: list[ElementTree.Element]) -> Transmission:
        reductions = [self._number(actuator, "mechanicalReduction", None) for actuator in actuators]
        offsets = [self._number(joint, "offset", 0.0) for joint in joints]
        if kind == SIMPLE:
            return SimpleTransmission(reductions[0], offsets[0])
        ratios = [self._number(joint, "mechanicalReduction", 1.0) for joint in joints]
        pair = DifferentialTransmission if kind == DIFFERENTIAL else FourBarLinkageTransmission
        return pair((reductions[0], reductions[1]), (ratios[0], ratios[1]), (offsets[0], offsets[1]))

    def _parts(self, tag: str, kind: str) -> list[ElementTree.Element]:
        """The joints or actuators, in the order of their roles where there are two."""
        parts = self._element.findall(tag)
        count = 1 if kind == SIMPLE else 2
        if len(parts) != count:
            raise _FaultError(self._element, f"{self._label}: it has {len(parts)} <{tag}>; {kind} has {count}")
        for part in parts:
            if not part.get("name"):
                raise _FaultError(part, f"{self._label}: <{tag}> has no name; give it an attribute name")
        if count == 1:
            return parts
        roles = {(part.findtext("role") or "").strip(): part for part in parts}
        wanted = [f"{tag}1", f"{tag}2"]
        if sorted(roles) != wanted:
            found = ", ".join(f"'{(part.findtext('role') or '').strip()}'" for part in parts)
            raise _FaultError(parts[0], f"{self._label}: the roles of its <{tag}> are {found}; expected "
                              f"<role>{wanted[0]}</role> in one and <role>{wanted[1]}</role> in the other")
        return [roles[role] for role in wanted]

    def _number(self, part: ElementTree.Element, tag: str, default: float | None) -> float:
        """A number inside a joint or actuator; a reduction is not 0."""
        element = part.find(tag)
        label = f"{self._label}: <{tag}> of {part.tag} '{part.get('name')}'"
        if element is None:
            if default is None:
                raise _FaultError(part, f"{label} is missing; give a number other than 0")
            return default
        try:
            value = float(element.text or "")
        except ValueError:
            value = math.nan
        nonzero = tag == "mechanicalReduction"
        if not math.isfinite(value) or (nonzero and value == 0.0):
            raise _FaultError(element, f"{label} is '{element.text or ''}'; expected a number"
                              + (" other than 0" if nonzero else ""))
        return value

    def _interfaces(self, joints: list[ElementTree.Element]) -> Interfaces:
        found = [self._interfaces_of(joint) for joint in joints]
        if any(set(other) != set(found[0]) for other in found):
            raise _FaultError(self._element, f"{self._label}: its joints have different hardware interfaces; give all "
                              "of them the same")
        return found[0]

    def _interfaces_of(self, joint: ElementTree.Element) -> Interfaces:
        elements = joint.findall("hardwareInterface")
        label = f"{self._label}: <hardwareInterface> of joint '{joint.get('name')}'"
        if not elements:
            raise _FaultError(joint, f"{label} is missing; give one of: {', '.join(INTERFACES)}")
        names = {}
        for element in elements:
            text = (element.text or "").strip()
            name = text if "/" in text else f"hardware_interface/{text}"
            if name not in INTERFACES:
                raise _FaultError(element, f"{label} is '{text}'; allowed: {', '.join(INTERFACES)}")
            names[name] = INTERFACES[name]
        return tuple(names.values())
