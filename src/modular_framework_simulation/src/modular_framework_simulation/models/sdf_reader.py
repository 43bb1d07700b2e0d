# SPDX-License-Identifier: BSD-3-Clause
"""Reads worlds and models in SDF 1.0 to 1.11.

Supported elements are includes, poses in all frames, models inside models, links with inertia, shapes, materials,
surfaces and damping, and fixed, revolute, continuous, prismatic and ball joints. The version of each file determines
the meaning of its elements. Sensors and plugins are returned unchanged. Elements without effect, such as lights and
settings of other engines, are listed once per model. Elements that would make the world wrong, such as unsupported
joints, raise errors.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Collection
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.joint_trees import refuse_loops
from modular_framework_simulation.models.sdf_frames import FrameTree
from modular_framework_simulation.models.sdf_models import LoadedModel, SdfModels, converted_version
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.sdf_states import with_saved_state
from modular_framework_simulation.models.xml_nodes import XmlNode, parse_xml, read_xml
from modular_framework_urdf.rotations import Vector3

STANDARD_GRAVITY = (0.0, 0.0, -9.8)
"""SDF's default gravity [m/s^2]."""

_GRAVITY_IN_PHYSICS_UNTIL = (1, 5)
"""Last version with <gravity> as a child of <physics>; later versions have <gravity> in <world>."""

_UNIQUE_NAMES_FROM = (1, 7)
"""First version with unique model names; in older files, duplicate models get a numbered name, as in Gazebo."""

_REFUSED_IN_WORLD = {
    "population": "place the models individually",
    "joint": "move the joint into a model that contains both links",
}


def read_world(path: Path, resources: Resources) -> specs.World:
    """Reads a .world file.

    Args:
        path: Path of the file.
        resources: Folders and packages for included models and meshes.

    Returns:
        The world with all includes resolved.

    Raises:
        DescriptionError: The file or an included file has unsupported or invalid content.
    """
    root = read_xml(path)
    version = converted_version(root)
    world = root.require("world")
    loaded, ignored = _models_of(world, version, resources)
    frames = FrameTree(world, {name: each.placed for name, each in loaded.items()})
    frames.refuse_circles()
    models = [
        dataclasses.replace(each.spec, name=name, pose=frames.pose_in_model(name)) for name, each in loaded.items()
    ]
    for model in models:
        refuse_loops(model)
    return specs.World(
        world.attributes.get("name", path.stem),
        _gravity(world, version),
        tuple(with_saved_state(models, world.find("state"))),
        tuple(ignored),
        _step(world),
    )


def _models_of(
    world: XmlNode, version: tuple[int, ...], resources: Resources
) -> tuple[dict[str, LoadedModel], list[str]]:
    """Returns the models of a world by name, and the lines of elements without effect."""
    reader = SdfModels(resources)
    loaded: dict[str, LoadedModel] = {}
    ignored: list[str] = []
    for child in world.children:
        model: LoadedModel | None = None
        if child.tag == "include":
            model = reader.included(child, 0)
        elif child.tag == "model":
            model = reader.model(child, version, 0)
        elif child.tag in _REFUSED_IN_WORLD:
            raise DescriptionError(child.where, "is not supported", _REFUSED_IN_WORLD[child.tag])
        if model is not None:
            if model.spec.name in loaded and version >= _UNIQUE_NAMES_FROM:
                raise DescriptionError(
                    child.where, f"is a second model '{model.spec.name}'", "give each model its own name"
                )
            model = _with_free_name(model, loaded, f"{child.source}:{child.line}")
            loaded[model.spec.name] = model
        elif child.tag not in ("gravity", "frame", "state", "physics", "light", "scene", "gui"):
            ignored.append(f"{child.source}:{child.line}: <{child.tag}>")
    return loaded, ignored


def _with_free_name(model: LoadedModel, used_names: Collection[str], where: str) -> LoadedModel:
    """Returns the model; if its name is in use, with a numbered name and a note."""
    name = model.spec.name
    if name not in used_names:
        return model
    free_name = next(numbered for number in itertools.count() if (numbered := f"{name}_{number}") not in used_names)
    notes = (*model.spec.notes, f"{where}: is a second model '{name}'; the model is renamed to '{free_name}'")
    return dataclasses.replace(model, spec=dataclasses.replace(model.spec, name=free_name, notes=notes))


def read_model_text(text: str, source: str, resources: Resources) -> specs.Model:
    """Reads a model from text, for example from a spawn request.

    Args:
        text: SDF text.
        source: Name of the text in messages.
        resources: Folders and packages for included models and meshes.

    Raises:
        DescriptionError: The text has unsupported or invalid content.
    """
    root = parse_xml(text, source)
    loaded = SdfModels(resources).in_document(root)
    if loaded is None:
        raise DescriptionError(root.where, "contains only a light or an actor, which have no body", "add a <model>")
    refuse_loops(loaded.spec)
    placed = FrameTree(root.find("world") or root, {loaded.spec.name: loaded.placed})
    return dataclasses.replace(loaded.spec, pose=placed.pose_in_model(loaded.spec.name))


def _step(world: XmlNode) -> float | None:
    node = world.find_path("physics", "max_step_size")
    return None if node is None else node.number()


def _gravity(world: XmlNode, version: tuple[int, ...]) -> Vector3:
    node = world.find("gravity")
    if node is None and version <= _GRAVITY_IN_PHYSICS_UNTIL:
        node = world.find_path("physics", "gravity")
    if node is None:
        return STANDARD_GRAVITY
    x, y, z = node.numbers(3)
    return (x, y, z)
