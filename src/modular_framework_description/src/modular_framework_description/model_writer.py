# SPDX-License-Identifier: BSD-3-Clause
"""Writes a body as a Gazebo model: model.config, model.sdf (SDF 1.5) and an optional visual mesh."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from modular_framework_description.solids import Body, MassProperties, MeshBody, Part


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


def _mesh(parent: ElementTree.Element, model: str, file: str) -> None:
    _child(_child(_child(parent, "geometry"), "mesh"), "uri", f"model://{model}/meshes/{file}")


def _material(visual: ElementTree.Element, colour: tuple[float, float, float]) -> None:
    material = _child(visual, "material")
    for tag in ("ambient", "diffuse"):
        _child(material, tag, _numbers((*colour, 1.0)))


def _surface(collision: ElementTree.Element, friction: float, rolling_friction: float = 0.0) -> None:
    element = _child(_child(collision, "surface"), "friction")
    ode = _child(element, "ode")
    bullet = _child(element, "bullet")
    for parent, first, second in ((ode, "mu", "mu2"), (bullet, "friction", "friction2")):
        _child(parent, first, _number(friction))
        _child(parent, second, _number(friction))
    if rolling_friction > 0.0:
        _child(bullet, "rolling_friction", _number(rolling_friction))


def _inertial(link: ElementTree.Element, properties: MassProperties) -> None:
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
        _inertial(link, body.mass_properties())
    for index, part in enumerate(body.parts):
        collision = _child(link, "collision", name=f"collision_{index}")
        _child(collision, "pose", _numbers((*part.xyz, *part.rpy)))
        _geometry(collision, part)
        _surface(collision, body.friction, body.rolling_friction)
    _visuals(link, body)
    return sdf


def _visuals(link: ElementTree.Element, body: Body) -> None:
    if body.mesh_name:
        visual = _child(link, "visual", name="visual")
        _mesh(visual, body.name, body.mesh_name)
        _material(visual, body.colour)
        return
    for index, part in enumerate(body.parts):
        visual = _child(link, "visual", name=f"visual_{index}")
        _child(visual, "pose", _numbers((*part.xyz, *part.rpy)))
        _geometry(visual, part)
        _material(visual, body.colour)


def sdf_of_mesh_body(body: MeshBody) -> ElementTree.Element:
    """Returns the SDF document of a body of mesh files with the single link ``link``."""
    sdf = ElementTree.Element("sdf", version="1.5")
    link = _child(_child(sdf, "model", name=body.name), "link", name="link")
    _inertial(link, body.properties)
    for index, file in enumerate(body.parts):
        collision = _child(link, "collision", name=f"collision_{index}")
        _mesh(collision, body.name, file)
        _surface(collision, body.friction)
    visual = _child(link, "visual", name="visual")
    _mesh(visual, body.name, body.visual)
    _material(visual, body.colour)
    return sdf


def config_of(body: Body | MeshBody) -> ElementTree.Element:
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
    licence = "<!-- SPDX-License-Identifier: BSD-3-Clause; written by scripts/generate_models -->"
    _write_documents(folder, sdf_of(body), config_of(body), licence)
    if body.mesh_name:
        (folder / "meshes").mkdir(exist_ok=True)
        body.mesh().export(folder / "meshes" / body.mesh_name)


def write_mesh_body(body: MeshBody, folder: Path) -> None:
    """Writes model.sdf and model.config of a body into an existing folder."""
    _write_documents(folder, sdf_of_mesh_body(body), config_of(body), "<!-- written by scripts/add_object -->")


def _write_documents(folder: Path, sdf: ElementTree.Element, config: ElementTree.Element, comment: str) -> None:
    for name, document in (("model.sdf", sdf), ("model.config", config)):
        ElementTree.indent(document)
        text = ElementTree.tostring(document, encoding="unicode")
        (folder / name).write_text(f'<?xml version="1.0"?>\n{comment}\n{text}\n', encoding="utf-8")
