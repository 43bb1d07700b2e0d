# SPDX-License-Identifier: BSD-3-Clause
"""Reads worlds and models in SDF 1.0 to 1.11.

Supported elements are includes, poses in all frames, models inside models, links with inertia, shapes, materials,
surfaces and damping, and fixed, revolute, continuous, prismatic and ball joints. The version of each file determines
the meaning of its elements. Sensors and plugins are returned unchanged. Elements without effect, such as lights and
settings of other engines, are listed once per model; elements that SDF does not define are listed with their line.
Elements that would make the world wrong, such as unsupported joints, raise errors.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Collection
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.joint_trees import refuse_loops
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_elements import children_of, unknown_content
from modular_framework_simulation.models.sdf_frames import FrameTree, pose_of
from modular_framework_simulation.models.sdf_models import LoadedModel, SdfModels, converted_version
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.xml_nodes import XmlNode, parse_xml, read_xml
from modular_framework_urdf.rotations import Vector3

STANDARD_GRAVITY = (0.0, 0.0, -9.8)
"""SDF's default gravity [m/s^2]."""

_GRAVITY_IN_PHYSICS_UNTIL = (1, 5)
"""Last version with <gravity> as a child of <physics>; later versions have <gravity> in <world>."""

_UNIQUE_NAMES_FROM = (1, 7)
"""First version with unique model names; in older files, duplicate models get a numbered name, as in Gazebo."""

READ_OR_APPEARANCE = ("gravity", "frame", "state", "physics", "light", "scene", "gui")
"""Elements of a world that are read, or determine only its appearance."""

_LIGHTS = ("point", "directional", "spot")

_MAX_GRAVITY = 1e4
"""Maximum magnitude of the gravity [m/s^2]; the surface of the sun has 274."""

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
    unknown = unknown_content(root)
    version = converted_version(root)
    world = root.require("world")
    reader = SdfModels(resources)
    loaded, ignored = _models_of(world, version, reader)
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
        (*ignored, *_states_of_unknown_models(models, world.find("state"))),
        _step(world),
        (*unknown, *reader.unknown),
    )


def _models_of(world: XmlNode, version: tuple[int, ...], reader: SdfModels) -> tuple[dict[str, LoadedModel], list[str]]:
    """Returns the models of a world by name, and the lines of known elements without effect."""
    loaded: dict[str, LoadedModel] = {}
    ignored: list[str] = []
    for child in world.children:
        model: LoadedModel | None = None
        if child.tag == "include":
            model = reader.include_model(child, 0)
        elif child.tag == "model":
            model = reader.model(child, version, 0)
        elif child.tag in _REFUSED_IN_WORLD:
            raise DescriptionError(child.location, "is not supported", _REFUSED_IN_WORLD[child.tag])
        if model is not None:
            if model.spec.name in loaded and version >= _UNIQUE_NAMES_FROM:
                raise DescriptionError(
                    child.location, f"is a second model '{model.spec.name}'", "give each model its own name"
                )
            model = _with_free_name(model, loaded, f"{child.source}:{child.line}")
            if model.spec.name == specs.WORLD:
                problem = "has the name of the world frame, so that no request can name the model"
                ignored.append(f"{child.location} {problem}; give the model another name")
            loaded[model.spec.name] = model
        elif child.tag == "light":
            ignored += _light_faults(child)
        elif child.tag in children_of("world") and child.tag not in READ_OR_APPEARANCE:
            ignored.append(f"{child.source}:{child.line}: <{child.tag}>")
    return loaded, ignored


def _light_faults(light: XmlNode) -> list[str]:
    """Returns the faults of a light; lights have no effect, so that a fault is not an error."""
    kind, pose, faults = light.attributes.get("type", ""), light.find("pose"), []
    if kind not in _LIGHTS:
        faults.append(f"{light.location} has the type '{kind}' (allowed: {', '.join(_LIGHTS)})")
    try:
        light.name()
        if pose is not None:
            pose_of(pose)
    except DescriptionError as error:
        faults.append(str(error))
    return faults


def _with_free_name(model: LoadedModel, used_names: Collection[str], location: str) -> LoadedModel:
    """Returns the model; if its name is in use, with a numbered name and a note."""
    name = model.spec.name
    if name not in used_names:
        return model
    free_name = next(numbered for number in itertools.count() if (numbered := f"{name}_{number}") not in used_names)
    notes = (*model.spec.notes, f"{location}: is a second model '{name}'; the model is renamed to '{free_name}'")
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
    unknown = unknown_content(root)
    reader = SdfModels(resources)
    loaded = reader.in_document(root)
    if loaded is None:
        raise DescriptionError(root.location, "contains only a light or an actor, which have no body", "add a <model>")
    refuse_loops(loaded.spec)
    placed = FrameTree(root.find("world") or root, {loaded.spec.name: loaded.placed})
    notes = (*unknown, *reader.unknown, *loaded.spec.notes)
    return dataclasses.replace(loaded.spec, pose=placed.pose_in_model(loaded.spec.name), notes=notes)


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
    if math.hypot(x, y, z) > _MAX_GRAVITY:
        raise DescriptionError(node.location, f"got '{node.text.strip()}'", f"allowed: up to {_MAX_GRAVITY:g} m/s^2")
    return (x, y, z)


_TOLERANCE_M, _TOLERANCE_RAD = 1e-3, 1e-3
"""Tolerances of saved poses, which are rounded; a link within the tolerances has not moved."""


def with_saved_state(models: list[specs.Model], state: XmlNode | None) -> list[specs.Model]:
    """Returns the models at the poses of a <state>.

    Args:
        models: Models of the world.
        state: The <state> element; None if the world has none.

    Raises:
        DescriptionError: The state adds or removes models, or a pose is invalid.
    """
    if state is None:
        return models
    for tag in ("insertions", "deletions"):
        change = state.find(tag)
        if change is not None and change.children:
            raise DescriptionError(change.location, "adds or removes models", "allowed: a saved world without changes")
    saved = {node.attributes.get("name", ""): node for node in state.find_all("model")}
    return [_restored_model(model, saved[model.name]) if model.name in saved else model for model in models]


def _states_of_unknown_models(models: list[specs.Model], state: XmlNode | None) -> list[str]:
    names = {model.name for model in models}
    saved = state.find_all("model") if state is not None else []
    return [
        f"{node.location} of a model that the world does not have"
        for node in saved
        if node.attributes.get("name", "") not in names
    ]


def _restored_model(model: specs.Model, saved: XmlNode) -> specs.Model:
    notes = list(model.notes)
    pose_node = saved.find("pose")
    pose = pose_of(pose_node) if pose_node is not None else model.pose
    link_poses = {node.attributes.get("name", ""): node.find("pose") for node in saved.find_all("link")}
    moved: dict[str, Pose] = {}
    for link in model.links:
        node = link_poses.get(link.name)
        if node is None:
            continue
        in_model = pose.inverse() @ pose_of(node)
        distance, angle = in_model.distance_to(link.pose)
        if distance > _TOLERANCE_M or angle > _TOLERANCE_RAD:
            moved[link.name] = in_model
    if moved and model.joints:
        notes.append(f"{saved.location}: the saved joint positions have no effect; the joints start at 0")
        moved = {}
    scale = _saved_scale(saved)
    links = tuple(
        dataclasses.replace(_scaled_link(link, scale), pose=moved.get(link.name, link.pose)) for link in model.links
    )
    return dataclasses.replace(model, pose=pose, links=links, notes=tuple(notes))


def _saved_scale(saved: XmlNode) -> Vector3:
    node = saved.find("scale")
    x, y, z = node.numbers(3) if node is not None else (1.0, 1.0, 1.0)
    if node is not None and min(x, y, z) <= 0.0:
        raise DescriptionError(node.location, f"got '{node.text.strip()}'", "allowed: numbers greater than 0")
    return x, y, z


def _scaled_link(link: specs.Link, scale: Vector3) -> specs.Link:
    """Returns a link whose shapes are scaled as Model::SetScale of Gazebo does: their poses and the mass do not change.

    Args:
        link: Link of the model.
        scale: Factors along the axes of each shape.
    """
    if all(abs(factor - 1.0) <= 1e-6 for factor in scale):
        return link
    collisions = (dataclasses.replace(one, geometry=_scaled_geometry(one.geometry, scale)) for one in link.collisions)
    visuals = (dataclasses.replace(one, geometry=_scaled_geometry(one.geometry, scale)) for one in link.visuals)
    return dataclasses.replace(link, collisions=tuple(collisions), visuals=tuple(visuals))


def _scaled_geometry(geometry: specs.Geometry, scale: Vector3) -> specs.Geometry:
    x, y, z = scale
    match geometry:
        case specs.Box(size=(along_x, along_y, along_z)):
            return specs.Box((along_x * x, along_y * y, along_z * z))
        case specs.Cylinder(radius=radius, length=length):
            return specs.Cylinder(radius * max(x, y), length * z)
        case specs.Sphere(radius=radius):
            return specs.Sphere(radius * max(scale))
        case specs.Mesh():
            return dataclasses.replace(geometry, scale=scale)  # the file's own scale has no effect then, as in Gazebo
        case specs.Plane():
            return geometry
