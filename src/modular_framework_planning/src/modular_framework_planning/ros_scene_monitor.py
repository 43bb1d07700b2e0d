# SPDX-License-Identifier: BSD-3-Clause
"""Keeps the current planning scene: changes arrive by service and topic, joint positions by joint_states."""
from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rospy
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, PlanningSceneWorld
from moveit_msgs.msg import PlanningScene as SceneMessage
from sensor_msgs.msg import JointState

from modular_framework_planning import capability_names as names
from modular_framework_planning.conversions import state_message
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.planning_scene import PlanningScene, empty_scene
from modular_framework_planning.robot_model import RobotModel
from modular_framework_planning.scene_conversions import apply_attached_object, apply_collision_object
from modular_framework_planning.scene_messages import apply_scene, apply_world, scene_message

STATE_UPDATE_PERIOD_S = 0.1
STATE_UPDATE_RAD = 1.0e-4  # [rad or m]


class SceneMonitor:
    """The one place that changes the scene; readers get immutable snapshots.

    Subscribes: joint_states, planning_scene, planning_scene_world, collision_object, attached_collision_object.
    Publishes: ~monitored_planning_scene: to each new subscriber the whole scene, to all the changes, among them the
    joint positions while they change.
    Parameters: ~planning_scene_monitor/publish_planning_scene and publish_state_updates (both true).
    """

    def __init__(self, model: RobotModel) -> None:
        self.model = model
        self._scene = empty_scene(model)
        self._lock = threading.RLock()
        self._positions = model.default_positions()
        self._stamps: dict[int, rospy.Time] = {}
        self._arrivals = 0
        self._arrived = threading.Condition()
        followers = set(model.document.mimics) | set(model.semantics.passive_joints)
        self._needed = [number for number, name in enumerate(model.joint_names) if name not in followers]
        self.listeners: list[Callable[[PlanningScene], None]] = []
        self._publisher: Any = None
        self._publishes_state = False
        self._told_positions = self._positions
        self._next_state_s = 0.0

    def connect(self) -> None:
        """Starts to listen and to publish."""
        if rospy.get_param("~planning_scene_monitor/publish_planning_scene", True):
            self._publishes_state = bool(rospy.get_param("~planning_scene_monitor/publish_state_updates", True))
            self._publisher = rospy.Publisher(names.MONITORED_SCENE_TOPIC, SceneMessage, _Greeter(self),
                                              queue_size=100)
        rospy.Subscriber(names.JOINT_STATES_TOPIC, JointState, self._on_joint_state, queue_size=5, tcp_nodelay=True)
        for topic, kind, change in (
                (names.SCENE_TOPIC, SceneMessage, apply_scene),
                (names.SCENE_WORLD_TOPIC, PlanningSceneWorld, apply_world),
                (names.OBJECT_TOPIC, CollisionObject, apply_collision_object),
                (names.ATTACHED_OBJECT_TOPIC, AttachedCollisionObject, apply_attached_object)):
            rospy.Subscriber(topic, kind, self._on_change, callback_args=(topic, change), queue_size=100)

    def greet(self, publish: Callable[[Any], None]) -> None:
        """Hands the whole scene to a new subscriber; the lock keeps changes from coming in between."""
        with self._lock:
            publish(scene_message(self.snapshot(), 0))

    def _on_change(self, message: Any, context: tuple[str, Callable[[PlanningScene, Any], PlanningScene]]) -> None:
        topic, change = context
        try:
            self.apply(lambda scene: change(scene, message), message)
        except PlanningError as error:
            rospy.logerr("%s: message ignored: %s", rospy.resolve_name(topic), error.reason)
        except (ValueError, TypeError, IndexError) as error:
            rospy.logerr("%s: message ignored, it is malformed: %s", rospy.resolve_name(topic), error)

    def apply(self, change: Callable[[PlanningScene], PlanningScene], message: Any = None) -> PlanningScene:
        """Changes the scene, all or nothing; the next snapshot has the change. Raises PlanningError."""
        with self._lock:
            before = self._scene.with_positions(self._positions.copy())
            scene = change(before)
            self._scene = scene
            self._publish(before, scene, message)
        for listener in self.listeners:
            listener(scene)
        return scene

    def _publish(self, before: PlanningScene, after: PlanningScene, message: Any) -> None:
        """Publishes the difference; messages that are diffs are passed on as they came."""
        if self._publisher is None:
            return
        if isinstance(message, SceneMessage) and message.is_diff:
            self._publisher.publish(message)
            return
        diff = scene_message(after, 0)
        diff.is_diff = True
        gone = [name for name in before.objects if name not in after.objects]
        diff.world.collision_objects = [item for item in diff.world.collision_objects
                                        if before.objects.get(item.id) is not after.objects[item.id]]
        diff.world.collision_objects += [CollisionObject(id=name, operation=CollisionObject.REMOVE) for name in gone]
        self._publisher.publish(diff)

    def _on_joint_state(self, message: JointState) -> None:
        if len(message.name) != len(message.position):
            rospy.logwarn_throttle(5.0, "joint_states: %d names but %d positions; message ignored",
                                   len(message.name), len(message.position))
            return
        changed = {}
        for name, position in zip(message.name, message.position, strict=True):
            number = self.model.index.get(name)
            if number is not None and np.isfinite(position):
                changed[name] = float(position)
                self._stamps[number] = message.header.stamp
        with self._lock:
            self._positions = self.model.merge(self._positions, changed)
            self._publish_state(message.header.stamp)
        with self._arrived:
            self._arrivals += 1
            self._arrived.notify_all()

    def _publish_state(self, stamp: rospy.Time) -> None:
        """Publishes the joint positions when they changed, every STATE_UPDATE_PERIOD_S of real time at most."""
        now = time.monotonic()
        if not self._publishes_state or now < self._next_state_s or not self._publisher.get_num_connections():
            return
        if np.abs(self._positions - self._told_positions).max() < STATE_UPDATE_RAD:
            return
        self._told_positions, self._next_state_s = self._positions, now + STATE_UPDATE_PERIOD_S
        update = SceneMessage(is_diff=True, robot_model_name=self.model.name, name=self._scene.name)
        update.robot_state = state_message(self._scene, self._positions, with_attached=False)
        update.robot_state.is_diff = True
        update.robot_state.joint_state.header.stamp = stamp
        self._publisher.publish(update)

    def missing_joints(self) -> list[str]:
        """Returns joints never heard of on joint_states (mimic and passive ones are not needed)."""
        return [self.model.joint_names[number] for number in self._needed if number not in self._stamps]

    def wait_for_state(self, timeout_s: float = 3.0) -> None:
        """Waits until every joint was heard of; raises PlanningError naming those that were not."""
        deadline = time.monotonic() + timeout_s
        while self.missing_joints():
            remaining = deadline - time.monotonic()
            if remaining <= 0.0 or rospy.is_shutdown():
                raise PlanningError(ErrorCode.ROBOT_STATE_STALE, f"topic {rospy.resolve_name('joint_states')}: waited "
                                    f"{timeout_s:.1f} s for the positions of {', '.join(self.missing_joints())}; is "
                                    "the joint state controller running?")
            with self._arrived:
                self._arrived.wait(min(remaining, 0.1))

    def wait_for_next_state(self, timeout_s: float) -> bool:
        """Waits for one more joint_states message; false when none came in time."""
        with self._arrived:
            seen = self._arrivals
            return self._arrived.wait_for(lambda: self._arrivals > seen, timeout_s)

    def snapshot(self) -> PlanningScene:
        """Returns the scene as it is now, with the robot where it is now."""
        with self._lock:
            return self._scene.with_positions(self._positions.copy())

    def positions(self) -> Any:
        """Returns a copy of the current joint positions [rad or m]."""
        with self._lock:
            return self._positions.copy()

    def state(self) -> Any:
        """Returns the current state as a message."""
        message = state_message(self.snapshot())
        message.joint_state.header.stamp = rospy.Time.now()
        return message


class _Greeter(rospy.SubscribeListener):
    """Tells a new subscriber of the monitored scene what it missed."""

    def __init__(self, monitor: SceneMonitor) -> None:
        super().__init__()
        self._monitor = monitor

    def peer_subscribe(self, _topic: str, _publish: Any, peer_publish: Callable[[Any], None]) -> None:
        """Called by rospy with a function that publishes to the new subscriber alone."""
        self._monitor.greet(peer_publish)
