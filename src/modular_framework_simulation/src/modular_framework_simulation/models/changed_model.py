# SPDX-License-Identifier: BSD-3-Clause
"""Changes the mass, its centre and the friction in the SDF description of a model."""

from __future__ import annotations

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.scaled_models import MOMENTS, multiply_numbers, parsed_model
from modular_framework_simulation.models.sdf_inertial import WATER_KG_PER_M3
from modular_framework_urdf.xml_text import Element, add_child, to_text

_COEFFICIENTS = ("ode/mu", "ode/mu2", "bullet/friction", "bullet/friction2")


def changed_model(
    text: str, location: str, *, mass: float = 1.0, friction: float = 1.0, centre_of_mass: float = 0.0
) -> str:
    """Returns the description of a model with another mass, friction or centre of mass.

    Args:
        text: SDF file of a model.
        location: Name of the file, for errors.
        mass: Positive factor of masses and moments of inertia.
        friction: Positive factor of the sliding friction coefficients; surfaces that never slide keep theirs.
        centre_of_mass: Distance by which the centre of mass of each link moves along the x axis of the link [m].

    Raises:
        DescriptionError: The text is not XML, the model includes another model, or a link whose centre of mass should
            move computes its mass from its shapes.
    """
    if mass == friction == 1.0 and centre_of_mass == 0.0:
        return text
    root = parsed_model(text, location)
    if root.find(".//include") is not None:
        raise DescriptionError(
            location, "got an <include>", "allowed in a perturbed model: links and shapes of its own"
        )
    if mass != 1.0:
        for link in root.iter("link"):
            _change_mass(link, mass)
    if friction != 1.0:
        for collision in root.iter("collision"):
            _change_friction(collision, friction)
    if centre_of_mass != 0.0:
        for link in root.iter("link"):
            _move_centre_of_mass(link, centre_of_mass, location)
    return to_text(root)


def _change_mass(link: Element, factor: float) -> None:
    """Multiplies mass and moments of inertia of a link; missing values have SDF's defaults."""
    inertial = _child(link, "inertial")
    if _is_computed(inertial):
        for density in (_child(inertial, "density", WATER_KG_PER_M3), *link.findall("collision/density")):
            multiply_numbers(density, factor)
        return
    multiply_numbers(_child(inertial, "mass", 1.0), factor)
    inertia = _child(inertial, "inertia")
    for name in MOMENTS:
        multiply_numbers(_child(inertia, name, 1.0 if name[1] == name[2] else 0.0), factor)


def _is_computed(inertial: Element) -> bool:
    """Returns whether the mass properties are computed from the shapes of the link."""
    return inertial.get("auto", "false").strip().lower() in ("true", "1")


def _move_centre_of_mass(link: Element, offset_m: float, location: str) -> None:
    inertial = _child(link, "inertial")
    if _is_computed(inertial):
        allowed = "allowed with another centre of mass: an <inertial> with mass and inertia"
        raise DescriptionError(location, "got <inertial auto='true'>", allowed)
    pose = _child(inertial, "pose")
    x, *others = (pose.text or "0 0 0 0 0 0").split()
    pose.text = " ".join([repr(float(x) + offset_m), *others])


def _change_friction(collision: Element, factor: float) -> None:
    """Multiplies the friction coefficients of a shape; a missing coefficient has SDF's default of 1."""
    friction = _child(_child(collision, "surface"), "friction")
    found = [node for path in _COEFFICIENTS if (node := friction.find(path)) is not None]
    for node in found or [_child(_child(friction, "ode"), "mu", 1.0)]:
        if float(node.text or "nan") > 0.0:
            multiply_numbers(node, factor)


def _child(parent: Element, name: str, value: float | None = None) -> Element:
    """Returns the child of an element; a missing child is added with the value."""
    found = parent.find(name)
    if found is None:
        found = add_child(parent, name)
        found.text = None if value is None else repr(value)
    return found
