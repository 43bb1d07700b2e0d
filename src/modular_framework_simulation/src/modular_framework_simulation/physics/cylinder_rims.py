# SPDX-License-Identifier: BSD-3-Clause
"""Lets cylinders roll in PyBullet, which finds one touch of a round shape in a step.

A cylinder that lies on a table touches it along a line. The engine finds one end of the line in one step, the other end
in the next one, and keeps the touch of the step before, which by then has moved backwards: its push speeds the cylinder
up. A thin disc at each end touches in one point, which is found in each step. The cylinder itself is a little thinner.
"""

from __future__ import annotations

import copy

from modular_framework_simulation.models.poses import Pose
from modular_framework_urdf import xml_text

_CORE_RADIUS = 0.999
"""Radius of what is between the discs, of the radius of the cylinder: more than the discs sink in."""
_THICKNESS = 0.01
"""Thickness of a disc, of its radius."""


def with_rims(text: str, name: str) -> str:
    """Returns a URDF in which each cylinder of a collision has a disc at both ends.

    Args:
        text: The URDF.
        name: What to call it in messages.
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
