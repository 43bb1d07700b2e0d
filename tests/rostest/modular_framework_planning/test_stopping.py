# SPDX-License-Identifier: BSD-3-Clause
"""The node is stopped while clients ask it for plans, inverse kinematics and motions: it ends without an error."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
from moveit_msgs.msg import MoveGroupAction, MoveGroupGoal
from moveit_msgs.srv import GetMotionPlan, GetPositionIK, GetPositionIKRequest

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.planning.planning_wire import ARM, LAUNCH, FakeArm, joint_goal, request
from modular_framework_testing.ros_session import until

LOADED_S = 1.5


def test_a_stop_amid_requests_leaves_no_error_in_the_log(ros_session: Any) -> None:
    launch = ros_session.launch(LAUNCH)
    ros_session.wait_for_service("plan_kinematic_path", 120.0)
    arm, ended = FakeArm(), threading.Event()
    client = SteadyActionClient("move_group", MoveGroupAction)
    assert client.wait_for_server(rospy.Duration(20.0))
    message = request(joint_goal(ARM[0], 1.0))
    goal = MoveGroupGoal(request=message)
    goal.planning_options.plan_only = True
    clients = [
        threading.Thread(target=ask_on, args=(ended, ask), daemon=True)
        for ask in (
            lambda: rospy.ServiceProxy("plan_kinematic_path", GetMotionPlan)(message),
            lambda: rospy.ServiceProxy("compute_ik", GetPositionIK)(GetPositionIKRequest()),
            lambda: client.send_goal_and_wait(goal, rospy.Duration(1.0)),
        )
    ]
    for thread in clients:
        thread.start()
    until(lambda: "ik failed (INVALID_GROUP_NAME)" in launch.log(), "an answer to what is asked")
    time.sleep(LOADED_S)
    launch.stop()
    ended.set()
    arm.close()
    assert "Traceback" not in launch.log() and "[ERROR]" not in launch.log(), launch.log()


def ask_on(ended: threading.Event, ask: Callable[[], Any]) -> None:
    while not ended.is_set():
        with contextlib.suppress(rospy.ServiceException, rospy.ROSException):
            ask()
