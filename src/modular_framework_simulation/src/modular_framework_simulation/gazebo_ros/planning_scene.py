# SPDX-License-Identifier: BSD-3-Clause
"""Synchronizes the planning scene of move_group with the simulated world.

A separate thread compares the latest snapshot of the world with the scene, and sends the differences to move_group's
service. The thread reads the scene again after changes and periodically, because other nodes also change the scene and
move_group may have restarted. The simulation loop only passes snapshots and never waits.
"""

from __future__ import annotations

import threading
import time

import rosgraph
import rospy
from geometry_msgs.msg import Pose as PoseMsg
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    ObjectColor,
    PlanningScene,
    PlanningSceneComponents,
)
from moveit_msgs.srv import ApplyPlanningScene, GetPlanningScene
from std_msgs.msg import ColorRGBA

from modular_framework_simulation.errors import PlanningSceneError, SimulationError
from modular_framework_simulation.gazebo_ros import conversions, ros_names
from modular_framework_simulation.gazebo_ros.scene_changes import (
    Add,
    Attach,
    Change,
    Detach,
    Move,
    Remove,
    SceneChanges,
)
from modular_framework_simulation.loop.snapshots import WorldSnapshot
from modular_framework_simulation.models import sdf_specs as specs

_SYNC_PERIOD_S = 0.1
_PRESENCE_PERIOD_S = 0.5
_RETRY_PERIOD_S = 0.5
_COMPARE_PERIOD_S = 2.0
"""Maximum time between two comparisons if no change of the scene is published [s]."""
_COMPARE_PAUSE_S, _MAX_COMPARE_FRACTION = 0.3, 0.1
"""Minimum pause after a comparison while the scene changes continuously, as during robot motions [s], and maximum
fraction of time for comparisons; the scene contains all triangles of a held mesh."""
_OBJECTS = PlanningSceneComponents(
    PlanningSceneComponents.WORLD_OBJECT_NAMES | PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS
)


class PlanningScenePublisher:
    """Sends the simulated world to the planning scene of move_group.

    Client of /apply_planning_scene (moveit_msgs/ApplyPlanningScene) and /get_planning_scene
    (moveit_msgs/GetPlanningScene), whenever the services are available.
    Subscribes: /move_group/monitored_planning_scene (moveit_msgs/PlanningScene), only to detect changes of the scene.
    """

    def __init__(self) -> None:
        self._changes = SceneChanges()
        self._snapshot: WorldSnapshot | None = None
        self._wake = threading.Event()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="planning scene", daemon=True)
        self._server_uri = ""
        self._next_lookup_s = 0.0
        self._scene_changed = threading.Event()
        self._compared_s = 0.0
        self._compare_pause_s = _COMPARE_PAUSE_S
        self._last_problem = self._logged_problem = ""
        self._synchronising = threading.Lock()
        self._exact_at = (-1, -1)

    def connect(self) -> None:
        """Starts the thread and subscribes to changes by other nodes."""
        rospy.Subscriber(ros_names.MONITORED_PLANNING_SCENE, rospy.AnyMsg, self._on_scene_change, queue_size=1)
        self._thread.start()

    def close(self) -> None:
        """Stops the thread, unless the thread waits for a response of move_group; may be called twice."""
        self._stop.set()
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)

    def show(self, snapshot: WorldSnapshot) -> None:
        """Passes the latest state of the world to the thread without waiting."""
        self._snapshot = snapshot
        self._wake.set()

    def is_up_to_date(self, time_ns: int, revision: int) -> bool:
        """Returns whether the scene was synchronized at a simulated time [ns] and a revision of the world."""
        return self._exact_at == (time_ns, revision)

    def bring_up_to_date(self, snapshot: WorldSnapshot) -> None:
        """Waits until the scene exactly equals a snapshot; does nothing without move_group.

        Raises:
            PlanningSceneError: move_group rejects the change.
        """
        with self._synchronising:
            if not self._server_available():
                return
            self._compared_s = 0.0
            self._scene_changed.set()
            try:
                self._synchronise(snapshot, exact=True)
            except (rospy.ServiceException, rospy.ROSException, OSError) as error:
                self._fail(f"{type(error).__name__}: {error}")
            if self._last_problem:
                raise PlanningSceneError(f"the planning scene differs from the simulated world: {self._last_problem}")
            self._exact_at = (snapshot.time_ns, snapshot.revision)

    def _on_scene_change(self, _message: rospy.AnyMsg) -> None:
        self._scene_changed.set()
        self._wake.set()

    def _run(self) -> None:
        while not self._stop.is_set() and not rospy.is_shutdown():
            self._wake.wait(timeout=1.0)
            self._wake.clear()
            snapshot = self._snapshot
            if snapshot is None:
                continue
            try:
                with self._synchronising:
                    pause_s = self._synchronise(snapshot)
            except Exception as error:  # the thread must survive any failure of move_group or the network
                pause_s = self._fail(f"{type(error).__name__}: {error}")
            end = time.monotonic() + pause_s
            # A change of the held objects is urgent, because the next motion depends on it.
            while time.monotonic() < end and _held_models(self._snapshot) == _held_models(snapshot):
                if self._stop.wait(0.02):
                    return

    def _synchronise(self, snapshot: WorldSnapshot, exact: bool = False) -> float:
        """Sends all changes; returns the pause until the next synchronization [s]."""
        if not self._server_available():
            return _PRESENCE_PERIOD_S
        self._compare()
        changes = self._changes.changes_towards(snapshot, exact)
        if not changes:
            self._last_problem = self._last_problem if not exact else ""
            return _SYNC_PERIOD_S
        response = rospy.ServiceProxy(ros_names.APPLY_PLANNING_SCENE, ApplyPlanningScene)(self._message(changes))
        if not response.success:
            names = sorted({specs.collision_object_id(*change.key) for change in changes})
            return self._fail(f"move_group rejected a change of {', '.join(names)}")
        self._changes.confirm()
        if self._logged_problem:
            rospy.loginfo("planning scene: synchronized with the simulated world again")
        self._last_problem = self._logged_problem = ""
        return _SYNC_PERIOD_S

    def _compare(self) -> None:
        """Reads the objects of the scene if the scene has changed or the last comparison is old."""
        start_s = time.monotonic()
        if start_s - self._compared_s < (self._compare_pause_s if self._scene_changed.is_set() else _COMPARE_PERIOD_S):
            return
        self._scene_changed.clear()
        scene = rospy.ServiceProxy(ros_names.GET_PLANNING_SCENE, GetPlanningScene)(_OBJECTS).scene
        self._compared_s = time.monotonic()
        cost_s = self._compared_s - start_s
        self._compare_pause_s = min(max(_COMPARE_PAUSE_S, cost_s / _MAX_COMPARE_FRACTION), _COMPARE_PERIOD_S)
        ids = {specs.collision_object_id(*key): key for key in self._changes.keys}
        in_world = {ids[item.id] for item in scene.world.collision_objects if item.id in ids}
        held = scene.robot_state.attached_collision_objects
        attached = {ids[item.object.id]: item.link_name for item in held if item.object.id in ids}
        for key in self._changes.compare(in_world, attached):
            rospy.logwarn(
                "planning scene: another node removed '%s', which is still in the simulated world; motions are planned "
                "without this object until it moves or is spawned again. Remove all objects to restore all of them",
                specs.collision_object_id(*key),
            )

    def _server_available(self) -> bool:
        """Looks move_group up twice per second; a server at a new address starts without objects."""
        now_s = time.monotonic()
        if now_s >= self._next_lookup_s:
            self._next_lookup_s = now_s + _PRESENCE_PERIOD_S
            master = rosgraph.Master(rospy.get_name())
            try:
                master.lookupService(ros_names.GET_PLANNING_SCENE)
                uri = master.lookupService(ros_names.APPLY_PLANNING_SCENE)
            except (rosgraph.MasterException, OSError):
                uri = ""
            if uri and uri != self._server_uri:
                self._compared_s = 0.0
                rospy.loginfo("planning scene: sending the simulated world to move_group at %s", uri)
            self._server_uri = uri
        return bool(self._server_uri)

    def _fail(self, problem: str) -> float:
        # At the end of a launch, move_group may end before the simulation, so only repeated failures are logged.
        if problem == self._last_problem and problem != self._logged_problem:
            rospy.logwarn("planning scene: %s; the scene is read and the change is sent again", problem)
            self._logged_problem = problem
        self._last_problem = problem
        self._compared_s = 0.0
        return _RETRY_PERIOD_S

    def _message(self, changes: list[Change]) -> PlanningScene:
        scene = PlanningScene()
        scene.is_diff = True
        scene.robot_state.is_diff = True
        for change in changes:
            try:
                self._add(scene, change)
            except SimulationError as error:
                rospy.logerr("planning scene: '%s::%s' cannot be sent: %s", *change.key, error)
        return scene

    def _add(self, scene: PlanningScene, change: Change) -> None:
        model, link = change.key
        identity = specs.collision_object_id(model, link)
        attached, world = scene.robot_state.attached_collision_objects, scene.world.collision_objects
        if isinstance(change, Add | Attach) and change.link.visuals:
            scene.object_colors.append(ObjectColor(identity, ColorRGBA(*change.link.visuals[0].colour)))
        match change:
            case Add(link=spec, pose_in_world=pose):
                world.append(conversions.link_to_collision_object(model, spec, ros_names.WORLD_FRAME, pose))
            case Move(pose_in_world=pose):
                world.append(_move_message(identity, conversions.pose_to_msg(pose)))
            case Remove():
                world.append(CollisionObject(id=identity, operation=CollisionObject.REMOVE))
            case Attach(link=spec, carrier_link=carrier, pose_in_carrier=pose, touch_links=touch_links):
                item = conversions.link_to_collision_object(model, spec, carrier, pose)
                attached.append(AttachedCollisionObject(link_name=carrier, object=item, touch_links=list(touch_links)))
            case Detach(carrier_link=carrier):
                released = AttachedCollisionObject(link_name=carrier)
                released.object.id = identity
                released.object.operation = CollisionObject.REMOVE
                attached.append(released)


def _move_message(identity: str, pose: PoseMsg) -> CollisionObject:
    message = CollisionObject(id=identity, operation=CollisionObject.MOVE, pose=pose)
    message.header.frame_id = ros_names.WORLD_FRAME
    return message


def _held_models(snapshot: WorldSnapshot | None) -> list[tuple[str, str]]:
    return [(held.model, held.carrier_link) for held in snapshot.held] if snapshot is not None else []
