# SPDX-License-Identifier: BSD-3-Clause
"""Publishes the visible scene for viewers in other processes."""

from __future__ import annotations

import time
from collections.abc import Callable

import rospy
from std_msgs.msg import String

from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.sensors.scene_text import (
    LinkPoses,
    ScenePoses,
    VisibleLink,
    VisibleModel,
    models_to_text,
    poses_to_text,
)
from modular_framework_simulation.sensors.visible_scene import SceneTracker

_MIN_PERIOD_S = 0.03
"""Minimum period of messages in real time, independent of the pace of simulated time [s]."""


class VisibleSceneTopics:
    """Publishes visual shapes and link poses; all methods are called by the loop's thread.

    Robots are left out, because their descriptions and joint states are published anyway.

    Publishes: /gazebo/visible_models (std_msgs/String, latched): JSON of `models_to_text`, when a model is added or
    removed; /gazebo/visible_poses (std_msgs/String): JSON of `poses_to_text`, about 25 times per second of real time.
    Both topics are only published while the poses have a subscriber.

    Args:
        world: World of the models.
        is_paused: Function that returns whether time is paused.
        clock: Function that returns real time [s].
    """

    def __init__(
        self, world: PhysicsWorld, is_paused: Callable[[], bool], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._world, self._is_paused, self._clock = world, is_paused, clock
        self._models = rospy.Publisher(ros_names.VISIBLE_MODELS, String, queue_size=1, latch=True)
        self._links = rospy.Publisher(ros_names.VISIBLE_POSES, String, queue_size=1)
        self._due_s = 0.0
        self._tracker: SceneTracker | None = None
        self._shown: dict[int, VisibleModel] = {}
        self._poses: dict[int, LinkPoses] = {}

    def publish(self) -> None:
        """Publishes all changes if the period has elapsed and the poses have a subscriber."""
        now_s = self._clock()
        if now_s < self._due_s:
            return
        self._due_s = now_s + _MIN_PERIOD_S
        if not self._links.get_num_connections():
            self._tracker = None
            return
        is_new = self._tracker is None
        if self._tracker is None:
            self._tracker, self._shown, self._poses = SceneTracker(self._world, {}), {}, {}
        update = self._tracker.update(())
        for number in update.removed:
            self._shown.pop(number, None)
            self._poses.pop(number, None)
        names = {self._world.instance(name): name for name in self._world.names()} if update.added else {}
        for number in update.added:
            model = self._model(number, names[number])
            if model.links:
                self._shown[number] = model
        self._poses |= {number: poses for number, poses in update.poses.items() if number in self._shown}
        if is_new or update.added or update.removed:
            self._models.publish(String(models_to_text(list(self._shown.values()))))
        self._links.publish(String(poses_to_text(ScenePoses(update.time_ns, self._is_paused(), self._poses))))

    def _model(self, number: int, name: str) -> VisibleModel:
        spec = self._world.body(name).spec
        links = tuple(VisibleLink(link.name, link.visuals) for link in spec.links if link.visuals) if spec else ()
        return VisibleModel(number, name, links)
