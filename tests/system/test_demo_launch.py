# SPDX-License-Identifier: BSD-3-Clause
"""The demonstrations, as Python and XML launch files: headless, on mock and simulated hardware, moved by a script."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from modular_framework_testing.ros_session import RosSession, until

TASKS = Path(__file__).parent / "tasks"
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

RANDOM_MOTIONS = 25
RANDOM_SCRIPT = """
import sys
import moveit_commander
import rospy
moveit_commander.roscpp_initialize(sys.argv)
rospy.init_node("mover")
group = moveit_commander.MoveGroupCommander("panda_manipulator", wait_for_servers=120.0)
group.set_max_velocity_scaling_factor(1.0)
group.set_max_acceleration_scaling_factor(1.0)
executed = 0
while executed < int(sys.argv[1]):
    goal = group.get_random_joint_values()
    group.set_joint_value_target(goal)
    planned, plan, _, _ = group.plan()
    if planned:  # a random posture may be in collision
        executed += 1
        moved = group.execute(plan, wait=True)
        far = max(abs(a - b) for a, b in zip(goal, group.get_current_joint_values()))
        print("motion", moved, far < 0.03, flush=True)
"""


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


def test_a_panda_with_controllers_of_ros_2_executes_random_motions(session: RosSession) -> None:
    """A goal time of 0 once ended 11 of 25 motions of the public demonstration with CONTROL_FAILED."""
    session.start(["rosrun", "launch", "launch_py", str(TASKS / "panda_demo.launch.py")])
    session.wait_for_service("/plan_kinematic_path", 120.0)
    command = [sys.executable, "-c", RANDOM_SCRIPT, str(RANDOM_MOTIONS)]
    result = subprocess.run(command, env=session.env, capture_output=True, text=True, timeout=300)
    motions = [line for line in result.stdout.splitlines() if line.startswith("motion")]
    assert motions == ["motion True True"] * RANDOM_MOTIONS, f"{result.stdout}\n{result.stderr}\n{session.log()}"
