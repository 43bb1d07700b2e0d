# SPDX-License-Identifier: BSD-3-Clause
"""Reads the collision shapes of an SDF world and of the models that it includes.

Supports inline and included models with box, cylinder, sphere and plane shapes. Other shapes raise an error, because an
incomplete planning scene is worse than none.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from modular_framework_description.solids import rotation_from_rpy
from modular_framework_urdf import xml_text
from modular_framework_urdf.xml_text import Element

Array = npt.NDArray[np.float64]


class WorldError(ValueError):
    """A world or model file is invalid."""


@dataclass(frozen=True, slots=True)
class PlacedShape:
    """A collision shape in the world.

    Attributes:
        kind: Shape type: "box", "cylinder", "sphere" or "plane".
        size: Box (x, y, z), cylinder (radius, length) or sphere (radius,) [m], or unit normal of a plane.
        pose: Pose in the world frame, shape (4, 4) [m].
    """

    kind: str
    size: tuple[float, ...]
    pose: Array


@dataclass(frozen=True, slots=True)
class PlacedLink:
    """A link of a model in the world.

    Attributes:
        model: Name of the model in the world.
        link: Name of the link in the model.
        pose: Pose in the world frame, shape (4, 4) [m].
        shapes: Collision shapes.
    """

    model: str
    link: str
    pose: Array
    shapes: tuple[PlacedShape, ...]

    @property
    def object_id(self) -> str:
        """ID of the link's object in a planning scene, ``<model>__<link>``."""
        return f"{self.model}__{self.link}"


def transform_from_pose_text(text: str, where: str) -> Array:
    """Returns the matrix of an SDF pose "x y z roll pitch yaw" [m, rad], shape (4, 4); identity for an empty text."""
    values = [float(value) for value in text.split()] or [0.0] * 6
    if len(values) != 6:
        raise WorldError(f"{where}: pose has {len(values)} numbers; it must have 6 (x y z roll pitch yaw)")
    transform = np.eye(4)
    transform[:3, :3] = rotation_from_rpy((values[3], values[4], values[5]))
    transform[:3, 3] = values[:3]
    return transform


def _pose_of(element: Element, where: str) -> Array:
    return transform_from_pose_text(element.findtext("pose", ""), where)


def _floats(element: Element, tag: str) -> tuple[float, ...]:
    return tuple(float(value) for value in element.findtext(tag, "").split())


def _shape_of(collision: Element, pose: Array, where: str) -> PlacedShape:
    geometry = collision.find("geometry")
    shape = None if geometry is None else next(iter(geometry), None)
    kind = "nothing" if shape is None else shape.tag
    tags = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",), "plane": ("normal",)}
    if shape is None or kind not in tags:
        raise WorldError(f"{where}: collision geometry is {kind}; allowed: {sorted(tags)}")
    size = tuple(value for tag in tags[kind] for value in _floats(shape, tag))
    return PlacedShape(kind, size, pose @ _pose_of(collision, where))


def _links_of(model: Element, name: str, pose: Array) -> list[PlacedLink]:
    links = []
    for link in model.findall("link"):
        where = f"model '{name}', link '{link.get('name')}'"
        link_pose = pose @ _pose_of(link, where)
        shapes = tuple(_shape_of(collision, link_pose, where) for collision in link.findall("collision"))
        links.append(PlacedLink(name, str(link.get("name")), link_pose, shapes))
    return links


def _read(path: Path) -> Element:
    try:
        return xml_text.read(path)
    except xml_text.XmlError as error:
        raise WorldError(str(error)) from error


def _included_model(include: Element, models_dir: Path) -> Element:
    uri = include.findtext("uri", "").strip()
    folder = models_dir / uri.removeprefix("model://")
    if not uri.startswith("model://") or not (folder / "model.sdf").is_file():
        available = sorted(path.parent.name for path in models_dir.glob("*/model.sdf"))
        raise WorldError(f"include '{uri}': no such model in {models_dir}; allowed: model:// and one of {available}")
    model = _read(folder / "model.sdf").find("model")
    if model is None:
        raise WorldError(f"{folder / 'model.sdf'}: no <model> element")
    return model


def read_world(world_file: Path, models_dir: Path) -> list[PlacedLink]:
    """Returns all links of a world in file order.

    Args:
        world_file: Path of the ``.world`` file.
        models_dir: Folder of the ``model://`` URIs.

    Raises:
        WorldError: A model is missing or has an unsupported shape.
    """
    world = _read(world_file).find("world")
    if world is None:
        raise WorldError(f"{world_file}: no <world> element")
    links: list[PlacedLink] = []
    for entry in world:
        if entry.tag == "include":
            model = _included_model(entry, models_dir)
            name = entry.findtext("name", str(model.get("name"))).strip()
            source = entry if entry.find("pose") is not None else model
            links += _links_of(model, name, _pose_of(source, f"include '{name}'"))
        elif entry.tag == "model":
            name = str(entry.get("name"))
            links += _links_of(entry, name, _pose_of(entry, f"model '{name}'"))
    return links
