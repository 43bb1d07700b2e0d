# SPDX-License-Identifier: BSD-3-Clause
"""Makes cylinders roll in PyBullet, which finds only one new contact point of a round shape per step.

A lying cylinder touches a table along a line. The engine finds one end of the line in one step and the other end in the
next step. The engine keeps the contact of the previous step, which has moved backwards meanwhile and accelerates the
cylinder. A thin disc at each end has a single contact point, which the engine finds in every step. The cylinder between
the discs is slightly thinner.
"""

from __future__ import annotations

import copy

from modular_framework_simulation.models.poses import Pose
from modular_framework_urdf import xml_text

_CORE_RADIUS = 0.999
"""Ratio of the radius between the discs to the cylinder radius; the gap exceeds the penetration of the discs."""
_THICKNESS = 0.01
"""Ratio of a disc's thickness to its radius."""


def with_rims(text: str, name: str) -> str:
    """Adds a disc at both ends of each collision cylinder in a URDF.

    Args:
        text: URDF text.
        name: Name of the URDF in messages.
    """
    if "<cylinder" not in text:
        return text
    root = xml_text.parse(text, name)
    for link in root.findall("link"):
        for collision in link.findall("collision"):
            cylinder = collision.find("geometry/cylinder")
            if cylinder is not None:
                _add_rims(link, collision, cylinder)
    return xml_text.to_text(root)


def _add_rims(link: xml_text.Element, collision: xml_text.Element, cylinder: xml_text.Element) -> None:
    radius, length = float(cylinder.get("radius")), float(cylinder.get("length"))
    thickness = min(_THICKNESS * radius, length / 2)
    for side in (1.0, -1.0):
        disc = copy.deepcopy(collision)
        disc.find("geometry/cylinder").set("length", f"{thickness:.12g}")
        origin = disc.find("origin")
        if origin is None:
            origin = xml_text.add_child(disc, "origin")
        (x, y, z), (roll, pitch, yaw) = (map(float, origin.get(key, "0 0 0").split()) for key in ("xyz", "rpy"))
        centre = Pose.from_xyz_rpy((x, y, z), (roll, pitch, yaw)) @ Pose((0.0, 0.0, side * (length - thickness) / 2))
        origin.set("xyz", " ".join(f"{value:.12g}" for value in centre.position))
        link.append(disc)
    cylinder.set("radius", f"{radius * _CORE_RADIUS:.12g}")
