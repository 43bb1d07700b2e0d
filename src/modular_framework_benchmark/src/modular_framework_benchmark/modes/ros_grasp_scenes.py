# SPDX-License-Identifier: BSD-3-Clause
"""Scene of an episode of the mode `grasps`: models at their poses, as the simulation publishes them to move_group."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_benchmark.records.episode_settings import PlacedObject
from modular_framework_core.grasp_generation.planning_scene_objects import SceneObject, SceneObjectError, scene_object
from modular_framework_planning.errors import PlanningError
from modular_framework_planning.messages.scene_conversions import apply_collision_object
from modular_framework_planning.planning_scene.planning_scene import PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.gazebo_ros.conversions import link_to_collision_object
from modular_framework_simulation.models.model_variants import read_scaled
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources, no_packages


@dataclass(frozen=True, slots=True)
class GraspScene:
    """Objects around the robot.

    Attributes:
        planning_scene: Planning scene with all objects.
        targets: Parts of the object to grasp.
        others: Parts of all other objects.
    """

    planning_scene: PlanningScene
    targets: tuple[SceneObject, ...]
    others: tuple[SceneObject, ...]


def grasp_scene(model: RobotModel, objects: Sequence[PlacedObject], target: str) -> GraspScene:
    """Returns the scene of an episode, with the robot in its default state.

    Args:
        model: Robot model.
        objects: Objects with absolute paths of their models and poses in the planning frame.
        target: Name of the object to grasp.

    Raises:
        ModeError: A model is invalid, or the target has no graspable shape.
    """
    scene = empty_scene(model, model.default_positions())
    targets: list[SceneObject] = []
    other_objects: list[SceneObject] = []
    for item in objects:
        try:
            for message in _messages(item, model.planning_frame):
                scene = apply_collision_object(scene, message)
                part = scene_object(message)
                if part is not None:
                    (targets if item.name == target else other_objects).append(part)
        except (DescriptionError, SceneObjectError, PlanningError, OSError) as error:
            raise ModeError(f"object '{item.name}': {error}") from error
    if not targets:
        raise ModeError(f"object '{target}' has no graspable collision shape; choose another target")
    return GraspScene(scene, tuple(targets), tuple(other_objects))


def _messages(item: PlacedObject, frame: str) -> list[Any]:
    path = Path(item.model)
    text = read_scaled(path, item.scale)
    model = read_model_text(text, str(path), Resources((path.parent.parent,), no_packages))
    placed = Pose.from_xyz_rpy(item.xyz, item.rpy)
    return [
        link_to_collision_object(item.name, link, frame, placed @ link.pose) for link in model.links if link.collisions
    ]
