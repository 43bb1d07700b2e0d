# SPDX-License-Identifier: BSD-3-Clause
"""Watches the planning scene, generates top-down grasps for what stands there, and stores them in the grasp manager."""

from __future__ import annotations

import threading
from collections import Counter

import rospy
from moveit_msgs.msg import MoveItErrorCodes, PlanningSceneComponents
from moveit_msgs.srv import GetPlanningScene, GetPlanningSceneRequest
from scipy.spatial.transform import Rotation
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger, TriggerResponse

from modular_framework_core.commander.arm_commander import ArmCommander, CommanderError
from modular_framework_core.grasping.grasp_messages import generate_pose_stamped_message, get_standardised_grasp
from modular_framework_core.msg import StandardisedGrasp
from modular_framework_ros.calls import CallError, call_service, wait_for_service
from modular_framework_ros.start_up import start_timeout
from top_down_grasps.generated_objects import GeneratedObjects, at_rest
from top_down_grasps.gripper_geometry import GripperGeometryError, measure_gripper
from top_down_grasps.planning_scene_objects import (
    CropBox,
    SceneObject,
    SceneObjectError,
    is_named,
    scene_object,
)
from top_down_grasps.ros_generator_settings import GeneratorSettings, read_settings
from top_down_grasps.ros_stored_grasps import StoredGrasps
from top_down_grasps.top_down import TopDownGrasp, top_down_grasps
from top_down_grasps.wait_limit import WaitLimit

SIGNAL_TOPIC = "grasp_generated"
GENERATE_SERVICES = ("generate_grasps", "~generate")
REFRESH_SERVICES = ("refresh_grasps", "~refresh")
SERVICE_TIMEOUT_S = 10.0
SCENE_PERIOD_S = 0.25
WAITING_PERIOD_S = 10.0


class NoGraspError(RuntimeError):
    """No grasp can be offered; the text says why."""


class NoObjectError(NoGraspError):
    """The planning scene was read, and what is to be grasped is not in it."""


class TopDownGraspGenerator:
    """Generates grasps when an object appears in the crop box or was moved, or on demand.

    New grasps replace the ones that were generated before. An object that the robot carries counts as the one that
    is set down under its name.

    Parameters: see :mod:`ros_generator_settings`; they are read again for every generation.
    Publishers: ``grasp_generated`` (std_msgs/Bool, latched), ``grasp_generated/reason`` (std_msgs/String, latched).
    Services (std_srvs/Trigger), the names of every method first, this node's own second:
        ``generate_grasps``, ``~generate``: generates grasps.
        ``refresh_grasps``, ``~refresh``: waits until the objects rest, and generates grasps if one was moved since;
            those that are left of the last generation stay otherwise.
    Services called: ``get_planning_scene``, ``compute_ik``, ``add_grasp``, ``remove_grasp``,
        ``clear_anonymous_grasps``.
    """

    def __init__(self) -> None:
        """Connects to nothing yet, see :meth:`connect`."""
        self._generated = GeneratedObjects()
        self._attached: set[str] = set()
        self._stored = StoredGrasps()
        self._generating = threading.Lock()

    def connect(self) -> None:
        """Measures the gripper and waits for the nodes it needs, at most ``/start_timeout`` for each.

        Raises:
            NoGraspError: Something needed is missing; the text names it.
        """
        self._signal = rospy.Publisher(SIGNAL_TOPIC, Bool, queue_size=1, latch=True)
        self._reason = rospy.Publisher(f"{SIGNAL_TOPIC}/reason", String, queue_size=1, latch=True)
        self._scene = rospy.ServiceProxy("get_planning_scene", GetPlanningScene)
        settings = read_settings()
        if not settings.gripper_joint:
            raise NoGraspError(
                f"parameter '{rospy.resolve_name('~gripper_joint')}' is not set; it has to name the "
                "actuated joint of the fingers; set it in generative_methods_config.yaml"
            )
        self._commander = ArmCommander(settings.arm_group)
        try:
            self._commander.connect()
            wait_for_service(self._scene, start_timeout())
            self._stored.connect(start_timeout())
            tip = self._commander.group.tip_link
            self._gripper = measure_gripper(str(rospy.get_param("robot_description")), tip, settings.gripper_joint)
        except (CommanderError, CallError, GripperGeometryError) as error:
            raise NoGraspError(str(error)) from error
        self._services = [
            rospy.Service(name, Trigger, lambda _, refresh=refresh: self._on_demand(refresh))
            for refresh, names in ((False, GENERATE_SERVICES), (True, REFRESH_SERVICES))
            for name in names
        ]

    def watch(self) -> None:
        """Generates for each object that appears, also when it was there before, or was moved, until ROS shuts down.

        What may still arrive is waited for, at most ``~scene_timeout`` of the ROS clock: an object that is not
        there yet, a service that does not answer in time on a busy machine.
        """
        before: list[SceneObject] = []
        wait_limit: WaitLimit | None = WaitLimit()  # None: every object that is there has been handled
        scene_was_read = False
        while not rospy.is_shutdown():
            settings = read_settings()
            try:
                objects = self._candidates(settings)
                self._generated.keep({found.name for found in objects} | self._attached)
                scene_was_read = True
                if self._generated.stale(objects):
                    wait_limit = wait_limit or WaitLimit()
                    if at_rest(before, objects):
                        self._signal_grasps(settings, objects, refresh=True)
                        wait_limit = None
                before = objects
            except (NoObjectError, CallError, CommanderError) as error:
                if isinstance(error, NoObjectError):
                    self._generated.keep(self._attached)
                    if wait_limit and not scene_was_read:
                        wait_limit, scene_was_read = WaitLimit(), True
                if wait_limit and self._gives_up(error, wait_limit, settings):
                    self._generated.mark(before)
                    wait_limit = None
                before = []
            rospy.rostime.wallsleep(SCENE_PERIOD_S)

    def _gives_up(self, error: Exception, wait_limit: WaitLimit, settings: GeneratorSettings) -> bool:
        """Signals failure once the wait limit is exceeded; logs what is waited for until then."""
        if wait_limit.is_exceeded(rospy.get_time(), settings.scene_timeout_s):
            self._publish(False, f"{error} (waited {settings.scene_timeout_s:.0f} s of the ROS clock)")
            return True
        rospy.loginfo_throttle(WAITING_PERIOD_S, f"top_down_grasp_generator: waiting, for {error}.")
        return False

    def _on_demand(self, refresh: bool) -> TriggerResponse:
        try:
            settings = read_settings()
            objects = self._resting(settings) if refresh else self._candidates(settings)
            return TriggerResponse(*self._signal_grasps(settings, objects, refresh))
        except (NoGraspError, CallError, CommanderError) as error:
            self._publish(False, str(error))
            return TriggerResponse(False, str(error))

    def _resting(self, settings: GeneratorSettings) -> list[SceneObject]:
        """Returns the objects to grasp once they rest, or as they are when that takes too long."""
        before, wait_limit = self._candidates(settings), WaitLimit()
        while True:
            rospy.rostime.wallsleep(SCENE_PERIOD_S)
            objects = self._candidates(settings)
            if at_rest(before, objects) or wait_limit.is_exceeded(rospy.get_time(), settings.scene_timeout_s):
                return objects
            before = objects

    def _signal_grasps(
        self, settings: GeneratorSettings, objects: list[SceneObject], refresh: bool
    ) -> tuple[bool, str]:
        """Stores grasps in place of the earlier ones and signals it, or signals that what is there cannot be grasped.

        Args:
            settings: The parameters.
            objects: What to grasp.
            refresh: Whether grasps of objects that have not moved since are left as they are.

        Returns:
            What was signalled.

        Raises:
            CallError, CommanderError: Another node does not answer.
        """
        with self._generating:  # a request by service may come while grasps of a new object are generated
            if refresh and not self._generated.stale(objects):
                return True, f"nothing has moved; the grasps of {sorted(found.name for found in objects)} stay"
            try:
                grasps = self._generate(settings, objects)
                self._stored.replace(grasps, settings.name_prefix)
                success, text = True, f"{len(grasps)} grasps of {sorted({g.object_id for g in grasps})} were stored"
            except NoGraspError as error:
                self._stored.replace([], settings.name_prefix)
                success, text = False, str(error)
            self._generated.mark(objects)
            self._publish(success, text)
            return success, text

    def _publish(self, success: bool, text: str) -> None:
        (rospy.loginfo if success else rospy.logerr)("top_down_grasp_generator: %s.", text)
        self._reason.publish(text)
        self._signal.publish(success)

    def _generate(self, settings: GeneratorSettings, objects: list[SceneObject]) -> list[StandardisedGrasp]:
        ranked: list[tuple[SceneObject, TopDownGrasp]] = []
        for found in objects:
            support = max(found.bottom, settings.crop.low[2]) if settings.crop.holds(found.centre) else found.bottom
            ranked += [
                (found, grasp) for grasp in top_down_grasps(found.surface, support, self._gripper, settings.top_down)
            ]
        if not ranked:
            sizes = "; ".join(
                f"'{found.name}' with the sides "
                + " x ".join(
                    f"{side:.3f}" for side in found.surface.points.max(axis=0) - found.surface.points.min(axis=0)
                )
                + " m"
                for found in objects
            )
            raise NoGraspError(
                f"no part of {sizes} can be grasped from above: the gripper opens to "
                f"{self._gripper.max_opening:.3f} m and needs flat or round sides"
            )
        ranked.sort(key=lambda pair: -pair[1].quality)
        return self._reachable(ranked, settings)

    def _reachable(
        self, ranked: list[tuple[SceneObject, TopDownGrasp]], settings: GeneratorSettings
    ) -> list[StandardisedGrasp]:
        chosen: list[StandardisedGrasp] = []
        reasons: Counter[str] = Counter()
        tried = ranked[: settings.max_checks]
        for found, grasp in tried:
            message = self._message(found, grasp, settings)
            reason = self._why_unreachable(message) if settings.check_reachability else ""
            if reason:
                reasons[reason] += 1
                continue
            chosen.append(message)
            if len(chosen) >= settings.max_grasps:
                break
        if not chosen:
            names = sorted({found.name for found, _ in tried})
            raise NoGraspError(
                f"no grasp of {names} is reachable: all {len(tried)} that were tried fail, for example "
                f"because {reasons.most_common(1)[0][0]}"
            )
        return chosen

    def _why_unreachable(self, grasp: StandardisedGrasp) -> str:
        posture = grasp.pregrasp.posture
        seed = self._commander.current_joints() | dict(zip(posture.name, posture.position, strict=True))
        for stage in ("pregrasp", "grasp", "postgrasp"):
            result = self._commander.solve_ik(getattr(grasp, stage).pose, seed)
            if result.error_code == MoveItErrorCodes.COMMUNICATION_FAILURE:
                raise CallError(result.reason)
            if not result:
                return f"at the {stage} pose, {result.reason}"
            if stage == "pregrasp" and (touching := self._commander.contacts(result.joints)):
                # the arm arrives there with the fingers as they are now, and takes the posture afterwards
                return f"at the pregrasp pose, with the fingers as they are now, the arm is {touching}"
            seed = seed | result.joints
        return ""

    def _message(self, found: SceneObject, grasp: TopDownGrasp, settings: GeneratorSettings) -> StandardisedGrasp:
        x, y, z = grasp.position
        heights = (z + settings.top_down.approach_distance_m, z, z + settings.top_down.lift_distance_m)
        orientation = (Rotation.from_quat(grasp.quaternion_xyzw) * Rotation.from_matrix(self._gripper.axes.T)).as_quat()
        poses = [
            generate_pose_stamped_message(settings.frame, (x, y, height), orientation.tolist()) for height in heights
        ]
        closed = [self._gripper.closed_position]
        return get_standardised_grasp(
            [self._gripper.joint],
            [grasp.pregrasp_joint],
            closed,
            closed,
            [settings.torque],
            *poses,
            grasp_quality=grasp.quality,
            hand_id=settings.hand_id,
            object_id=found.name,
        )

    def _candidates(self, settings: GeneratorSettings) -> list[SceneObject]:
        """Objects to grasp: the named one, or all in the crop box.

        Raises:
            NoObjectError: There is none.
            CallError: move_group does not answer.
        """
        objects = self._scene_objects()
        if settings.object_name:
            named = [found for found in objects if is_named(found.name, settings.object_name)]
            if not named:
                raise NoObjectError(
                    f"the planning scene has no object '{settings.object_name}'; "
                    f"it has {sorted(found.name for found in objects)}"
                )
            return named
        inside = [found for found in objects if settings.crop.holds(found.centre)]
        if not inside:
            raise NoObjectError(
                f"no object of the planning scene is in the crop box {_describe(settings.crop)} of "
                f"frame '{settings.frame}'; there are "
                f"{[_place(found) for found in objects] or 'no objects'}"
            )
        return inside

    def _scene_objects(self) -> list[SceneObject]:
        components = PlanningSceneComponents(
            components=PlanningSceneComponents.WORLD_OBJECT_NAMES
            | PlanningSceneComponents.WORLD_OBJECT_GEOMETRY
            | PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS
        )
        answer = call_service(self._scene, GetPlanningSceneRequest(components=components), SERVICE_TIMEOUT_S)
        self._attached = {item.object.id for item in answer.scene.robot_state.attached_collision_objects}
        objects = []
        for message in answer.scene.world.collision_objects:
            try:
                found = scene_object(message)
            except (SceneObjectError, ValueError) as error:
                rospy.logwarn_throttle(30.0, f"top_down_grasp_generator: {error}; this object is left out.")
                continue
            objects += [found] if found is not None else []
        return objects


def _describe(crop: CropBox) -> str:
    return ", ".join(f"{axis} {low} to {high}" for axis, low, high in zip("xyz", crop.low, crop.high, strict=True))


def _place(found: SceneObject) -> str:
    x, y, z = found.centre
    return f"{found.name} at ({x:.2f}, {y:.2f}, {z:.2f}) m"


def main() -> int:
    """Runs the node ``top_down_grasp_generator``; returns 1 when something it needs is missing.

    The work has a thread of its own: a signal that met the main thread inside a call to the master would wait for that
    call's lock, which only the interrupted main thread could give back.
    """
    rospy.init_node("top_down_grasp_generator")
    codes: list[int] = []
    threading.Thread(target=_work, args=(codes,), daemon=True, name="top-down grasps").start()
    rospy.spin()
    return codes[0] if codes else 0


def _work(codes: list[int]) -> None:
    """Generates until ROS shuts down; leaves the exit code in the list and ends the node."""
    try:
        generator = TopDownGraspGenerator()
        generator.connect()
        generator.watch()
    except Exception as error:  # whatever it is must end the node, which would stay without doing anything
        if not rospy.is_shutdown():
            codes.append(1)
            rospy.logfatal("top_down_grasp_generator: %s", error, exc_info=not isinstance(error, NoGraspError))
    finally:
        rospy.signal_shutdown("the generator has ended")
