# SPDX-License-Identifier: BSD-3-Clause
"""Reads the mass properties of an SDF link."""

from __future__ import annotations

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_frames import FrameTree
from modular_framework_simulation.models.sdf_notes import Notes
from modular_framework_simulation.models.sdf_surface import non_negative
from modular_framework_simulation.models.solid_inertia import (
    inertial_of_shapes,
    is_impossible,
    principal_moments,
    with_mass,
)
from modular_framework_simulation.models.xml_nodes import XmlNode

WATER_KG_PER_M3 = 1000.0
"""SDF's default density of shapes whose inertia is computed."""

_DEFAULT_MASS_KG, _DEFAULT_MOMENT = 1.0, 1.0
_MIN_MASS_KG, _MAX_MASS_KG = 1e-9, 1e9
_MIN_MOMENT, _MAX_MOMENT = 1e-14, 1e12
"""Range of principal moments that the engines compute [kg m^2]; a smaller moment counts as 0."""
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_ROUNDING_TOLERANCE = 1e-3
"""Fraction by which rounded moments may violate the triangle inequality."""


def read_inertial(
    link: XmlNode, frames: FrameTree, collisions: tuple[specs.Collision, ...], notes: Notes
) -> specs.Inertial:
    """Reads the <inertial> of a movable link; missing values have SDF's defaults.

    Args:
        link: The <link> element.
        frames: Frames of the model.
        collisions: Collision shapes of the link, used to compute moments that are zero.
        notes: Collector of notes on replaced values.

    Raises:
        DescriptionError: The mass or a moment is out of range.
    """
    node = link.find("inertial")
    if node is None:
        notes.add(
            link, f"has no <inertial>; SDF's default is used: {_DEFAULT_MASS_KG:g} kg and {_DEFAULT_MOMENT:g} kg m^2"
        )
        return specs.Inertial(frames.pose_in_link(link.name(), None), _DEFAULT_MASS_KG, (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))
    if node.attributes.get("auto", "false").strip().lower() in ("true", "1"):
        return _computed_from_shapes(node, link, collisions)
    mass_node, inertia_node = node.find("mass"), node.find("inertia")
    mass = mass_node.number() if mass_node is not None else _DEFAULT_MASS_KG
    if not _MIN_MASS_KG <= mass <= _MAX_MASS_KG:
        allowed = f"allowed: greater than 0, from {_MIN_MASS_KG:g} to {_MAX_MASS_KG:g} kg"
        raise DescriptionError((mass_node or node).location, f"got mass {mass:g} kg", allowed)

    def moment(tag: str) -> float:
        child = inertia_node.find(tag) if inertia_node is not None else None
        return child.number() if child is not None else (_DEFAULT_MOMENT if tag[1] == tag[2] else 0.0)

    xx, xy, xz, yy, yz, zz = (moment(tag) for tag in _MOMENTS)
    if max(map(abs, (xx, xy, xz, yy, yz, zz))) > _MAX_MOMENT:
        largest = max((xx, xy, xz, yy, yz, zz), key=abs)
        problem = f"has the moment {largest:g} kg m^2"
        raise DescriptionError((inertia_node or node).location, problem, f"allowed: up to {_MAX_MOMENT:g} kg m^2")
    pose = frames.pose_in_link(link.name(), node.find("pose"))
    given = specs.Inertial(pose, mass, (xx, xy, xz, yy, yz, zz))
    return with_valid_inertia(given, collisions, inertia_node or node, notes)


def with_valid_inertia(
    inertial: specs.Inertial, collisions: tuple[specs.Collision, ...], node: XmlNode, notes: Notes
) -> specs.Inertial:
    """Returns mass properties that the engine can simulate, and adds a note on invalid values.

    Args:
        inertial: Given mass properties.
        collisions: Collision shapes of the link.
        node: Element of the moments.
        notes: Collector of notes on replaced values.
    """
    moments = principal_moments(inertial.inertia)
    problem = "the principal moments are {:g}, {:g}, {:g} kg m^2".format(*moments)
    if moments[0] >= _MIN_MOMENT:
        if is_impossible(moments, _ROUNDING_TOLERANCE):
            notes.add(node, f"{problem}; no rigid body has these moments, but they are used unchanged")
        return inertial
    solid = inertial_of_shapes([(shape, WATER_KG_PER_M3) for shape in collisions])
    if solid is None:
        notes.add(
            node, f"{problem}; {_DEFAULT_MOMENT:g} kg m^2 is used instead, as the link has no solid collision shape"
        )
        return specs.Inertial(inertial.pose, inertial.mass, (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))
    filled = with_mass(solid, inertial.mass)
    notes.add(
        node, f"{problem}; the moments of its collision shapes with a mass of {inertial.mass:g} kg are used instead"
    )
    return specs.Inertial(Pose(inertial.pose.position), inertial.mass, filled.inertia)


def _computed_from_shapes(node: XmlNode, link: XmlNode, collisions: tuple[specs.Collision, ...]) -> specs.Inertial:
    """Computes the mass properties of the shapes of a link, as SDF 1.11 allows a file to request."""
    default = non_negative(node, "density") or WATER_KG_PER_M3
    densities = {child.name(): non_negative(child, "density") or default for child in link.find_all("collision")}
    solid = inertial_of_shapes([(shape, _density_of(shape.name, densities, default)) for shape in collisions])
    if solid is None:
        raise DescriptionError(node.location, "has auto='true'", "a <collision> with a volume is required")
    return solid


def _density_of(shape: str, densities: dict[str, float], default: float) -> float:
    return densities.get(shape, densities.get(shape.rpartition("_")[0], default))
