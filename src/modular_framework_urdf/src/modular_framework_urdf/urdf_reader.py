# SPDX-License-Identifier: BSD-3-Clause
"""Reads URDF and reports faults with line numbers.

Existing readers lack required features: urdf_parser_py has no line numbers and no capsules; urdfdom and Pinocchio skip
transmissions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from graphlib import CycleError, TopologicalSorter

from modular_framework_urdf import xml_text
from modular_framework_urdf.mimics import Mimic
from modular_framework_urdf.robot import (
    Box,
    Capsule,
    Cylinder,
    Joint,
    Limit,
    Link,
    LocatedText,
    MeshFile,
    Origin,
    PlacedShapes,
    Robot,
    SafetyController,
    Shape,
    Sphere,
    Transmission,
    TransmissionPart,
    UnknownShape,
    Vector,
)
from modular_framework_urdf.xml_text import XACRO_TAGS, Element, XmlError


class AttributeFault(XmlError):
    """An attribute in a URDF is invalid.

    Attributes:
        tag: Tag of the element.
        owner: Owner of the element, such as "joint 'elbow'".
        key: Name of the attribute.
        text: Value of the attribute.
        expected: Allowed values.
    """

    def __init__(self, location: str, *, tag: str, owner: str, key: str, text: str, expected: str) -> None:
        super().__init__(
            location, f"<{tag}> of {owner}: {key} is '{text}'", f"expected {expected}; correct the description"
        )
        self.tag, self.owner, self.key, self.text, self.expected = tag, owner, key, text, expected


def read_urdf(text: str | bytes, location: str = "robot_description") -> Robot:
    """Reads a URDF with expanded xacro.

    Args:
        text: URDF text.
        location: Name of the file or parameter, for messages.

    Raises:
        AttributeFault: A number is invalid.
        XmlError: The text is not well-formed XML, has a DOCTYPE, or contains xacro, or the links form a loop.
    """
    root = xml_text.parse(text, location)
    for element in root.iter():
        if element.tag.startswith(XACRO_TAGS):
            raise XmlError(
                f"{location}:{element.sourceline}", "this is xacro", "allowed: URDF; expand the file with xacro"
            )
    joints = tuple(_joint(item, location) for item in root.findall("joint"))
    _refuse_loops(joints, location)
    return Robot(
        root.get("name", ""),
        tuple(_link(item, location) for item in root.findall("link")),
        joints,
        tuple(map(_transmission, root.findall("transmission"))),
    )


def _refuse_loops(joints: Sequence[Joint], location: str) -> None:
    """Raises an error if a link is its own ancestor; ignores joints without links."""
    parents = TopologicalSorter[str]()
    for joint in joints:
        if joint.parent and joint.child:
            parents.add(joint.child, joint.parent)
    try:
        parents.prepare()
    except CycleError as error:
        loop: list[str] = error.args[1]
        closing = next(joint for joint in joints if (joint.parent, joint.child) == (loop[0], loop[1]))
        raise XmlError(
            f"{location}:{closing.line}",
            f"joint '{closing.name}' closes a loop of links: {' -> '.join(loop)}",
            "allowed: a tree; correct the parent of one of its joints",
        ) from error


class _Attributes:
    """Reads the attributes of an optional element as numbers."""

    def __init__(self, element: Element | None, owner: str, location: str) -> None:
        self._element, self._owner, self._where = element, owner, location

    def text(self, key: str) -> str | None:
        return None if self._element is None else self._element.get(key)

    def optional(self, key: str) -> float | None:
        text = self.text(key)
        return None if text is None else self._numbers(key, text, 1, "a number")[0]

    def number(self, key: str, default: float) -> float:
        value = self.optional(key)
        return default if value is None else value

    def required_number(self, key: str) -> float:
        return self._numbers(key, self.text(key) or "", 1, "a number")[0]

    def vector(self, key: str, default: Vector) -> Vector:
        return self.required_vector(key) if (self.text(key) or "").strip() else default

    def required_vector(self, key: str) -> Vector:
        text = self.text(key) or ""
        x, y, z = self._numbers(key, text, 3, "three numbers")
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
            raise self._fault(key, text, "three numbers")
        return x, y, z

    def _numbers(self, key: str, text: str, count: int, expected: str) -> list[float]:
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != count or any(map(math.isnan, values)):
            raise self._fault(key, text, expected)
        return values

    def _fault(self, key: str, text: str, expected: str) -> AttributeFault:
        element: Element = self._element
        return AttributeFault(
            f"{self._where}:{element.sourceline}",
            tag=element.tag,
            owner=self._owner,
            key=key,
            text=text,
            expected=expected,
        )


def _link(element: Element, location: str) -> Link:
    name = element.get("name", "")

    def shapes(role: str) -> tuple[PlacedShapes, ...]:
        owner = f"{role} shape of link '{name}'"
        return tuple(
            PlacedShapes(
                tuple(_shape(shape, owner, location) for shape in item.findall("geometry/*")),
                _origin(item, owner, location),
                line=item.sourceline,
            )
            for item in element.findall(role)
        )

    return Link(name, shapes("visual"), shapes("collision"), line=element.sourceline)


def _origin(element: Element, owner: str, location: str) -> Origin:
    origin = _Attributes(element.find("origin"), owner, location)
    return Origin(origin.vector("xyz", (0.0, 0.0, 0.0)), origin.vector("rpy", (0.0, 0.0, 0.0)))


def _shape(element: Element, owner: str, location: str) -> Shape:
    attributes = _Attributes(element, owner, location)
    match element.tag:
        case "box":
            return Box(attributes.required_vector("size"))
        case "sphere":
            return Sphere(attributes.required_number("radius"))
        case "cylinder":
            return Cylinder(attributes.required_number("radius"), attributes.required_number("length"))
        case "capsule":
            return Capsule(attributes.required_number("radius"), attributes.required_number("length"))
        case "mesh":
            return MeshFile(element.get("filename", ""), attributes.vector("scale", (1.0, 1.0, 1.0)))
        case tag:
            return UnknownShape(tag)


def _joint(element: Element, location: str) -> Joint:
    name = element.get("name", "")

    def attributes_of(tag: str) -> _Attributes:
        return _Attributes(element.find(tag), f"joint '{name}'", location)

    limit, safety, mimic = attributes_of("limit"), attributes_of("safety_controller"), attributes_of("mimic")
    return Joint(
        name=name,
        kind=element.get("type", ""),
        parent=attributes_of("parent").text("link") or "",
        child=attributes_of("child").text("link") or "",
        origin=_origin(element, f"joint '{name}'", location),
        axis=attributes_of("axis").vector("xyz", (1.0, 0.0, 0.0)),
        limit=None
        if element.find("limit") is None
        else Limit(
            limit.number("lower", 0.0), limit.number("upper", 0.0), limit.optional("effort"), limit.optional("velocity")
        ),
        safety=None
        if element.find("safety_controller") is None
        else SafetyController(
            *(safety.optional(key) for key in ("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"))
        ),
        mimic=None
        if element.find("mimic") is None
        else Mimic(mimic.text("joint") or "", mimic.number("multiplier", 1.0), mimic.number("offset", 0.0)),
        line=element.sourceline,
    )


def _transmission(element: Element) -> Transmission:
    parts = {tag: tuple(_part(item) for item in element.findall(tag)) for tag in ("joint", "actuator")}
    return Transmission(
        element.get("name", ""),
        (element.findtext("type") or "").strip(),
        parts["joint"],
        parts["actuator"],
        line=element.sourceline,
    )


def _part(element: Element) -> TransmissionPart:
    return TransmissionPart(
        element.tag,
        element.get("name", ""),
        (element.findtext("role") or "").strip(),
        _text(element.find("mechanicalReduction")),
        _text(element.find("offset")),
        tuple(LocatedText((item.text or "").strip(), item.sourceline) for item in element.findall("hardwareInterface")),
        line=element.sourceline,
    )


def _text(element: Element | None) -> LocatedText | None:
    return None if element is None else LocatedText((element.text or "").strip(), element.sourceline)
