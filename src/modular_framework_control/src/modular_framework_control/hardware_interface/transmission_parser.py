# SPDX-License-Identifier: BSD-3-Clause
"""Parser for the <transmission> elements of a robot description, in ros_control's format, that lists all faults."""

from __future__ import annotations

import math
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
from modular_framework_control.hardware_interface.urdf_xml import parse_description
from modular_framework_urdf import robot as urdf
from modular_framework_urdf.robot import LocatedText, TransmissionPart

Interfaces = tuple[type[HardwareInterface[Any]], ...]
SIMPLE, DIFFERENTIAL, FOUR_BAR = (
    f"transmission_interface/{name}"
    for name in ("SimpleTransmission", "DifferentialTransmission", "FourBarLinkageTransmission")
)
INTERFACES = {
    interface.type_name: interface
    for interface in (JointStateInterface, PositionJointInterface, VelocityJointInterface, EffortJointInterface)
}
WHERE = "robot_description"


@dataclass(frozen=True, slots=True)
class TransmissionInfo:
    """One transmission of a description.

    Attributes:
        element: Element of the description.
        transmission: Conversion formulas.
        actuators: Actuator names, in the order of the formulas.
        joints: Joint names, in the order of the formulas.
        interfaces: Hardware interfaces of the joints.
    """

    element: urdf.Transmission
    transmission: Transmission
    actuators: tuple[str, ...]
    joints: tuple[str, ...]
    interfaces: Interfaces

    @property
    def where(self) -> str:
        """Prefix of messages on this transmission."""
        return f"{WHERE}:{self.element.line}: transmission '{self.element.name}'"


class _FaultError(Exception):
    """A fault in one transmission."""

    def __init__(self, line: int, text: str) -> None:
        super().__init__(f"{WHERE}:{line}: {text}")


def read_transmissions(description: str) -> list[TransmissionInfo]:
    """Returns the transmissions of a robot description, in their order.

    Raises:
        TransmissionError: Transmissions are faulty; the message lists all faults with lines and allowed values.
        ParameterError: The description is not XML.
    """
    infos: list[TransmissionInfo] = []
    faults: list[str] = []
    for transmission in parse_description(description, WHERE).transmissions:
        try:
            info = _Reader(transmission).read()
        except _FaultError as fault:
            faults.append(str(fault))
            continue
        for kind, own_names, other_names in (
            ("transmission", {info.element.name}, {other.element.name for other in infos}),
            ("joint", set(info.joints), {name for other in infos for name in other.joints}),
            ("actuator", set(info.actuators), {name for other in infos for name in other.actuators}),
        ):
            faults += [
                f"{info.where}: {kind} '{name}' is also named by another transmission; names must be unique"
                for name in sorted(own_names & other_names)
            ]
        infos.append(info)
    if faults:
        raise TransmissionError("; ".join(faults))
    return infos


class _Reader:
    """Reader for one <transmission>."""

    def __init__(self, transmission: urdf.Transmission) -> None:
        self._transmission, self._line = transmission, transmission.line
        self._label = f"transmission '{transmission.name}'"

    def read(self) -> TransmissionInfo:
        name, kind = self._transmission.name, self._transmission.kind
        if not name:
            raise _FaultError(self._line, "<transmission> has no name; give it an attribute name")
        if kind not in (SIMPLE, DIFFERENTIAL, FOUR_BAR):
            fault = f"<type> is '{kind}'" if kind else "<type> is missing"
            raise _FaultError(self._line, f"{self._label}: {fault}; allowed: {SIMPLE}, {DIFFERENTIAL}, {FOUR_BAR}")
        joints = self._in_order("joint", self._transmission.joints)
        actuators = self._in_order("actuator", self._transmission.actuators)
        return TransmissionInfo(
            self._transmission,
            self._formulas(actuators, joints),
            tuple(part.name for part in actuators),
            tuple(part.name for part in joints),
            self._interfaces(joints),
        )

    def _formulas(self, actuators: list[TransmissionPart], joints: list[TransmissionPart]) -> Transmission:
        reductions = [self._reduction(actuator, None) for actuator in actuators]
        offsets = [self._number(joint, "offset", joint.offset, 0.0) for joint in joints]
        if self._transmission.kind == SIMPLE:
            return SimpleTransmission(reductions[0], offsets[0])
        ratios = [self._reduction(joint, 1.0) for joint in joints]
        pair = DifferentialTransmission if self._transmission.kind == DIFFERENTIAL else FourBarLinkageTransmission
        return pair((reductions[0], reductions[1]), (ratios[0], ratios[1]), (offsets[0], offsets[1]))

    def _in_order(self, tag: str, parts: tuple[TransmissionPart, ...]) -> list[TransmissionPart]:
        """Returns the joints or actuators, two of them in the order of their roles."""
        kind = self._transmission.kind
        count = 1 if kind == SIMPLE else 2
        if len(parts) != count:
            raise _FaultError(self._line, f"{self._label}: got {len(parts)} <{tag}>; {kind} has {count}")
        for part in parts:
            if not part.name:
                raise _FaultError(part.line, f"{self._label}: <{tag}> has no name; give it an attribute name")
        if count == 1:
            return list(parts)
        roles = {part.role: part for part in parts}
        expected = [f"{tag}1", f"{tag}2"]
        if sorted(roles) != expected:
            role_list = ", ".join(f"'{part.role}'" for part in parts)
            raise _FaultError(
                parts[0].line,
                f"{self._label}: the roles of its <{tag}> are {role_list}; expected "
                f"<role>{expected[0]}</role> in one and <role>{expected[1]}</role> in the other",
            )
        return [roles[role] for role in expected]

    def _reduction(self, part: TransmissionPart, default: float | None) -> float:
        return self._number(part, "mechanicalReduction", part.reduction, default)

    def _number(self, part: TransmissionPart, tag: str, located: LocatedText | None, default: float | None) -> float:
        """Returns a number of a joint or actuator; a reduction must not be 0."""
        label = f"{self._label}: <{tag}> of {part.tag} '{part.name}'"
        if located is None:
            if default is None:
                raise _FaultError(part.line, f"{label} is missing; give a number other than 0")
            return default
        try:
            value = float(located.text)
        except ValueError:
            value = math.nan
        nonzero = tag == "mechanicalReduction"
        if not math.isfinite(value) or (nonzero and value == 0.0):
            raise _FaultError(
                located.line, f"{label} is '{located.text}'; expected a number" + (" other than 0" if nonzero else "")
            )
        return value

    def _interfaces(self, joints: list[TransmissionPart]) -> Interfaces:
        found = [self._interfaces_of(joint) for joint in joints]
        if any(set(other) != set(found[0]) for other in found):
            raise _FaultError(
                self._line, f"{self._label}: the joints have different hardware interfaces; give all joints the same"
            )
        return found[0]

    def _interfaces_of(self, joint: TransmissionPart) -> Interfaces:
        label = f"{self._label}: <hardwareInterface> of joint '{joint.name}'"
        if not joint.interfaces:
            raise _FaultError(joint.line, f"{label} is missing; give one of: {', '.join(INTERFACES)}")
        names = {}
        for located in joint.interfaces:
            name = located.text if "/" in located.text else f"hardware_interface/{located.text}"
            if name not in INTERFACES:
                raise _FaultError(located.line, f"{label} is '{located.text}'; allowed: {', '.join(INTERFACES)}")
            names[name] = INTERFACES[name]
        return tuple(names.values())
