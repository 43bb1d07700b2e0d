# SPDX-License-Identifier: BSD-3-Clause
"""Reads the objects of move_group's planning scene, and selects the objects to grasp."""

from __future__ import annotations

import rospy
from moveit_msgs.msg import CollisionObject, PlanningSceneComponents
from moveit_msgs.srv import GetPlanningScene, GetPlanningSceneRequest

from modular_framework_core.grasp_generation.object_names import is_named
from modular_framework_core.grasp_generation.planning_scene_objects import (
    CropBox,
    SceneObject,
    SceneObjectError,
    scene_object,
)
from modular_framework_core.grasp_generation.ros_generator_settings import GeneratorSettings
from modular_framework_ros.calls import call_service, wait_for_service

SERVICE_TIMEOUT_S = 10.0
WARNING_PERIOD_S = 30.0


class NoGraspError(RuntimeError):
    """No grasp is available; the message gives the reason."""


class NoObjectError(NoGraspError):
    """The planning scene does not contain an object to grasp."""


class SceneObjects:
    """Objects of the planning scene.

    Services called: ``get_planning_scene``.

    Attributes:
        attached: Names of the attached objects when the scene was last read.
    """

    def __init__(self) -> None:
        """Creates an unconnected reader; see :meth:`connect`."""
        self.attached: set[str] = set()
        self._known: dict[str, tuple[CollisionObject, SceneObject | None]] = {}

    def connect(self, timeout_s: float) -> None:
        """Waits for move_group.

        Raises:
            CallError: The service does not appear within the timeout.
        """
        self._scene = rospy.ServiceProxy("get_planning_scene", GetPlanningScene)
        wait_for_service(self._scene, timeout_s)

    def targets(self, settings: GeneratorSettings) -> list[SceneObject]:
        """Returns the objects to grasp: the object named in the settings, or all objects in the crop box.

        Raises:
            NoObjectError: The scene contains no such object.
            CallError: move_group does not respond.
        """
        objects = self.read()
        if settings.object_name:
            named = [candidate for candidate in objects if is_named(candidate.name, settings.object_name)]
            if not named:
                raise NoObjectError(
                    f"the planning scene has no object '{settings.object_name}'; "
                    f"it has {sorted(candidate.name for candidate in objects)}"
                )
            return named
        inside = [candidate for candidate in objects if settings.crop.holds(candidate.centre)]
        if not inside:
            raise NoObjectError(
                f"no object of the planning scene is in the crop box {_describe(settings.crop)} of "
                f"frame '{settings.frame}'; there are "
                f"{[_place(candidate) for candidate in objects] or 'no objects'}"
            )
        return inside

    def read(self) -> list[SceneObject]:
        """Returns all world objects of the scene; invalid objects are skipped with a warning.

        Raises:
            CallError: move_group does not respond.
        """
        components = PlanningSceneComponents(
            components=PlanningSceneComponents.WORLD_OBJECT_NAMES
            | PlanningSceneComponents.WORLD_OBJECT_GEOMETRY
            | PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS
        )
        answer = call_service(self._scene, GetPlanningSceneRequest(components=components), SERVICE_TIMEOUT_S)
        self.attached = {item.object.id for item in answer.scene.robot_state.attached_collision_objects}
        objects = []
        known_objects: dict[str, tuple[CollisionObject, SceneObject | None]] = {}
        for message in answer.scene.world.collision_objects:
            last_message, converted = self._known.get(message.id, (None, None))
            try:
                if message != last_message:
                    converted = scene_object(message)
                known_objects[message.id] = message, converted
            except (SceneObjectError, ValueError) as error:
                rospy.logwarn_throttle(WARNING_PERIOD_S, f"{rospy.get_name()}: {error}; this object is skipped.")
                continue
            objects += [converted] if converted is not None else []
        self._known = known_objects
        return objects


def _describe(crop: CropBox) -> str:
    return ", ".join(f"{axis} {low} to {high}" for axis, low, high in zip("xyz", crop.low, crop.high, strict=True))


def _place(target: SceneObject) -> str:
    x, y, z = target.centre
    return f"{target.name} at ({x:.2f}, {y:.2f}, {z:.2f}) m"
