# SPDX-License-Identifier: BSD-3-Clause
"""A robot without hardware for move_group, and the calls and messages of a client."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from functools import cache
from typing import Any

import actionlib
import numpy as np
import rospy
from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryResult,
    GripperCommandAction,
    GripperCommandResult,
)
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    Constraints,
    JointConstraint,
    MotionPlanRequest,
    MoveItErrorCodes,
    OrientationConstraint,
    PlanningScene,
    PlanningSceneComponents,
    PositionConstraint,
    RobotState,
)
from moveit_msgs.srv import ApplyPlanningScene, GetMotionPlan, GetPlanningScene, GetPositionFK
from sensor_msgs.msg import JointState
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import Header, String

from modular_framework_testing.ros_session import hears, until

LAUNCH = """<launch>
  <include file="$(find ur5_ezgripper_moveit_config)/launch/move_group.launch">
    <arg name="load_robot_description" value="true"/>
  </include>
</launch>"""
GROUP = "arm_and_manipulator"
ARM = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
TIP = "eg_manipulator"
GRIPPER = "ezgripper_knuckle_palm_L1_1"
START = [1.57, -1.57, 1.2, -1.2, -1.57, 0.0]
DOWN = Quaternion(1.0, 0.0, 0.0, 0.0)
OK = MoveItErrorCodes.SUCCESS


class FakeArm:
    """Joint states and controllers without a robot.

    The arm controller jumps from point to point at the times of the trajectory. The gripper controller, if requested,
    reaches its goal at once.
    """

    def __init__(self, with_gripper: bool = False) -> None:
        self.positions = dict(zip(ARM, START, strict=True)) | {GRIPPER: 0.3}
        self.cancelled = threading.Event()
        self._publisher = rospy.Publisher("joint_states", JointState, queue_size=20)
        self._server = actionlib.SimpleActionServer(
            "arm_trajectory_controller/follow_joint_trajectory",
            FollowJointTrajectoryAction,
            self._follow,
            auto_start=False,
        )
        self._server.start()
        self._servers = [self._server]
        self.durations_s: list[float] = []  # of the motions it was given
        self.grips: list[float] = []
        if with_gripper:
            self._gripper = actionlib.SimpleActionServer(
                "ezgripper_controller/gripper_cmd", GripperCommandAction, self._grip, auto_start=False
            )
            self._gripper.start()
            self._servers.append(self._gripper)
        self._timer = rospy.Timer(rospy.Duration(0.02), self._publish)

    def close(self) -> None:
        """Ends joint states and controllers, before rospy closes the topics."""
        self._timer.shutdown()
        self._timer.join(1.0)
        for server in self._servers:
            server.action_server.stop()

    def settle(self) -> None:
        """Waits until move_group knows the positions of the robot."""

        def is_known() -> bool:
            state = call(
                "get_planning_scene", GetPlanningScene, PlanningSceneComponents(PlanningSceneComponents.ROBOT_STATE)
            ).scene.robot_state.joint_state
            known = dict(zip(state.name, state.position, strict=True))
            return all(abs(known[name] - value) < 1e-9 for name, value in self.positions.items())

        until(is_known, "the robot's position in the node")

    def until_moving(self, joint: str = ARM[0]) -> None:
        """Waits until the first motion from the start begins."""
        place = START[ARM.index(joint)]
        until(lambda: abs(self.positions[joint] - place) > 1e-3, "the begin of the motion")

    def publish(self) -> None:
        """Publishes joint states once."""
        self._publish(None)

    def _publish(self, _: Any) -> None:
        if rospy.is_shutdown():
            return
        self._publisher.publish(
            JointState(Header(stamp=rospy.Time.now()), list(self.positions), list(self.positions.values()), [], [])
        )

    def _follow(self, goal: Any) -> None:
        begun = time.monotonic()
        self.durations_s.append(goal.trajectory.points[-1].time_from_start.to_sec())
        for point in goal.trajectory.points:
            while time.monotonic() - begun < point.time_from_start.to_sec():
                if self._server.is_preempt_requested():
                    self.cancelled.set()
                    self._server.set_preempted(FollowJointTrajectoryResult())
                    return
                time.sleep(0.002)
            self.positions.update(zip(goal.trajectory.joint_names, point.positions, strict=True))
        self._server.set_succeeded(FollowJointTrajectoryResult())

    def _grip(self, goal: Any) -> None:
        self.positions[GRIPPER] = goal.command.position
        self.grips.append(goal.command.position)
        self._gripper.set_succeeded(GripperCommandResult(position=goal.command.position, reached_goal=True))


def call(name: str, kind: Any, *args: Any) -> Any:
    """Waits for a service and calls it.

    Args:
        name: Name of the service.
        kind: Type of the service.
        *args: Fields of the request.
    """
    rospy.wait_for_service(name, 30.0)
    return rospy.ServiceProxy(name, kind)(*args)


def box(name: str, x: float, y: float, z: float, size: tuple[float, float, float]) -> CollisionObject:
    """Returns a box in the frame `world`.

    Args:
        name: Name of the object.
        x: Centre along x [m].
        y: Centre along y [m].
        z: Centre along z [m].
        size: Edge lengths [m].
    """
    message = CollisionObject(
        id=name,
        primitives=[SolidPrimitive(SolidPrimitive.BOX, list(size))],
        primitive_poses=[Pose(Point(x, y, z), Quaternion(0, 0, 0, 1))],
    )
    message.header.frame_id = "world"
    return message


def add(*objects: CollisionObject) -> bool:
    """Adds objects to the planning scene; returns whether move_group applied them."""
    scene = PlanningScene(is_diff=True)
    scene.world.collision_objects = list(objects)
    return bool(call("apply_planning_scene", ApplyPlanningScene, scene).success)


def tip_pose(values: Any, frame: str = "world", link: str = TIP) -> Pose:
    """Returns the pose of a link by `compute_fk`.

    Args:
        values: Positions of the arm's joints [rad].
        frame: Frame of the pose.
        link: Name of the link.
    """
    state = RobotState(joint_state=JointState(name=ARM, position=list(values)), is_diff=True)
    answer = call("compute_fk", GetPositionFK, Header(frame_id=frame), [link], state)
    assert answer.error_code.val == OK
    return answer.pose_stamped[0].pose


def vector(pose: Pose) -> np.ndarray:
    """Returns the position of a pose, shape (3,)."""
    return np.array([pose.position.x, pose.position.y, pose.position.z])


def hold(item: CollisionObject, link: str = TIP) -> None:
    """Attaches an object to a link; the pose of the object is in the frame of the link."""
    item.header.frame_id = link
    scene = PlanningScene(is_diff=True)
    scene.robot_state.is_diff = True
    scene.robot_state.attached_collision_objects = [AttachedCollisionObject(link_name=link, object=item)]
    assert call("apply_planning_scene", ApplyPlanningScene, scene).success


def table() -> CollisionObject:
    """Returns a table in front of the arm."""
    return box("table", 0.0, 0.56, 0.82, (1.2, 0.8, 0.04))


def pose_constraints(x: float, y: float, z: float, orientation: Quaternion = DOWN, frame: str = "world") -> Constraints:
    """Returns the goal constraints of a pose of the tip.

    Args:
        x: Position along x [m].
        y: Position along y [m].
        z: Position along z [m].
        orientation: Orientation of the tip.
        frame: Frame of the pose.
    """
    position = PositionConstraint(link_name=TIP, weight=1.0)
    position.header.frame_id = frame
    position.constraint_region.primitives = [SolidPrimitive(SolidPrimitive.SPHERE, [0.001])]
    position.constraint_region.primitive_poses = [Pose(Point(x, y, z), Quaternion(0, 0, 0, 1))]
    turn = OrientationConstraint(link_name=TIP, orientation=orientation, weight=1.0)
    turn.header.frame_id = frame
    return Constraints(name="goal", position_constraints=[position], orientation_constraints=[turn])


def request(goal: Constraints | None = None, **changes: Any) -> MotionPlanRequest:
    """Returns a request for the arm and the manipulator; `changes` replace fields of the message."""
    message = MotionPlanRequest(
        group_name=GROUP,
        allowed_planning_time=5.0,
        num_planning_attempts=1,
        max_velocity_scaling_factor=0.5,
        max_acceleration_scaling_factor=0.5,
        goal_constraints=[goal or pose_constraints(0.1, 0.5, 0.95)],
    )
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def plan(message: MotionPlanRequest) -> Any:
    """Returns the response to a request."""
    return call("plan_kinematic_path", GetMotionPlan, message).motion_plan_response


class Reports:
    """All planning reports of move_group, received by one subscriber for all tests."""

    def __init__(self) -> None:
        self.heard: list[dict[str, Any]] = []
        subscriber = rospy.Subscriber(
            "move_group/planning_report", String, lambda message: self.heard.append(json.loads(message.data))
        )
        until(lambda: hears(subscriber, "/move_group"), "the publisher of planning reports")


@cache
def reports() -> Reports:
    """Returns the planning reports of move_group, received from the first call on."""
    return Reports()


def report_of(work: Callable[[], Any], *kinds: str) -> tuple[Any, dict[str, Any]]:
    """Returns the result of a function, and the last planning report that the function caused.

    Args:
        work: Function without arguments.
        *kinds: Allowed kinds of the report; none allow all kinds.
    """
    heard, begun = reports().heard, rospy.get_time()
    result = work()

    def caused_reports() -> list[dict[str, Any]]:
        return [item for item in heard if item["time"] >= begun and (not kinds or item["kind"] in kinds)]

    until(caused_reports, "a planning report")
    return result, caused_reports()[-1]


def joint_goal(name: str, value: float) -> Constraints:
    """Returns the goal constraints of a joint [rad]."""
    return Constraints(joint_constraints=[JointConstraint(joint_name=name, position=value)])
