# SPDX-License-Identifier: BSD-3-Clause
"""A fake move_group of a gripper on two sliding axes, for tests of clients."""

from __future__ import annotations

import contextlib
import json
import threading
import time
from typing import Any

import actionlib
import rospy
from moveit_msgs.msg import (
    CollisionObject,
    ContactInformation,
    ExecuteTrajectoryAction,
    ExecuteTrajectoryResult,
    MotionPlanRequest,
    MoveItErrorCodes,
    PlannerInterfaceDescription,
)
from moveit_msgs.srv import (
    GetMotionPlan,
    GetMotionPlanResponse,
    GetPlanningScene,
    GetPlanningSceneResponse,
    GetPositionIK,
    GetPositionIKResponse,
    GetStateValidity,
    GetStateValidityResponse,
    QueryPlannerInterfaces,
    QueryPlannerInterfacesResponse,
)
from sensor_msgs.msg import JointState
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_testing.ros_session import until

URDF = """<robot name="r"><link name="world"/><link name="x_link"/><link name="y_link"/><link name="palm"/>
<link name="left"><collision>
  <origin xyz="0 0 0.04"/><geometry><box size="0.01 0.03 0.05"/></geometry></collision></link>
<link name="right"><collision>
  <origin xyz="0 0 0.04"/><geometry><box size="0.01 0.03 0.05"/></geometry></collision></link>
<link name="tip"/>
<joint name="jx" type="prismatic"><parent link="world"/><child link="x_link"/><axis xyz="1 0 0"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="jy" type="prismatic"><parent link="x_link"/><child link="y_link"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="mount" type="fixed"><parent link="y_link"/><child link="palm"/></joint>
<joint name="tip_joint" type="fixed"><parent link="palm"/><child link="tip"/><origin xyz="0 0 0.05"/></joint>
<joint name="f" type="prismatic"><parent link="palm"/><child link="left"/><axis xyz="1 0 0"/><origin xyz="-0.06 0 0"/>
  <limit lower="0" upper="0.055" effort="1" velocity="1"/></joint>
<joint name="g" type="prismatic"><parent link="palm"/><child link="right"/><axis xyz="-1 0 0"/><origin xyz="0.06 0 0"/>
  <limit lower="0" upper="0.055" effort="1" velocity="1"/><mimic joint="f"/></joint></robot>"""
SRDF = """<robot name="r"><group name="arm"><chain base_link="world" tip_link="tip"/></group>
<group name="hand"><joint name="f"/></group></robot>"""


class FakeMoveGroup:
    """Offers the services and the action of move_group; the attributes determine the responses.

    Inverse kinematics moves the axes jx and jy to the x and y of the requested pose, whatever its orientation.

    Attributes:
        reach: Largest x of a reachable pose [m].
        blocked: Largest y of a state without a collision with `wall` [m].
        blocked_for_current_fingers: The same for x, in requests that leave the fingers at their positions [m].
        plan_error: Error code of every plan; 0 for successful plans.
        reason: Reason of failed plans on the topic of planning reports.
        execution_error: Error code of every execution; 0 for successful executions.
        slow: Whether a motion lasts until its cancellation.
        canceled: Whether a motion was canceled.
        moving: Set at the start of a motion.
        scene_requests: Number of requests for the planning scene.
        positions: Joint positions in joint_states, by name [m].
        objects: Collision objects of the scene.
        requests: Received motion plan requests.
    """

    def __init__(self) -> None:
        self.reach, self.blocked, self.blocked_for_current_fingers = 1.0, 1.0, 1.0
        self.plan_error, self.reason = 0, ""
        self.execution_error, self.slow, self.canceled = 0, False, False
        self.moving, self.scene_requests = threading.Event(), 0
        self.positions = {"jx": 0.0, "jy": 0.0, "f": 0.02}
        self.objects: list[CollisionObject] = []
        self.requests: list[MotionPlanRequest] = []
        rospy.set_param("robot_description", URDF)
        rospy.set_param("robot_description_semantic", SRDF)
        self._joints = rospy.Publisher("joint_states", JointState, queue_size=1)
        self._report = rospy.Publisher("move_group/planning_report", String, queue_size=10)
        self._services = [
            rospy.Service("plan_kinematic_path", GetMotionPlan, self._plan),
            rospy.Service("compute_ik", GetPositionIK, self._ik),
            rospy.Service("check_state_validity", GetStateValidity, self._validity),
            rospy.Service("get_planning_scene", GetPlanningScene, self._scene),
            rospy.Service("query_planner_interface", QueryPlannerInterfaces, self._planners),
        ]
        self._server = actionlib.SimpleActionServer("execute_trajectory", ExecuteTrajectoryAction, self._execute, False)
        self._server.start()
        threading.Thread(target=self._publish, daemon=True).start()

    def add_box(self, name: str, size: tuple[float, float, float], centre: tuple[float, float, float]) -> None:
        """Adds a box to the scene.

        Args:
            name: Name of the object.
            size: Edge lengths [m].
            centre: Position of the centre in the world frame [m].
        """
        box = CollisionObject(id=name)
        box.primitives = [SolidPrimitive(type=SolidPrimitive.BOX, dimensions=list(size))]
        box.primitive_poses = [type(box.pose)()]
        box.pose.position.x, box.pose.position.y, box.pose.position.z = centre
        self.objects = [*self.objects, box]

    def wait_for_listeners(self, timeout_s: float = 60.0) -> None:
        """Waits for a subscriber of the planning reports.

        Args:
            timeout_s: Maximum wait [s].
        """
        until(
            lambda: bool(self._report.get_num_connections()),
            "a subscriber of the planning reports",
            timeout_s=timeout_s,
        )

    def _publish(self) -> None:
        with contextlib.suppress(rospy.ROSException):
            while not rospy.is_shutdown():
                self._joints.publish(JointState(name=list(self.positions), position=list(self.positions.values())))
                time.sleep(0.02)

    def _planners(self, _: Any) -> QueryPlannerInterfacesResponse:
        return QueryPlannerInterfacesResponse(
            [
                PlannerInterfaceDescription(pipeline_id="ompl", planner_ids=["RRTConnect", "RRT", "arm[Quick]"]),
                PlannerInterfaceDescription(pipeline_id="pilz", planner_ids=["LIN"]),
                PlannerInterfaceDescription(pipeline_id="anything"),
            ]
        )

    def _plan(self, request: Any) -> GetMotionPlanResponse:
        self.requests.append(request.motion_plan_request)
        response = GetMotionPlanResponse()
        answer, goal = response.motion_plan_response, request.motion_plan_request.goal_constraints[0]
        if self.plan_error:
            answer.error_code.val = self.plan_error
            report = {"request_name": goal.name, "error_code": self.plan_error, "reason": self.reason}
            self._report.publish("not json")
            self._report.publish(json.dumps(report))
            return response
        joints = answer.trajectory.joint_trajectory
        joints.joint_names = [constraint.joint_name for constraint in goal.joint_constraints] or ["jx"]
        ends = [constraint.position for constraint in goal.joint_constraints] or [0.0]
        joints.points = [JointTrajectoryPoint(positions=[0.0] * len(ends)), JointTrajectoryPoint(positions=ends)]
        answer.error_code.val = MoveItErrorCodes.SUCCESS
        return response

    def _ik(self, request: Any) -> GetPositionIKResponse:
        wanted, response = request.ik_request, GetPositionIKResponse()
        place = wanted.pose_stamped.pose.position
        if place.x > self.reach or (wanted.avoid_collisions and place.y > self.blocked):
            response.error_code.val = MoveItErrorCodes.NO_IK_SOLUTION
            return response
        response.solution.joint_state = JointState(name=["jx", "jy", "f"], position=[place.x, place.y, 0.0])
        response.error_code.val = MoveItErrorCodes.SUCCESS
        return response

    def _validity(self, request: Any) -> GetStateValidityResponse:
        joints = request.robot_state.joint_state
        at = dict(zip(joints.name, joints.position, strict=True))
        fingers_collide = "f" not in at and at["jx"] > self.blocked_for_current_fingers
        if at["jy"] <= self.blocked and not fingers_collide:
            return GetStateValidityResponse(valid=True)
        return GetStateValidityResponse(
            valid=False, contacts=[ContactInformation(contact_body_1="palm", contact_body_2="wall")]
        )

    def _scene(self, request: Any) -> GetPlanningSceneResponse:
        self.scene_requests += 1
        response = GetPlanningSceneResponse()
        response.scene.world.collision_objects = self.objects
        return response

    def _execute(self, goal: Any) -> None:
        del goal
        self.moving.set()
        while self.slow and not self._server.is_preempt_requested():
            time.sleep(0.01)
        result = ExecuteTrajectoryResult()
        if self._server.is_preempt_requested():
            self.canceled = True
            result.error_code.val = MoveItErrorCodes.PREEMPTED
            self._server.set_preempted(result)
        elif self.execution_error:
            result.error_code.val = self.execution_error
            self._server.set_aborted(result, "the controller said no")
        else:
            result.error_code.val = MoveItErrorCodes.SUCCESS
            self._server.set_succeeded(result)
