# SPDX-License-Identifier: BSD-3-Clause
"""Keeps the current planning scene: changes arrive by service and topic, joints by joint_states, a base by tf."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import rospy
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, PlanningSceneWorld
from moveit_msgs.msg import PlanningScene as SceneMessage
from sensor_msgs.msg import JointState

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Transform
from modular_framework_planning.messages.conversions import state_message
from modular_framework_planning.messages.scene_conversions import apply_attached_object, apply_collision_object
from modular_framework_planning.messages.scene_difference import difference_message
from modular_framework_planning.messages.scene_messages import apply_scene, apply_world, scene_message
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.monitors.joint_history import JointHistory
from modular_framework_planning.move_group.monitors.tf_frames import TfFrames
from modular_framework_planning.move_group.node_settings import SceneMonitorSettings
from modular_framework_planning.planning_scene.padding import Padding
from modular_framework_planning.planning_scene.planning_scene import PlanningScene, SceneChange, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_ros.calls import CallError
from modular_framework_ros.simulated_time import SimulatedTime

STATE_PERIOD_S = 0.02
"""Simulated time that passes from one joint state to the next that is waited for, where time is held [s]."""


class SceneMonitor:
    """Owns the scene: all changes are made here, and readers get immutable snapshots.

    A thread of its own publishes what changed and calls the listeners, so that nobody waits for large messages; changes
    that follow each other closely are published as one.

    Subscribes: joint_states, planning_scene, planning_scene_world, collision_object, attached_collision_object, tf.
    Publishes: ~monitored_planning_scene: to each new subscriber the whole scene, to all the changes, among them the
    joint positions and frames of tf while they change, as often as `settings` say at most.
    Parameters: those of `settings`, below ~planning_scene_monitor.
    """

    def __init__(self, model: RobotModel, padding: Padding, settings: SceneMonitorSettings) -> None:
        self.model = model
        self.settings = settings  # may be replaced while the node runs
        self._frames = TfFrames(model)
        self._scene = empty_scene(model).with_padding(padding)
        self._lock = threading.RLock()
        self._positions = model.default_positions()
        self._base_is_seen = False  # tf has shown where a planar or floating base is
        self._history = JointHistory(model.continuous)
        self._stamps: dict[int, rospy.Time] = {}
        self._arrivals = 0
        self._latest: rospy.Time | None = None
        self.time = SimulatedTime()
        self._arrived = threading.Condition()
        base = set(model.base.variables if model.base else ())  # joint_states does not have it
        needless = model.follower_joints | base
        self._needed = [number for number, name in enumerate(model.joint_names) if name not in needless]
        self.listeners: list[Callable[[PlanningScene], None]] = []
        self._publisher: Any = None
        self._published_scene = self._scene
        self._was_disabled = False
        self._publish_lock = threading.Lock()
        self._scene_changed = threading.Event()

    def connect(self) -> None:
        """Starts to listen and to publish."""
        self._frames.connect()
        self._published_scene = self.snapshot()
        self._publisher = rospy.Publisher(
            names.MONITORED_SCENE_TOPIC, SceneMessage, _NewSubscriberListener(self), queue_size=100
        )
        rospy.Subscriber(names.JOINT_STATES_TOPIC, JointState, self._on_joint_state, queue_size=5, tcp_nodelay=True)
        for topic, kind, change in (
            (names.SCENE_TOPIC, SceneMessage, apply_scene),
            (names.SCENE_WORLD_TOPIC, PlanningSceneWorld, apply_world),
            (names.OBJECT_TOPIC, CollisionObject, apply_collision_object),
            (names.ATTACHED_OBJECT_TOPIC, AttachedCollisionObject, apply_attached_object),
        ):
            rospy.Subscriber(topic, kind, self._on_change, callback_args=(topic, change), queue_size=100)
        threading.Thread(target=self._publish_changes, name="planning scene", daemon=True).start()

    def publish_to_new_subscriber(self, publish: Callable[[Any], None]) -> None:
        """Publishes the scene that the others know to a new subscriber; under the lock, so that no change is lost."""
        with self._publish_lock:
            if self.settings.publish_planning_scene:
                publish(scene_message(self._published_scene, 0))

    def _publish_changes(self) -> None:
        """Publishes changes of the scene at once, and of joints and frames at the configured rate."""
        while not rospy.is_shutdown():
            settings = self.settings
            changed = self._scene_changed.wait(1.0 / settings.publish_planning_scene_hz)
            self._scene_changed.clear()
            if not (changed or settings.publish_state_updates or settings.publish_transforms_updates):
                continue
            scene = self.snapshot()
            try:
                self._publish(scene, settings)
                for listener in self.listeners if changed else ():
                    listener(scene)
            except rospy.ROSException as error:  # the node is going down
                rospy.logdebug("the change of the planning scene was not published: %s", error)
            except Exception:  # what one change does to one listener must not keep the next ones from all
                rospy.logerr("a change of the planning scene was not published:\n%s", traceback.format_exc())

    def _publish(self, scene: PlanningScene, settings: SceneMonitorSettings) -> None:
        """Publishes the wanted parts of what changed, or everything where publishing was switched off before."""
        with self._publish_lock:
            has_subscribers = settings.publish_planning_scene and self._publisher.get_num_connections() > 0
            if not has_subscribers:
                self._published_scene, self._was_disabled = scene, not settings.publish_planning_scene
                return
            visible = replace(
                scene if settings.publish_geometry_updates else self._published_scene,
                positions=(scene if settings.publish_state_updates else self._published_scene).positions,
                fixed_frames=(scene if settings.publish_transforms_updates else self._published_scene).fixed_frames,
            )
            message = (
                scene_message(visible, 0) if self._was_disabled else difference_message(self._published_scene, visible)
            )
            if message is not None:
                self._publisher.publish(message)
                self._published_scene, self._was_disabled = visible, False

    def _on_change(self, message: Any, context: tuple[str, Callable[[PlanningScene, Any], PlanningScene]]) -> None:
        topic, change = context
        try:
            self.apply(lambda scene: change(scene, message))
        except PlanningError as error:
            rospy.logerr("%s: message ignored: %s", rospy.resolve_name(topic), error.reason)
        except (ValueError, TypeError, IndexError) as error:
            rospy.logerr("%s: message ignored, it is malformed: %s", rospy.resolve_name(topic), error)

    def apply(self, change: SceneChange) -> PlanningScene:
        """Changes the scene, all or nothing; the next snapshot has the change. Raises PlanningError."""
        frames, base = self._frames.now(), self._frames.base()
        with self._lock:
            self._follow_base(base)
            self._scene = change(self._scene.with_positions(self._positions.copy()).with_fixed_frames(frames))
            if self.model.base is not None and not self._base_is_seen:
                self._positions = self._positions.copy()
                self._positions[self.model.base_indices] = self._scene.positions[self.model.base_indices]
            scene = self._scene
        self._scene_changed.set()
        return scene

    def _follow_base(self, transform: Transform | None) -> None:
        """Puts the base where tf shows it; until it does, it is where the last change of the scene put it."""
        if transform is not None:
            self._positions, self._base_is_seen = self.model.with_base(self._positions, transform), True

    def _on_joint_state(self, message: JointState) -> None:
        if len(message.name) != len(message.position):
            rospy.logwarn_throttle(
                5.0,
                "joint_states: %d names but %d positions; message ignored",
                len(message.name),
                len(message.position),
            )
            return
        changed = {
            name: float(position)
            for name, position in zip(message.name, message.position, strict=True)
            if name in self.model.index and np.isfinite(position)
        }
        base = self._frames.base()
        with self._lock:
            self._positions = self.model.merge(self._positions, changed)
            self._follow_base(base)
            self._history.add(message.header.stamp.to_sec(), self._positions)
            self._stamps.update({self.model.index[name]: message.header.stamp for name in changed})
        with self._arrived:
            self._arrivals += 1
            self._latest = message.header.stamp
            self._arrived.notify_all()

    def positions_at(self, stamp_s: float, timeout_s: float) -> Any:
        """Returns the joint positions [rad or m] at a time, waiting for them if they are still to come.

        Raises:
            PlanningError: they were not received in time, or the time is too long ago.
        """
        with self._arrived:
            self._arrived.wait_for(lambda: self._history.covers(stamp_s), timeout_s)
        with self._lock:
            return self._history.at(stamp_s)

    def missing_joints(self) -> list[str]:
        """Returns joints never received on joint_states (mimic and passive ones are not needed)."""
        return [self.model.joint_names[number] for number in self._needed if number not in self._stamps]

    def wait_for_state(self, timeout_s: float = 3.0) -> None:
        """Waits until every joint was received; raises PlanningError naming those that were not."""
        deadline = time.monotonic() + timeout_s
        while self.missing_joints():
            remaining = deadline - time.monotonic()
            if remaining <= 0.0 or rospy.is_shutdown():
                raise PlanningError(
                    ErrorCode.ROBOT_STATE_STALE,
                    f"topic {rospy.resolve_name('joint_states')}: waited "
                    f"{timeout_s:.1f} s for the positions of {', '.join(self.missing_joints())}; is "
                    "the joint state controller running?",
                )
            with self._arrived:
                self._arrived.wait(min(remaining, 0.1))
        self.catch_up()
        self._warn_of_unseen_base()

    def catch_up(self) -> None:
        """Where simulated time is held: waits until objects and joints are those of the time at which it stands.

        Raises:
            PlanningError: they did not come.
        """
        try:
            self.time.catch_up(lambda: self._latest)
        except CallError as error:
            raise PlanningError(ErrorCode.ROBOT_STATE_STALE, str(error)) from error

    def _warn_of_unseen_base(self) -> None:
        """Warns where tf does not show a planar or floating base; as in MoveIt that stops no plan."""
        joint = self.model.base
        if joint is None or joint.name in self.model.semantics.passive_joints or self._frames.base() is not None:
            return
        rospy.logwarn_throttle(
            30.0,
            "tf has no transform from '%s' to '%s' (%s virtual joint '%s' of the SRDF): the robot is taken to be where "
            "the planning scene last put it, at first at the origin; publish the transform, or place the robot by "
            "multi_dof_joint_state",
            joint.parent_frame,
            joint.child_link,
            joint.kind,
            joint.name,
        )

    def wait_for_next_state(self, timeout_s: float) -> bool:
        """Waits for one more joint_states message; false when none came in time.

        Where simulated time may be held, lets a little of it pass, and waits for the state after that.
        """
        if self.time.enabled:
            self.time.sleep(STATE_PERIOD_S)
            self.catch_up()
            return True
        with self._arrived:
            seen = self._arrivals
            return self._arrived.wait_for(lambda: self._arrivals > seen, timeout_s)

    def snapshot(self) -> PlanningScene:
        """Returns the scene as it is now, with the robot and the frames of tf where they are now."""
        frames, base = self._frames.now(), self._frames.base()
        with self._lock:
            self._follow_base(base)
            return self._scene.with_positions(self._positions.copy()).with_fixed_frames(frames)

    def positions(self) -> Any:
        """Returns a copy of the current joint positions [rad or m]."""
        base = self._frames.base()
        with self._lock:
            self._follow_base(base)
            return self._positions.copy()

    def state(self) -> Any:
        """Returns the current state as a message."""
        message = state_message(self.snapshot())
        message.joint_state.header.stamp = rospy.Time.now()
        return message


class _NewSubscriberListener(rospy.SubscribeListener):
    """Sends the scene to each new subscriber of the monitored scene."""

    def __init__(self, monitor: SceneMonitor) -> None:
        super().__init__()
        self._monitor = monitor

    def peer_subscribe(self, _topic: str, _publish: Any, peer_publish: Callable[[Any], None]) -> None:
        """Called by rospy with a function that publishes to the new subscriber alone."""
        self._monitor.publish_to_new_subscriber(peer_publish)
