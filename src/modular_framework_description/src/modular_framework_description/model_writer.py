# SPDX-License-Identifier: BSD-3-Clause
"""Writes a body as a Gazebo model: model.config, model.sdf (SDF 1.5) and an optional visual mesh."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from modular_framework_description.solids import Body, Part


def _number(value: float) -> str:
    return f"{value:.9g}"


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(_number(round(float(value), 12) + 0.0) for value in values)


def _child(parent: ElementTree.Element, tag: str, text: str = "", **attributes: str) -> ElementTree.Element:
    element = ElementTree.SubElement(parent, tag, attributes)
    if text:
        element.text = text
    return element


def _geometry(parent: ElementTree.Element, part: Part) -> None:
    shape = _child(_child(parent, "geometry"), part.kind)
    match part.kind:
        case "box":
            _child(shape, "size", _numbers(part.size))
        case "cylinder":
            _child(shape, "radius", _number(part.size[0]))
            _child(shape, "length", _number(part.size[1]))
        case _:
            _child(shape, "radius", _number(part.size[0]))


def _material(visual: ElementTree.Element, body: Body) -> None:
    material = _child(visual, "material")
    for tag in ("ambient", "diffuse"):
        _child(material, tag, _numbers((*body.colour, 1.0)))


def _surface(collision: ElementTree.Element, body: Body) -> None:
    friction = _child(_child(collision, "surface"), "friction")
    ode = _child(friction, "ode")
    bullet = _child(friction, "bullet")
    for parent, first, second in ((ode, "mu", "mu2"), (bullet, "friction", "friction2")):
        _child(parent, first, _number(body.friction))
        _child(parent, second, _number(body.friction))
    if body.rolling_friction > 0.0:
        _child(bullet, "rolling_friction", _number(body.rolling_friction))


def _inertial(link: ElementTree.Element, body: Body) -> None:
    properties = body.mass_properties()
    inertial = _child(link, "inertial")
    _child(inertial, "pose", _numbers((*properties.centre, 0.0, 0.0, 0.0)))
    _child(inertial, "mass", _number(properties.mass))
    inertia = _child(inertial, "inertia")
    for row, column in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        value = properties.inertia[row, column]
        _child(inertia, "i" + "xyz"[row] + "xyz"[column], _number(value if abs(value) > 1e-12 else 0.0))


def sdf_of(body: Body) -> ElementTree.Element:
    """Returns the SDF document of a body with the single link ``link``."""
    sdf = ElementTree.Element("sdf", version="1.5")
    model = _child(sdf, "model", name=body.name)
    if body.mass == 0.0:
        _child(model, "static", "true")
    link = _child(model, "link", name="link")
    if body.mass > 0.0:
        _inertial(link, body)
    for index, part in enumerate(body.parts):
        collision = _child(link, "collision", name=f"collision_{index}")
        _child(collision, "pose", _numbers((*part.xyz, *part.rpy)))
        _geometry(collision, part)
        _surface(collision, body)
    _visuals(link, body)
    return sdf


def _visuals(link: ElementTree.Element, body: Body) -> None:
    if body.mesh_name:
        visual = _child(link, "visual", name="visual")
        mesh = _child(_child(visual, "geometry"), "mesh")
        _child(mesh, "uri", f"model://{body.name}/meshes/{body.mesh_name}")
        _material(visual, body)
        return
    for index, part in enumerate(body.parts):
        visual = _child(link, "visual", name=f"visual_{index}")
        _child(visual, "pose", _numbers((*part.xyz, *part.rpy)))
        _geometry(visual, part)
        _material(visual, body)


def config_of(body: Body) -> ElementTree.Element:
    """Returns the model.config document of a body."""
    model = ElementTree.Element("model")
    _child(model, "name", body.name)
    _child(model, "version", "1.0")
    _child(model, "sdf", "model.sdf", version="1.5")
    author = _child(model, "author")
    _child(author, "name", "Modular Benchmarking Framework")
    _child(model, "description", body.description)
    return model


def write_model(body: Body, models_dir: Path) -> None:
    """Writes the folder of a model and replaces existing files."""
    folder = models_dir / body.name
    folder.mkdir(parents=True, exist_ok=True)
    for name, document in (("model.sdf", sdf_of(body)), ("model.config", config_of(body))):
        ElementTree.indent(document)
        text = ElementTree.tostring(document, encoding="unicode")
        licence = "<!-- SPDX-License-Identifier: BSD-3-Clause; written by scripts/generate_models -->"
        (folder / name).write_text(f'<?xml version="1.0"?>\n{licence}\n{text}\n', encoding="utf-8")
    if body.mesh_name:
        (folder / "meshes").mkdir(exist_ok=True)
        body.mesh().export(folder / "meshes" / body.mesh_name)
