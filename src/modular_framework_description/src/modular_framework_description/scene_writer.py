# SPDX-License-Identifier: BSD-3-Clause
"""Writes a world as MoveIt's text scene, so that planning on the real robot uses the same obstacles.

The text has the old layout without object poses: shape poses are relative to the world.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from modular_framework_core.scene.scene_file import Scene, SceneObject, SceneShape, Vector, scene_text
from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_world
from modular_framework_simulation.models.sdf_resources import Resources


def world_scene_text(world_file: Path, models_dir: Path) -> str:
    """Returns the scene of a world; links without collision shapes are omitted.

    Args:
        world_file: Path of the ``.world`` file, whose name becomes the name of the scene.
        models_dir: Folder of the ``model://`` URIs.

    Raises:
        DescriptionError: The world is invalid, or has a shape other than box, cylinder, sphere and plane.
    """
    world = read_world(world_file, Resources((models_dir,)))
    objects = tuple(_scene_object(model, link) for model in world.models for link in model.links if link.collisions)
    return scene_text(Scene(world_file.stem, objects), old_layout=True)


def _scene_object(model: specs.Model, link: specs.Link) -> SceneObject:
    """Returns the object of a link."""
    name, pose, origin = specs.collision_object_id(model.name, link.name), model.pose @ link.pose, Pose()
    shapes = tuple(_scene_shape(name, collision.geometry, pose @ collision.pose) for collision in link.collisions)
    return SceneObject(name, origin.position, origin.quaternion, shapes)


def _scene_shape(name: str, geometry: specs.Geometry, pose: Pose) -> SceneShape:
    size: Vector
    match geometry:
        case specs.Box():
            kind, size = "box", geometry.size
        case specs.Cylinder():
            kind, size = "cylinder", (geometry.radius, geometry.length)
        case specs.Sphere():
            kind, size = "sphere", (geometry.radius,)
        case specs.Plane():  # a x + b y + c z + d = 0 in its own frame, whose pose includes the distance, so d is 0
            kind, size = "plane", (*geometry.normal, 0.0)
        case _:  # an incomplete planning scene is worse than none
            raise DescriptionError(name, "a collision shape is a mesh", "allowed: box, cylinder, sphere, plane")
    return SceneShape(kind, _rounded_vector(size), _rounded_vector(pose.position), _rounded_vector(pose.quaternion))


def _rounded_vector(values: Iterable[float]) -> Vector:
    return tuple(round(value, 9) + 0.0 for value in values)
