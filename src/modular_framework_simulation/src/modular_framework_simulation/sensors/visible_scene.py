# SPDX-License-Identifier: BSD-3-Clause
"""What cameras see: the visual shapes of all models, and where they are at one instant.

The tracker looks at the world in the loop's thread and copies what changed; everything it returns can be sent to
another process, which draws it while physics goes on.
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
"""The visual shapes of a model by the name of their link."""


@dataclass(frozen=True, slots=True)
class SceneUpdate:
    """What changed since the last update, and which cameras are to look.

    Attributes:
        time_ns: Simulated time [ns].
        added: Visual shapes of new models, by the number of the model: one tuple for each link.
        removed: Numbers of the models that are gone.
        poses: Poses of the links in the world, in the order of `added`, by the number of the model; models that cannot
            have moved are left out.
        cameras: Pose of the optical frame in the world, by the name of the camera.
    """

    time_ns: int
    added: dict[int, tuple[tuple[Visual, ...], ...]]
    removed: tuple[int, ...]
    poses: dict[int, tuple[Pose, ...]]
    cameras: dict[str, Pose]


@dataclass(frozen=True, slots=True)
class SceneReport:
    """What the renderer answers.

    Attributes:
        images: How many updates it has finished.
        wanted: Names of the cameras that somebody subscribes to, with how many subscriptions there have been so far.
    """

    images: int
    wanted: Mapping[str, int]


class SceneTracker:
    """Describes the world to a renderer, one update after the other.

    Args:
        world: What is seen.
        robots: Visual shapes of the robots, by their names: the world knows those of other models itself.
    """

    def __init__(self, world: PhysicsWorld, robots: Mapping[str, LinkVisuals]) -> None:
        self._world, self._robots = world, robots
        self._links: dict[int, tuple[str, ...]] = {}
        self._revision = -1

    def update(self, cameras: Sequence[Camera]) -> SceneUpdate:
        """Returns what changed; cameras on something that is no longer there are left out."""
        world = self._world
        names = {world.instance(name): name for name in world.names()}
        removed = tuple(number for number in self._links if number not in names)
        for number in removed:
            del self._links[number]
        added: dict[int, tuple[tuple[Visual, ...], ...]] = {}
        poses: dict[int, tuple[Pose, ...]] = {}
        for number, name in names.items():
            body = world.body(name)
            if number not in self._links:
                visuals = self._visuals(name)
                self._links[number], added[number] = tuple(visuals), tuple(visuals.values())
            elif body.static and body.spec is not None and world.revision == self._revision:
                continue
            poses[number] = tuple(body.link_state(link).pose for link in self._links[number])
        self._revision = world.revision
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
