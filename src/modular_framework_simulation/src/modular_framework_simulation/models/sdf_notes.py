# SPDX-License-Identifier: BSD-3-Clause
"""Collects notes on elements of a model that have no effect or are replaced, so that nothing is ignored silently."""

from __future__ import annotations

from modular_framework_simulation.models.sdf_elements import is_defined
from modular_framework_simulation.models.xml_nodes import XmlNode

SUPPORTED_CHILDREN: dict[str, tuple[str, ...]] = {
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
    "surface/contact": ("ode", "collide_without_contact", "collide_bitmask"),
    "contact/ode": ("kp", "kd", "max_vel", "min_depth"),
    "joint": ("parent", "child", "pose", "axis", "sensor"),
    "axis": ("xyz", "limit", "dynamics", "use_parent_model_frame"),
    "axis/limit": ("lower", "upper", "effort", "velocity"),
    "axis/dynamics": ("damping", "friction", "spring_reference", "spring_stiffness"),
}
"""Supported children of an element; the key is the element's tag, or its parent's tag and its own tag."""

_IRRELEVANT = frozenset(
    {"specular", "emissive", "shininess", "lighting", "shader", "cast_shadows", "laser_retro", "max_contacts", "meta"}
)
"""Elements that only affect the appearance or the limits of other engines; no note is added."""


class Notes:
    """Lines about one model in the order of discovery, with one line per kind of element."""

    def __init__(self) -> None:
        self._lines: dict[str, str] = {}

    def add(self, node: XmlNode, text: str, kind: str = "") -> None:
        """Adds a line about an element.

        Args:
            node: Element of the note.
            text: Text of the note.
            kind: Kind of the note; later notes of the same kind are dropped. By default, only equal lines are dropped.
        """
        line = f"{node.location}: {text}"
        self._lines.setdefault(kind or line, line)

    def add_lines(self, lines: tuple[str, ...]) -> None:
        """Adds the lines of an inner model."""
        for line in lines:
            self._lines.setdefault(line, line)

    def note_unsupported(self, node: XmlNode) -> None:
        """Adds a note for each unsupported element of SDF below a node.

        Inner models and includes have their own notes; `sdf_elements` finds elements that SDF does not define.
        """
        self._note_unsupported(node, SUPPORTED_CHILDREN[node.tag], node.tag)

    def _note_unsupported(self, node: XmlNode, supported: tuple[str, ...], path: str) -> None:
        for child in node.children:
            if child.tag in _IRRELEVANT or not is_defined(child.tag, path):
                continue
            if child.tag not in supported:
                self.add(child, "has no effect", f"<{node.tag}>/<{child.tag}>")
                continue
            grandchildren = SUPPORTED_CHILDREN.get(f"{node.tag}/{child.tag}") or SUPPORTED_CHILDREN.get(child.tag)
            if grandchildren is not None and child.tag not in ("model", "include"):
                self._note_unsupported(child, grandchildren, f"{path}/{child.tag}")

    @property
    def lines(self) -> tuple[str, ...]:
        """Returns all lines."""
        return tuple(self._lines.values())
