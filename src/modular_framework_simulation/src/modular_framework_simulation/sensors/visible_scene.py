# SPDX-License-Identifier: BSD-3-Clause
"""Tracks the visual shapes of all models and their current poses, for cameras.

The tracker runs in the loop's thread and copies all changes. The copies are sent to the renderer's process, which draws
while the physics continues.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from modular_framework_simulation.errors import UnknownEntityError
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import Visual
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.sensors.cameras import Camera

LinkVisuals = Mapping[str, tuple[Visual, ...]]
"""Visual shapes of a model, by link name."""


@dataclass(frozen=True, slots=True)
class SceneUpdate:
    """Changes of the scene since the last update, and the poses of the cameras.

    Attributes:
        time_ns: Simulated time [ns].
        added: Visual shapes of new models by model number, with one tuple per link.
        removed: Numbers of removed models.
        poses: Link poses in the world frame by model number, in the order of `added`; models that cannot have moved are
            left out.
        cameras: Poses of the optical frames in the world frame, by camera name.
    """

    time_ns: int
    added: dict[int, tuple[tuple[Visual, ...], ...]]
    removed: tuple[int, ...]
    poses: dict[int, tuple[Pose, ...]]
    cameras: dict[str, Pose]


@dataclass(frozen=True, slots=True)
class SceneReport:
    """Response of the renderer.

    Attributes:
        images: Number of finished updates.
        wanted: Total number of subscriptions so far, by name of each camera with subscribers.
    """

    images: int
    wanted: Mapping[str, int]


class SceneTracker:
    """Describes the world to a renderer in successive updates.

    Args:
        world: The world.
        robots: Visual shapes of the robots by robot name; the world only stores the shapes of other models.
    """

    def __init__(self, world: PhysicsWorld, robots: Mapping[str, LinkVisuals]) -> None:
        self._world, self._robots = world, robots
        self._links: dict[int, tuple[str, ...]] = {}
        self._time_ns = self._revision = -1

    def update(self, cameras: Sequence[Camera]) -> SceneUpdate:
        """Returns the changes since the last update; cameras on removed models are left out."""
        world = self._world
        moved = {world.instance(name): name for name in world.moved_since(self._time_ns, self._revision, woken=True)}
        removed: tuple[int, ...] = ()
        added: dict[int, tuple[tuple[Visual, ...], ...]] = {}
        poses: dict[int, tuple[Pose, ...]] = {}
        if world.revision != self._revision:
            removed = tuple(number for number in self._links if number not in moved)
            for number in removed:
                del self._links[number]
        for number, name in sorted(moved.items()):
            if number not in self._links:
                visuals = self._visuals(name)
                self._links[number], added[number] = tuple(visuals), tuple(visuals.values())
            poses[number] = tuple(world.body(name).link_state(link).pose for link in self._links[number])
        self._time_ns, self._revision = world.time_ns, world.revision
        return SceneUpdate(world.time_ns, added, removed, poses, self._camera_poses(cameras))

    def _visuals(self, name: str) -> LinkVisuals:
        spec = self._world.body(name).spec
        if spec is None:
            return self._robots.get(name, {})
        return {link.name: link.visuals for link in spec.links if link.visuals}

    def _camera_poses(self, cameras: Sequence[Camera]) -> dict[str, Pose]:
        poses: dict[str, Pose] = {}
        for camera in cameras:
            try:
                parent_in_world = self._world.entity_state(camera.parent).pose
            except UnknownEntityError:
                continue
            poses[camera.name] = parent_in_world @ camera.optical_in_parent
        return poses
