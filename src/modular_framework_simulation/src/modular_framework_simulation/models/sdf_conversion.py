# SPDX-License-Identifier: BSD-3-Clause
"""Converts SDF 1.0 documents to SDF 1.2, in which child elements replace many attributes.

The rules follow sdformat's conversion table for this step (1_0.convert), restricted to the supported elements.
"""

from __future__ import annotations

from modular_framework_simulation.models.xml_nodes import XmlNode

CONVERTED_VERSION = (1, 2)
"""Version of a document after conversion."""

_TO_CHILDREN: dict[str, tuple[str, ...]] = {
    "model": ("static",),
    "link": ("gravity", "self_collide", "kinematic"),
    "inertial": ("mass", "density"),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "collision": ("laser_retro",),
    "visual": ("cast_shadows", "laser_retro", "transparency"),
    "material": ("script",),
    "bounce": ("restitution_coefficient", "threshold"),
    "ode": (
        *("mu", "mu2", "fdir1", "slip1", "slip2"),
        *("soft_cfm", "soft_erp", "kp", "kd", "max_vel", "min_depth"),
    ),
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "plane": ("normal",),
    "mesh": ("filename", "scale"),
    "heightmap": ("filename", "size"),
    "axis": ("xyz",),
    "axis2": ("xyz",),
    "dynamics": ("damping", "friction"),
    "limit": ("lower", "upper", "effort", "velocity", "cfm", "erp"),
}
"""Attributes that become child elements, by element tag."""

_TO_TEXT: dict[str, tuple[str, str]] = {
    "origin": ("pose", "pose"),
    "gravity": ("xyz", "gravity"),
    "parent": ("link", "parent"),
    "child": ("link", "child"),
    "ambient": ("rgba", "ambient"),
    "diffuse": ("rgba", "diffuse"),
    "specular": ("rgba", "specular"),
    "emissive": ("rgba", "emissive"),
}
"""Attribute that becomes the text of an element, and new tag of the element."""


def convert(root: XmlNode) -> None:
    """Converts an older document to `CONVERTED_VERSION` in place; elements keep their line numbers.

    Plugins are not changed, because their content does not belong to SDF.
    """
    root.attributes["version"] = ".".join(str(number) for number in CONVERTED_VERSION)
    _convert_below(root)


def _convert_below(node: XmlNode) -> None:
    for child in node.children:
        if child.tag != "plugin":
            _convert_below(child)
    attribute, tag = _TO_TEXT.get(node.tag, ("", ""))
    if attribute in node.attributes:
        node.text, node.tag = node.attributes.pop(attribute), tag
    moved = [name for name in _TO_CHILDREN.get(node.tag, ()) if name in node.attributes]
    node.children += [XmlNode(name, {}, node.source, node.line, node.attributes.pop(name)) for name in moved]
