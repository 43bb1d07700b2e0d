# SPDX-License-Identifier: BSD-3-Clause
"""The UR5's demonstration, as Python and as XML launch file: headless, on mock hardware, moved by a script."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest
from ros_session import RosSession, until

SCRIPT = """
import sys
import moveit_commander
import rospy
moveit_commander.roscpp_initialize(sys.argv)
rospy.init_node("mover")
arm = moveit_commander.MoveGroupCommander("arm_and_manipulator", wait_for_servers=120.0)
hand = moveit_commander.MoveGroupCommander("ezgripper", wait_for_servers=120.0)
for group, pipeline, planner, target in (
    (arm, "ompl", "", "stability_pose"),
    (arm, "pilz_industrial_motion_planner", "PTP", "initial_pose"),
    (arm, "stomp", "", "stability_pose"),
    (hand, "ompl", "", "closed"),
):
    group.set_planning_pipeline_id(pipeline)
    group.set_planner_id(planner)
    group.set_named_target(target)
    moved = group.go(wait=True)
    goal, reached = group.get_named_target_values(target), group.get_current_joint_values()
    names = group.get_active_joints()
    far = max(abs(goal[name] - value) for name, value in zip(names, reached) if name in goal)
    print(pipeline, target, moved, "reached" if far < 0.03 else f"{far} away", flush=True)
"""
EXPECTED = [
    "ompl stability_pose True reached",
    "pilz_industrial_motion_planner initial_pose True reached",
    "stomp stability_pose True reached",
    "ompl closed True reached",
]


@pytest.mark.parametrize("file", ["demo.launch.py", "demo.launch"])
def test_a_script_moves_arm_and_gripper_of_the_demonstration(session: RosSession, file: str) -> None:
    start = session.launch_python if file.endswith(".py") else session.launch_package
    launch = start("ur5_ezgripper_moveit_config", file, use_rviz="false")
    session.wait_for_service("/plan_kinematic_path", 120.0)
    command = [sys.executable, "-c", SCRIPT]
    result = subprocess.run(command, env=session.env, capture_output=True, text=True, timeout=240)
    moves = [line for line in result.stdout.splitlines() if " reached" in line or " away" in line]
    assert moves == EXPECTED, f"{result.stdout}\n{result.stderr}\n{session.log()}"
    launch.process.send_signal(signal.SIGINT)
    assert launch.wait(30.0) == 0
    until(lambda: not session.processes(), "all processes of the launch to end", 30.0)
