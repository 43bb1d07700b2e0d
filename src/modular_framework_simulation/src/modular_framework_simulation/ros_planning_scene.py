# SPDX-License-Identifier: BSD-3-Clause
"""Shows the simulated world to move_group, so that nobody has to keep a planning scene by hand.

A thread of its own compares the latest snapshot of the world with what move_group was told and sends the differences to
its service. The simulation loop only ever hands over a snapshot and never waits.
"""

from __future__ import annotations

import threading
import time

import rosgraph
import rospy
from geometry_msgs.msg import Pose as PoseMsg
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, PlanningScene
from moveit_msgs.srv import ApplyPlanningScene

from modular_framework_simulation import conversions, ros_names
from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.scene_changes import (
    Attach,
    Change,
    Detach,
    Move,
    Put,
    Remove,
    SceneChanges,
)
from modular_framework_simulation.snapshots import WorldSnapshot

_SYNC_PERIOD_S = 0.1
_PRESENCE_PERIOD_S = 0.5
_RETRY_PERIOD_S = 0.5


class PlanningScenePublisher:
    """Keeps the planning scene of move_group like the simulated world.

    Client of /apply_planning_scene (moveit_msgs/ApplyPlanningScene), whenever that is there.

    Args:
        touch_links: Links of the gripper, which may touch an object that is held.
    """

    def __init__(self, touch_links: list[str]) -> None:
        self._touch_links = touch_links
        self._changes = SceneChanges()
        self._snapshot: WorldSnapshot | None = None
        self._news = threading.Event()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="planning scene", daemon=True)
        self._server_uri = ""
        self._next_look_s = 0.0
        self._last_problem = ""

    def connect(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def close(self) -> None:
        """Ends the thread, unless move_group makes it wait for an answer; may be called twice."""
        self._stop.set()
        self._news.set()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)

    def show(self, snapshot: WorldSnapshot) -> None:
        """Hands over the latest state of the world; never waits."""
        self._snapshot = snapshot
        self._news.set()

    def _run(self) -> None:
        while not self._stop.is_set() and not rospy.is_shutdown():
            self._news.wait(timeout=1.0)
            self._news.clear()
            snapshot = self._snapshot
            if snapshot is None:
                continue
            try:
                pause_s = self._synchronise(snapshot)
            except Exception as error:  # this thread outlives whatever move_group or the network do
                pause_s = self._fail(f"{type(error).__name__}: {error}")
            end = time.monotonic() + pause_s
            # A change of what is held is urgent: the next motion is planned with it.
            while time.monotonic() < end and _held_model(self._snapshot) == _held_model(snapshot):
                if self._stop.wait(0.02):
                    return

    def _synchronise(self, snapshot: WorldSnapshot) -> float:
        """Tells move_group what is new; returns how long to rest afterwards [s]."""
        if not self._server_is_there():
            return _PRESENCE_PERIOD_S
        changes = self._changes.towards(snapshot)
        if not changes:
            return _SYNC_PERIOD_S
        answer = rospy.ServiceProxy(ros_names.APPLY_PLANNING_SCENE, ApplyPlanningScene)(self._message(changes))
        if not answer.success:
            names = sorted({conversions.collision_object_id(*change.key) for change in changes})
            return self._fail(f"move_group refused a change of {', '.join(names)}")
        self._changes.confirm()
        if self._last_problem:
            rospy.loginfo("planning scene: in step with the simulated world again")
        self._last_problem = ""
        return _SYNC_PERIOD_S

    def _server_is_there(self) -> bool:
        """Looks for the service twice a second; a server at another address is a new one that knows nothing."""
        now = time.monotonic()
        if now >= self._next_look_s:
            self._next_look_s = now + _PRESENCE_PERIOD_S
            try:
                uri = rosgraph.Master(rospy.get_name()).lookupService(ros_names.APPLY_PLANNING_SCENE)
            except (rosgraph.MasterException, OSError):
                uri = ""
            if uri != self._server_uri:
                self._changes.forget()
                if uri:
                    rospy.loginfo("planning scene: showing the simulated world to move_group at %s", uri)
            self._server_uri = uri
        return bool(self._server_uri)

    def _fail(self, problem: str) -> float:
        if problem != self._last_problem:
            rospy.logwarn("planning scene: %s; everything is sent again", problem)
        self._last_problem = problem
        self._changes.forget()
        return _RETRY_PERIOD_S

    def _message(self, changes: list[Change]) -> PlanningScene:
        scene = PlanningScene()
        scene.is_diff = True
        scene.robot_state.is_diff = True
        for change in changes:
            try:
                self._add(scene, change)
            except SimulationError as error:
                rospy.logerr("planning scene: '%s::%s' cannot be shown: %s", *change.key, error)
        return scene

    def _add(self, scene: PlanningScene, change: Change) -> None:
        model, link = change.key
        identity = conversions.collision_object_id(model, link)
        attached, world = scene.robot_state.attached_collision_objects, scene.world.collision_objects
        match change:
            case Put(link=spec, pose_in_world=pose):
                world.append(conversions.link_to_collision_object(model, spec, ros_names.WORLD_FRAME, pose))
            case Move(pose_in_world=pose):
                world.append(_moved(identity, conversions.pose_to_msg(pose)))
            case Remove():
                world.append(CollisionObject(id=identity, operation=CollisionObject.REMOVE))
            case Attach(link=spec, carrier_link=carrier, pose_in_carrier=pose):
                item = conversions.link_to_collision_object(model, spec, carrier, pose)
                attached.append(conversions.attached_object(item, carrier, self._touch_links))
            case Detach(carrier_link=carrier):
                released = AttachedCollisionObject(link_name=carrier)
                released.object.id = identity
                released.object.operation = CollisionObject.REMOVE
                attached.append(released)


def _moved(identity: str, pose: PoseMsg) -> CollisionObject:
    message = CollisionObject(id=identity, operation=CollisionObject.MOVE, pose=pose)
    message.header.frame_id = ros_names.WORLD_FRAME
    return message


def _held_model(snapshot: WorldSnapshot | None) -> str:
    return snapshot.held.model if snapshot is not None and snapshot.held is not None else ""
