# SPDX-License-Identifier: BSD-3-Clause
"""The current planning scene, updated by services, topics, joint_states and tf."""

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
"""Simulated time between two joint states to wait for if simulated time is held [s]."""


class SceneMonitor:
    """Owns the scene; all changes are made here, and readers get immutable snapshots.

    A separate thread publishes changes and calls the listeners, so that callers do not wait for large messages. Changes
    in quick succession are published together.

    Subscribes: joint_states, planning_scene, planning_scene_world, collision_object, attached_collision_object, tf.
    Publishes: ~monitored_planning_scene, the whole scene to each new subscriber, then the changes. Changes of joint
    positions and tf frames are published at most at the rate in `settings`.
    Parameters: the fields of `settings`, below ~planning_scene_monitor.
    """

    def __init__(self, model: RobotModel, padding: Padding, settings: SceneMonitorSettings) -> None:
        self.model = model
        self.settings = settings  # may be replaced while the node runs
        self._frames = TfFrames(model)
        self._scene = empty_scene(model).with_padding(padding)
        self._lock = threading.RLock()
        self._positions = model.default_positions()
        self._base_is_seen = False  # whether tf has shown the pose of a planar or floating base
        self._history = JointHistory(model.continuous)
        self._stamps: dict[int, rospy.Time] = {}
        self._arrivals = 0
        self._latest: rospy.Time | None = None
        self.time = SimulatedTime()
        self._arrived = threading.Condition()
        base = set(model.base.variables if model.base else ())  # not part of joint_states
        optional = model.follower_joints | base
        self._required = [index for index, name in enumerate(model.joint_names) if name not in optional]
        self.listeners: list[Callable[[PlanningScene], None]] = []
        self._publisher: Any = None
        self._published_scene = self._scene
        self._was_disabled = False
        self._publish_lock = threading.Lock()
        self._scene_changed = threading.Event()

    def connect(self) -> None:
        """Subscribes to the topics and starts publishing."""
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
        """Sends the last published scene to a new subscriber; holds the lock so that no change is lost."""
        with self._publish_lock:
            if self.settings.publish_planning_scene:
                publish(scene_message(self._published_scene, 0))

    def _publish_changes(self) -> None:
        """Publishes changes of objects at once, and changes of joints and frames at the configured rate."""
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
            except rospy.ROSException as error:  # shutdown
                rospy.logdebug("a change of the planning scene was not published: %s", error)
            except Exception:  # an error in one listener must not stop later updates
                rospy.logerr("a change of the planning scene was not published:\n%s", traceback.format_exc())

    def _publish(self, scene: PlanningScene, settings: SceneMonitorSettings) -> None:
        """Publishes the enabled kinds of changes, or the whole scene after publishing was disabled."""
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
            rospy.logerr("%s: malformed message ignored: %s", rospy.resolve_name(topic), error)

    def apply(self, change: SceneChange) -> PlanningScene:
        """Applies a change atomically and returns the new scene; raises PlanningError."""
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
        """Moves the base to its pose from tf; without tf, the base stays where the scene last placed it."""
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
        """Returns the joint positions at a time [rad or m], waiting for joint_states if necessary.

        Args:
            stamp_s: ROS time [s].
            timeout_s: Maximum wall time to wait [s].

        Raises:
            PlanningError: The positions did not arrive in time, or the time is too long ago.
        """
        with self._arrived:
            self._arrived.wait_for(lambda: self._history.has_reached(stamp_s), timeout_s)
        with self._lock:
            return self._history.positions_at(stamp_s)

    def missing_joints(self) -> list[str]:
        """Returns the joints never received on joint_states; mimic and passive joints are optional."""
        return [self.model.joint_names[index] for index in self._required if index not in self._stamps]

    def wait_for_state(self, timeout_s: float = 3.0) -> None:
        """Waits until every required joint was received; raises PlanningError naming missing joints."""
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
        """Waits, if simulated time is held, until objects and joints of the held time have arrived.

        Raises:
            PlanningError: The state of the held time did not arrive within the timeout.
        """
        try:
            self.time.catch_up(lambda: self._latest)
        except CallError as error:
            raise PlanningError(ErrorCode.ROBOT_STATE_STALE, str(error)) from error

    def _warn_of_unseen_base(self) -> None:
        """Warns if tf does not show a planar or floating base; as in MoveIt, planning continues."""
        joint = self.model.base
        if joint is None or joint.name in self.model.semantics.passive_joints or self._frames.base() is not None:
            return
        rospy.logwarn_throttle(
            30.0,
            "tf has no transform from '%s' to '%s' (%s virtual joint '%s' of the SRDF): the planning scene's last pose "
            "of the robot is used, initially the origin; publish the transform, or place the robot by "
            "multi_dof_joint_state",
            joint.parent_frame,
            joint.child_link,
            joint.kind,
            joint.name,
        )

    def wait_for_next_state(self, timeout_s: float) -> bool:
        """Waits for the next joint_states message; returns False on timeout.

        If simulated time can be held, the method advances the time by STATE_PERIOD_S and waits for the next state.
        """
        if self.time.enabled:
            self.time.sleep(STATE_PERIOD_S)
            self.catch_up()
            return True
        with self._arrived:
            previous = self._arrivals
            return self._arrived.wait_for(lambda: self._arrivals > previous, timeout_s)

    def snapshot(self) -> PlanningScene:
        """Returns the current scene with the current state of the robot and tf frames."""
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
        """Sends the scene through rospy's function that publishes to the new subscriber only."""
        self._monitor.publish_to_new_subscriber(peer_publish)
