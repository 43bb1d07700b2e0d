# SPDX-License-Identifier: BSD-3-Clause
"""Node that generates grasps for the objects of the planning scene and stores the grasps in the grasp manager."""

from __future__ import annotations

import heapq
import threading
import time
from collections import Counter
from contextlib import nullcontext
from enum import Enum

import rospy
from scipy.spatial.transform import Rotation
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger, TriggerResponse

from modular_framework_core.commander.arm_commander import ArmCommander, CommanderError
from modular_framework_core.grasp_generation.generated_objects import GeneratedObjects, at_rest
from modular_framework_core.grasp_generation.grasp_candidates import (
    ConnectedMethod,
    GraspCandidate,
    GraspMethod,
    GraspQuery,
    MeasuredMethod,
    MethodFaultError,
    NoCandidatesError,
    SeeingMethod,
)
from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometryError, measure_gripper
from modular_framework_core.grasp_generation.planning_scene_objects import SceneObject
from modular_framework_core.grasp_generation.ros_generator_settings import (
    GeneratorSettings,
    find_gripper_joint,
    read_settings,
)
from modular_framework_core.grasp_generation.ros_grasp_reachability import Reach, check_reach
from modular_framework_core.grasp_generation.ros_scene_objects import NoGraspError, NoObjectError, SceneObjects
from modular_framework_core.grasp_generation.ros_stored_grasps import StoredGrasps
from modular_framework_core.grasp_generation.wait_limit import WaitLimit
from modular_framework_core.grasping.grasp_messages import generate_pose_stamped_message, get_standardised_grasp
from modular_framework_core.msg import StandardisedGrasp
from modular_framework_ros.calls import CallError
from modular_framework_ros.component_report import ComponentReporter
from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.reported_figures import CANDIDATES, CHECKED, REACHABLE, Figure
from modular_framework_ros.simulated_time import SimulatedTime
from modular_framework_ros.start_up import start_timeout

SIGNAL_TOPIC = "grasp_generated"
SCENE_PERIOD_S = 0.25
SETTINGS_PERIOD_S = 2.0
"""Period for reading the parameters while the scene is watched [s]; one reading takes about 24 calls to the master."""
WAITING_PERIOD_S = 10.0
WAITING_TASK = "/task/wait_for_start"
"""Parameter that is true if the task waits for a start request."""


class KeptGrasps(Enum):
    """Grasps of the last generation that a request keeps, if no object has moved since the generation."""

    NONE = "no grasps"
    LEFT = "the remaining grasps, if any"
    COMPLETE = "all grasps, if none has been taken"


SERVICES = {
    "generate_grasps": KeptGrasps.NONE,
    "~generate": KeptGrasps.NONE,
    "refresh_grasps": KeptGrasps.LEFT,
    "~refresh": KeptGrasps.LEFT,
    f"{SIGNAL_TOPIC}/renew": KeptGrasps.COMPLETE,
}


class GraspGenerator:
    """Generates grasps when an object appears in the crop box or moves, and on request.

    New grasps replace the previous grasps. An object that the robot sets down counts as the object of the same name
    that was attached before.

    - Parameters: see ``ros_generator_settings`` and the parameters of the method. The parameters are read for every
      generation, and every 2 s while the scene is watched.
    - Publishers: ``grasp_generated`` (std_msgs/Bool, latched), ``grasp_generated/reason`` (std_msgs/String, latched),
      ``component_reports`` (std_msgs/String, JSON: duration and number of grasps of a generation).
    - Services ``generate_grasps`` and ``~generate`` (std_srvs/Trigger): generate grasps.
    - Services ``refresh_grasps`` and ``~refresh`` (std_srvs/Trigger): wait until the objects are at rest, then generate
      grasps if an object has moved or no grasp of the last generation remains.
    - Service ``grasp_generated/renew`` (std_srvs/Trigger): like ``refresh_grasps``, and also generates grasps if a
      grasp has been taken. Waits for an object for at most ``~scene_timeout``. A task calls this service before it
      reads the signal, because the signal can be from the previous task.
    - Services called: ``get_planning_scene``, ``compute_ik``, ``add_grasp``, ``remove_grasp``, ``list_grasps``,
      ``clear_anonymous_grasps``.

    Args:
        method: Grasp method.
    """

    def __init__(self, method: GraspMethod) -> None:
        """Creates an unconnected generator; see :meth:`connect`."""
        self._method = method
        self._generated = GeneratedObjects()
        self._scene = SceneObjects()
        self._stored = StoredGrasps()
        self._generating = threading.RLock()
        self._time = SimulatedTime()

    def connect(self) -> None:
        """Computes the gripper geometry and waits for the required nodes, at most ``/start_timeout`` for each node.

        Raises:
            NoGraspError: A node or a part of the robot description is missing; the text names it.
            ParameterError: A parameter is missing or invalid.
        """
        self._reporter = ComponentReporter("generation")
        self._reason = rospy.Publisher(f"{SIGNAL_TOPIC}/reason", String, queue_size=1, latch=True)
        settings = read_settings()
        self._commander = ArmCommander(settings.arm_group)
        try:
            self._commander.connect()
            self._scene.connect(start_timeout())
            self._stored.connect(start_timeout())
            tip = self._commander.group.tip_link
            self._gripper = measure_gripper(
                str(rospy.get_param("robot_description")), tip, find_gripper_joint(settings)
            )
        except (CommanderError, CallError, GripperGeometryError) as error:
            raise NoGraspError(str(error)) from error
        if isinstance(self._method, ConnectedMethod):
            self._method.connect()
        # advertised last, because clients take this topic as a sign that the services are ready
        self._signal = rospy.Publisher(SIGNAL_TOPIC, Bool, queue_size=1, latch=True)
        self._services = [
            rospy.Service(name, Trigger, lambda _, kept=kept: self._on_demand(kept)) for name, kept in SERVICES.items()
        ]

    def watch(self) -> None:
        """Generates grasps for each new or moved object until ROS shuts down.

        With ``/wait_for_planning``, the node generates once, and afterwards only on request. Otherwise the time at
        which it reads the scene would depend on the load of the machine. If the task waits for its start, the node
        generates only on request: the client that starts the task requests grasps first, and a second generation would
        slow down the measured generation. The node waits at most ``~scene_timeout`` of the ROS clock for a missing
        object or for a service that does not respond.
        """
        before: list[SceneObject] = []
        on_request = self._time.enabled and bool(rospy.get_param(WAITING_TASK, False))
        # None: the generation for all present objects is finished
        wait_limit: WaitLimit | None = None if on_request else WaitLimit()
        scene_was_read = False
        settings, settings_read_s = read_settings(), time.monotonic()
        while not rospy.is_shutdown():
            if wait_limit is None and self._time.enabled:
                rospy.rostime.wallsleep(SCENE_PERIOD_S)
                continue
            try:
                if wait_limit or time.monotonic() - settings_read_s > SETTINGS_PERIOD_S:
                    settings, settings_read_s = read_settings(), time.monotonic()
                # a concurrent request reads the scene later, so its grasps replace the grasps of this reading
                with self._generating if self._time.enabled else nullcontext():
                    objects = self._scene.targets(settings)
                    self._generated.keep({item.name for item in objects} | self._scene.attached)
                    scene_was_read = True
                    if self._generated.stale(objects):
                        wait_limit = wait_limit or WaitLimit()
                        if at_rest(before, objects):
                            with self._generating:  # a request may have generated the grasps in the meantime
                                if self._generated.stale(objects):
                                    self._signal_grasps(settings, objects)
                            wait_limit = None
                    before = objects
            except ParameterError as error:  # services return this error in their response
                rospy.logerr_throttle(WAITING_PERIOD_S, f"{rospy.get_name()} generates no grasps: {error}")
            except (NoObjectError, CallError, CommanderError) as error:
                if isinstance(error, NoObjectError):
                    self._generated.keep(self._scene.attached)
                    if wait_limit and not scene_was_read:
                        wait_limit, scene_was_read = WaitLimit(), True
                if wait_limit and self._gives_up(error, wait_limit, settings):
                    self._generated.mark(before)
                    wait_limit = None
                before = []
            rospy.rostime.wallsleep(SCENE_PERIOD_S)

    def _gives_up(self, error: Exception, wait_limit: WaitLimit, settings: GeneratorSettings) -> bool:
        """Signals failure and returns True if the timeout has elapsed; otherwise logs the cause of the wait."""
        if wait_limit.is_exceeded(rospy.get_time(), settings.scene_timeout_s):
            self._publish(False, f"{error} (waited {settings.scene_timeout_s:.0f} s of the ROS clock)")
            return True
        rospy.loginfo_throttle(WAITING_PERIOD_S, f"{rospy.get_name()}: waiting, because {error}.")
        return False

    def _on_demand(self, kept: KeptGrasps) -> TriggerResponse:
        try:
            settings = read_settings()
            self._time.catch_up()
            with self._generating:
                objects = self._objects(settings, kept)
                if kept is not KeptGrasps.NONE and self._may_stay(objects, kept):
                    names = sorted(target.name for target in objects)
                    return TriggerResponse(True, f"nothing has moved; the grasps of {names} stay")
                return TriggerResponse(*self._signal_grasps(settings, objects))
        except (NoGraspError, CallError, CommanderError, ParameterError) as error:
            self._publish(False, str(error))
            return TriggerResponse(False, str(error))

    def _may_stay(self, objects: list[SceneObject], kept: KeptGrasps) -> bool:
        """Returns whether no object has moved and the manager still has the grasps that a request keeps."""
        required_count = self._stored.count if kept is KeptGrasps.COMPLETE else 1
        return not self._generated.stale(objects) and self._stored.left() >= max(1, required_count)

    def _objects(self, settings: GeneratorSettings, kept: KeptGrasps) -> list[SceneObject]:
        """Returns the objects to grasp; waits until they are at rest, at most the timeout, except for `Kept.NONE`.

        For `Kept.COMPLETE`, the method also waits for an object.
        """
        before: list[SceneObject] = []
        wait_limit = WaitLimit()
        while True:
            late = kept is KeptGrasps.NONE or wait_limit.is_exceeded(rospy.get_time(), settings.scene_timeout_s)
            objects: list[SceneObject] = []
            try:
                objects = self._scene.targets(settings)
            except NoObjectError as error:
                try:
                    return self._seen(settings, error)
                except NoObjectError:
                    if late or kept is not KeptGrasps.COMPLETE:
                        raise
            if objects and (
                late or at_rest(before, objects) or (kept is KeptGrasps.COMPLETE and self._may_stay(objects, kept))
            ):
                return objects
            before = objects
            if self._time.enabled:
                self._time.sleep(SCENE_PERIOD_S)
            else:
                rospy.rostime.wallsleep(SCENE_PERIOD_S)

    def _seen(self, settings: GeneratorSettings, error: NoObjectError) -> list[SceneObject]:
        """Returns the objects that the method detects itself, because the planning scene has none.

        Raises:
            NoObjectError: The method detects no object; or `error`, if the method has no sensors or the settings name
                an object.
        """
        if settings.object_name or not isinstance(self._method, SeeingMethod):
            raise error
        try:
            with self._time.held("grasp generation", during_motions=True):
                return self._method.seen_objects(settings.crop, settings.seed)
        except NoCandidatesError as unseen:
            raise NoObjectError(f"{error}; and {unseen}") from unseen

    def _signal_grasps(self, settings: GeneratorSettings, objects: list[SceneObject]) -> tuple[bool, str]:
        """Generates grasps, replaces the stored grasps, and signals the result.

        Args:
            settings: Parameters of the generator.
            objects: Objects to grasp.

        Returns:
            Success and text of the signal.

        Raises:
            CallError: A service does not respond.
            CommanderError: move_group does not respond.
        """
        # a service request can arrive while grasps of a new object are generated
        with self._generating, self._time.held("grasp generation", during_motions=True):
            with self._reporter.work(rospy.get_name()) as work:
                try:
                    grasps = self._generate(settings, objects, work.figures)
                    self._stored.replace(grasps, settings.name_prefix)
                    success, text = True, f"{len(grasps)} grasps of {sorted({g.object_id for g in grasps})} were stored"
                except NoGraspError as error:
                    self._stored.replace([], settings.name_prefix)
                    success, text, work.reason = False, str(error), str(error)
                if isinstance(self._method, MeasuredMethod):
                    work.figures |= self._method.take_figures()
            self._generated.mark(objects)
            self._publish(success, text)
            return success, text

    def _publish(self, success: bool, text: str) -> None:
        (rospy.loginfo if success else rospy.logerr)("%s: %s.", rospy.get_name(), text)
        self._reason.publish(text)
        self._signal.publish(success)

    def _generate(
        self, settings: GeneratorSettings, objects: list[SceneObject], figures: dict[Figure, float]
    ) -> list[StandardisedGrasp]:
        found_in: list[list[tuple[SceneObject, GraspCandidate]]] = []
        causes: list[str] = []
        present = self._scene.read()
        for target in objects:
            support = max(target.bottom, settings.crop.low[2]) if settings.crop.holds(target.centre) else target.bottom
            obstacles = tuple(other for other in present if other.name != target.name)
            query = GraspQuery(target, obstacles, support, self._gripper, settings.seed)
            try:
                found_in.append([(target, candidate) for candidate in self._method.candidates(query)])
            except MethodFaultError as error:
                raise NoGraspError(f"the method failed: {error}") from error
            except NoCandidatesError as error:
                causes.append(str(error))
        ranked = list(heapq.merge(*found_in, key=lambda pair: -pair[1].quality))
        if not ranked:
            raise NoGraspError(
                f"no part of {'; '.join(_sides(target) for target in objects)} can be grasped {self._method.manner}: "
                + ("; ".join(causes) or self._usual_cause())
            )
        figures[CANDIDATES] = len(ranked)
        return self._reachable(ranked, settings, figures)

    def _usual_cause(self) -> str:
        return f"the gripper opens to {self._gripper.max_opening:.3f} m and needs flat or round sides"

    def _reachable(
        self,
        ranked: list[tuple[SceneObject, GraspCandidate]],
        settings: GeneratorSettings,
        figures: dict[Figure, float],
    ) -> list[StandardisedGrasp]:
        chosen: list[StandardisedGrasp] = []
        reasons: Counter[str] = Counter()
        tried = ranked[: settings.max_checks]
        for target, candidate in tried:
            message = self._message(target, candidate, settings)
            reach = check_reach(self._commander, message) if settings.check_reachability else Reach("")
            if reach.reason:
                reasons[reach.reason] += 1
                continue
            message.grasp_quality = self._method.reached_quality(candidate, reach.joint_travel)
            chosen.append(message)
            if len(chosen) >= settings.max_grasps:
                break
        if settings.check_reachability:
            figures |= {CHECKED: len(chosen) + reasons.total(), REACHABLE: len(chosen)}
        if not chosen:
            names = sorted({target.name for target, _ in tried})
            raise NoGraspError(
                f"no grasp of {names} is reachable: all {len(tried)} checked grasps fail, most often because "
                f"{reasons.most_common(1)[0][0]}"
            )
        return sorted(chosen, key=lambda message: -message.grasp_quality)

    def _message(
        self, target: SceneObject, candidate: GraspCandidate, settings: GeneratorSettings
    ) -> StandardisedGrasp:
        orientation = (Rotation.from_matrix(candidate.hand_axes) * Rotation.from_matrix(self._gripper.axes.T)).as_quat()
        poses = [
            generate_pose_stamped_message(settings.frame, position.tolist(), orientation.tolist())
            for position in (candidate.pregrasp_position, candidate.position, candidate.postgrasp_position)
        ]
        closed = [self._gripper.closed_position]
        return get_standardised_grasp(
            [self._gripper.joint],
            [candidate.pregrasp_joint],
            closed,
            closed,
            [settings.torque],
            *poses,
            grasp_quality=candidate.quality,
            hand_id=settings.hand_id,
            object_id=target.name,
        )


def _sides(target: SceneObject) -> str:
    lengths = target.surface.points.max(axis=0) - target.surface.points.min(axis=0)
    return f"'{target.name}' with the sides {' x '.join(f'{length:.3f}' for length in lengths)} m"


def run_grasp_generator(name: str, method: GraspMethod) -> int:
    """Runs a grasp generator until ROS shuts down.

    The generator runs in a separate thread. In the main thread, a signal during a call to the master would deadlock:
    the signal handler waits for the lock of the interrupted call.

    Args:
        name: Name of the node.
        method: Grasp method.

    Returns:
        Exit code: 1 if a required node, parameter or part of the robot description is missing.
    """
    rospy.init_node(name)
    codes: list[int] = []
    threading.Thread(target=_work, args=(method, codes), daemon=True, name="grasp generation").start()
    rospy.spin()
    return codes[0] if codes else 0


def _work(method: GraspMethod, codes: list[int]) -> None:
    """Generates grasps until ROS shuts down; appends the exit code to the list on failure and ends the node."""
    try:
        generator = GraspGenerator(method)
        generator.connect()
        generator.watch()
    except Exception as error:  # any error must end the node, which could do nothing useful afterwards
        if not rospy.is_shutdown():
            codes.append(1)
            rospy.logfatal(
                "%s: %s", rospy.get_name(), error, exc_info=not isinstance(error, NoGraspError | ParameterError)
            )
    finally:
        rospy.signal_shutdown("the generator has ended")
