# SPDX-License-Identifier: BSD-3-Clause
"""Changes the SDF description of a model: its size, mass, centre of mass and friction."""

from __future__ import annotations

from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.sdf_inertial import WATER_KG_PER_M3
from modular_framework_urdf.xml_text import Element, XmlError, add_child, parse, to_text

LENGTHS = ("size", "radius", "length", "scale")
"""Elements of a geometry that contain lengths, or the scale of a mesh."""
MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
UNSCALABLE = ("include", "joint", "plugin", "sensor")
_COEFFICIENTS = ("ode/mu", "ode/mu2", "bullet/friction", "bullet/friction2")


def read_scaled(file: Path, factor: float | None) -> str:
    """Returns the text of a model's file, scaled by a factor; None for no scaling.

    Args:
        file: SDF file of a model.
        factor: Positive factor of all lengths.

    Raises:
        OSError: The file cannot be read.
        DescriptionError: See `scaled_model`.
    """
    text = file.read_text(encoding="utf-8")
    return text if factor is None else scaled_model(text, factor, str(file))


def scaled_model(text: str, factor: float, location: str) -> str:
    """Returns the description of a model whose lengths are multiplied by a factor.

    Masses grow with the third power of the factor, and moments of inertia with the fifth.

    Args:
        text: SDF file of a model.
        factor: Positive factor.
        location: Name of the file, for errors.

    Raises:
        DescriptionError: The text is not XML, or the model has parts that cannot be scaled.
    """
    root = _parsed_model(text, location)
    if found := next((name for name in UNSCALABLE if root.find(f".//{name}") is not None), ""):
        raise DescriptionError(location, f"got a <{found}>", "allowed in a model with a size: links and shapes alone")
    for mesh in root.iter("mesh"):
        if mesh.find("scale") is None:
            add_child(mesh, "scale").text = "1 1 1"
    for pose in root.iter("pose"):
        _multiply_numbers(pose, factor, first=3)
    for geometry in root.iter("geometry"):
        for element in geometry.iter():
            if element.tag in LENGTHS:
                _multiply_numbers(element, factor)
    for inertial in root.iter("inertial"):
        for element in inertial.iter():
            if element.tag == "mass" or element.tag in MOMENTS:
                _multiply_numbers(element, factor**3 if element.tag == "mass" else factor**5)
    return to_text(root)


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
    root = _parsed_model(text, location)
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
            _multiply_numbers(density, factor)
        return
    _multiply_numbers(_child(inertial, "mass", 1.0), factor)
    inertia = _child(inertial, "inertia")
    for name in MOMENTS:
        _multiply_numbers(_child(inertia, name, 1.0 if name[1] == name[2] else 0.0), factor)


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
            _multiply_numbers(node, factor)


def _child(parent: Element, name: str, value: float | None = None) -> Element:
    """Returns the child of an element; a missing child is added with the value."""
    found = parent.find(name)
    if found is None:
        found = add_child(parent, name)
        found.text = None if value is None else repr(value)
    return found


def _parsed_model(text: str, location: str) -> Element:
    """Returns the root element of a model's description.

    Args:
        text: SDF file of a model.
        location: Name of the file, for errors.

    Raises:
        DescriptionError: The text is not XML.
    """
    try:
        return parse(text, location)
    except XmlError as error:
        raise DescriptionError(error.location, error.found, error.allowed) from error


def _multiply_numbers(element: Element, factor: float, first: int | None = None) -> None:
    """Multiplies the first numbers of an element.

    Args:
        element: Element whose text is a list of numbers.
        factor: Factor.
        first: Number of multiplied numbers; None for all.
    """
    words = (element.text or "").split()
    count = len(words) if first is None else first
    element.text = " ".join([*(repr(float(word) * factor) for word in words[:count]), *words[count:]])
