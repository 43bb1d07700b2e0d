# SPDX-License-Identifier: BSD-3-Clause
"""Collects what of a model has no effect here or was replaced, so that nothing is dropped without a word."""

from __future__ import annotations

from modular_framework_simulation.models.xml_nodes import XmlNode

_READ: dict[str, tuple[str, ...]] = {
    "model": ("pose", "static", "link", "joint", "frame", "model", "include", "self_collide", "plugin"),
    "include": ("uri", "name", "pose", "static", "placement_frame"),
    "link": (
        *("pose", "inertial", "collision", "visual", "sensor"),
        *("velocity_decay", "gravity", "kinematic", "self_collide"),
    ),
    "inertial": ("pose", "mass", "inertia", "density"),
    "collision": ("pose", "geometry", "surface", "density"),
    "visual": ("pose", "geometry", "material", "transparency"),
    "material": ("ambient", "diffuse", "script"),
    "surface": ("friction", "bounce", "contact"),
    "friction": ("ode", "bullet", "torsional"),
    "friction/ode": ("mu", "mu2"),
    "friction/bullet": ("friction", "friction2", "rolling_friction"),
    "friction/torsional": ("coefficient",),
    "bounce": ("restitution_coefficient", "threshold"),
    "contact": ("ode", "collide_without_contact", "collide_bitmask"),
    "contact/ode": ("kp", "kd", "max_vel", "min_depth"),
    "joint": ("parent", "child", "pose", "axis", "sensor"),
    "axis": ("xyz", "limit", "dynamics", "use_parent_model_frame"),
    "axis/limit": ("lower", "upper", "effort", "velocity"),
    "axis/dynamics": ("damping", "friction", "spring_reference", "spring_stiffness"),
}
"""What is read below an element: a path of one or two tags, and its children."""

_OF_NO_ACCOUNT = frozenset(
    {"specular", "emissive", "shininess", "lighting", "shader", "cast_shadows", "laser_retro", "max_contacts", "meta"}
)
"""Of the look of things and of limits of other engines: not worth a line."""


class Notes:
    """Lines about one model, in the order in which they were found; each kind of element is named once."""

    def __init__(self) -> None:
        self._lines: dict[str, str] = {}

    def add(self, node: XmlNode, text: str, kind: str = "") -> None:
        """Adds a line about an element.

        Args:
            node: The element.
            text: What about it.
            kind: Further lines of the same kind are left out; by default only those that are equal.
        """
        line = f"{node.where}: {text}"
        self._lines.setdefault(kind or line, line)

    def add_lines(self, lines: tuple[str, ...]) -> None:
        """Adds the lines of an inner model."""
        for line in lines:
            self._lines.setdefault(line, line)

    def read_over(self, node: XmlNode) -> None:
        """Names what is below an element and is not read; models and includes in it are left to their own notes."""
        self._read_over(node, _READ[node.tag], node.tag)

    def _read_over(self, node: XmlNode, read: tuple[str, ...], path: str) -> None:
        for child in node.children:
            if child.tag in _OF_NO_ACCOUNT:
                continue
            if child.tag not in read:
                self.add(child, "has no effect here", f"<{node.tag}>/<{child.tag}>")
                continue
            below = _READ.get(f"{path}/{child.tag}") or _READ.get(child.tag)
            if below is not None and child.tag not in ("model", "include"):
                self._read_over(child, below, child.tag)

    @property
    def lines(self) -> tuple[str, ...]:
        """All lines."""
        return tuple(self._lines.values())
