# SPDX-License-Identifier: BSD-3-Clause
"""Scales the SDF description of a model uniformly, at constant density."""

from __future__ import annotations

from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_urdf.xml_text import Element, XmlError, add_child, parse, to_text

LENGTHS = ("size", "radius", "length", "scale")
"""Elements of a geometry that contain lengths, or the scale of a mesh."""
MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
UNSCALABLE = ("include", "joint", "plugin", "sensor")


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
    root = parsed_model(text, location)
    if found := next((name for name in UNSCALABLE if root.find(f".//{name}") is not None), ""):
        raise DescriptionError(location, f"got a <{found}>", "allowed in a model with a size: links and shapes alone")
    for mesh in root.iter("mesh"):
        if mesh.find("scale") is None:
            add_child(mesh, "scale").text = "1 1 1"
    for pose in root.iter("pose"):
        multiply_numbers(pose, factor, first=3)
    for geometry in root.iter("geometry"):
        for element in geometry.iter():
            if element.tag in LENGTHS:
                multiply_numbers(element, factor)
    for inertial in root.iter("inertial"):
        for element in inertial.iter():
            if element.tag == "mass" or element.tag in MOMENTS:
                multiply_numbers(element, factor**3 if element.tag == "mass" else factor**5)
    return to_text(root)


def parsed_model(text: str, location: str) -> Element:
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


def multiply_numbers(element: Element, factor: float, first: int | None = None) -> None:
    """Multiplies the first numbers of an element.

    Args:
        element: Element whose text is a list of numbers.
        factor: Factor.
        first: Number of multiplied numbers; None for all.
    """
    words = (element.text or "").split()
    count = len(words) if first is None else first
    element.text = " ".join([*(repr(float(word) * factor) for word in words[:count]), *words[count:]])
