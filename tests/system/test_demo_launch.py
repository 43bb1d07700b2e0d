# SPDX-License-Identifier: BSD-3-Clause
"""The UR5's demonstration, as Python and XML launch file: headless, mock and simulated, moved by a script."""

from __future__ import annotations

import json
import signal
import subprocess
import sys

import pytest

from modular_framework_testing.ros_session import RosSession, until

SCRIPT = """
import json
import sys
import moveit_commander
import rospy
moveit_commander.roscpp_initialize(sys.argv)
rospy.init_node("mover")
groups = {
    name: moveit_commander.MoveGroupCommander(name, wait_for_servers=120.0)
    for name in ("arm_and_manipulator", "ezgripper")
}
for name, pipeline, planner, target in json.loads(sys.argv[1]):
    group = groups[name]
    group.set_planning_pipeline_id(pipeline)
    group.set_planner_id(planner)
    group.set_named_target(target)
    moved = group.go(wait=True)
    goal, reached = group.get_named_target_values(target), group.get_current_joint_values()
    names = group.get_active_joints()
    far = max(abs(goal[name] - value) for name, value in zip(names, reached) if name in goal)
    print(pipeline, target, moved, "reached" if far < 0.03 else f"{far} away", flush=True)
"""
MOVES = [
    ("arm_and_manipulator", "ompl", "", "stability_pose"),
    ("arm_and_manipulator", "pilz_industrial_motion_planner", "PTP", "initial_pose"),
    ("arm_and_manipulator", "stomp", "", "stability_pose"),
    ("ezgripper", "ompl", "", "closed"),
]
ARM_AND_HAND = [MOVES[0], MOVES[-1]]


@pytest.mark.parametrize(
    ("file", "hardware", "moves"),
    [
        ("demo.launch.py", {}, MOVES),
        ("demo.launch", {}, ARM_AND_HAND),
        ("demo.launch.py", {"sim_gazebo": "true"}, ARM_AND_HAND),
    ],
    ids=["python mock", "xml mock", "python simulated"],
)
def test_a_script_moves_arm_and_gripper_of_the_demonstration(
    session: RosSession, file: str, hardware: dict[str, str], moves: list[tuple[str, str, str, str]]
) -> None:
    start = session.launch_python if file.endswith(".py") else session.launch_package
    launch = start("ur5_ezgripper_moveit_config", file, use_rviz="false", **hardware)
    if hardware:
        session.wait_for_service("/gazebo/get_world_properties", 120.0)
    session.wait_for_service("/plan_kinematic_path", 120.0)
    command = [sys.executable, "-c", SCRIPT, json.dumps(moves)]
    result = subprocess.run(command, env=session.env, capture_output=True, text=True, timeout=240)
    made = [line for line in result.stdout.splitlines() if " reached" in line or " away" in line]
    expected = [f"{pipeline} {target} True reached" for _, pipeline, _, target in moves]
    assert made == expected, f"{result.stdout}\n{result.stderr}\n{session.log()}"
    launch.process.send_signal(signal.SIGINT)
    assert launch.wait(30.0) == 0
    until(lambda: not session.processes(), "all processes of the launch to end", 30.0)
