# SPDX-License-Identifier: BSD-3-Clause
"""The real-robot branch of the framework, on devices in software: `simulation:=false` picks an object and holds it.

Both ways to drive the gripper: as hardware of a controller beside the arm, and by its own server of the action Grasp,
which the framework's spawner starts, with the arm alone in the list of hardware.
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from modular_framework_testing.emulators.ur_emulator_process import random_local_address
from modular_framework_testing.ros_session import RosSession, free_port

TASK_TIMEOUT_S = 240.0
WRAPPER = """<launch>
  <arg name="arm_address"/>
  <arg name="port"/>
  <arg name="own_server"/>
  <include file="$(find modular_framework_api)/launch/start_framework.launch">
    <arg name="simulation" value="false"/>
    <arg name="controller_file" value="ur5_controller.yaml" if="$(arg own_server)"/>
    <arg name="connection_file" value="connection_emulators.yaml"/>
    <arg name="task_constructor_script" value="pick_and_hold.yaml"/>
    <arg name="gui" value="false"/>
    <arg name="rviz" value="false"/>
    <arg name="end_with_task" value="true"/>
  </include>
  <param name="ur_robot_hw/robot_ip_address" value="$(arg arm_address)"/>
  <param name="ezgripper_robot_hw/port_name" value="$(arg port)"/>
  <group if="$(arg own_server)">
    <param name="port_name" value="$(arg port)"/>
    <rosparam>
      robot_hardware: [ur_robot_hw]
      package_manipulator_action_server: modular_framework_drivers
      manipulator_controller_node_name: ezgripper_grasp_action_server
      manipulator_controller_action_server_type: ezgripper_grasp_action_server
      ezgripper_grasp_action_server: {link_timeout: 2.0}
    </rosparam>
  </group>
</launch>"""

# Runs as a node of its own and prints the points of every trajectory that the arm was to follow.
WATCHER = """
import json, sys, time
import rosgraph, rospy
from control_msgs.msg import FollowJointTrajectoryActionGoal
while not rosgraph.is_master_online():
    time.sleep(0.05)
rospy.init_node("watcher", anonymous=True, disable_signals=True)
plans = []
def remember(message):
    trajectory = message.goal.trajectory
    order = sorted(range(6), key=lambda joint: JOINTS.index(trajectory.joint_names[joint]))
    plans.append([[point.positions[joint] for joint in order] for point in trajectory.points])
JOINTS = [name + "_joint" for name in "shoulder_pan shoulder_lift elbow wrist_1 wrist_2 wrist_3".split()]
rospy.Subscriber("/arm_trajectory_controller/follow_joint_trajectory/goal", FollowJointTrajectoryActionGoal, remember)
sys.stdin.read()
print(json.dumps(plans))
"""


@pytest.mark.parametrize("own_server", [False, True], ids=["gripper as hardware", "gripper with its own server"])
def test_an_object_is_picked_and_held_by_arm_and_gripper(session: RosSession, tmp_path: Path, own_server: bool) -> None:
    address = random_local_address()
    port, path_log = tmp_path / "gripper", tmp_path / "path.csv"
    watcher = subprocess.Popen(
        [sys.executable, "-c", WATCHER], env=session.env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        emulators = session.launch_package(
            "modular_framework_testing",
            "emulators.launch",
            arm_address=address,
            arm_log=path_log,
            gripper_port=port,
            gripper_object=1.3,
            gripper_command_port=free_port(),
        )
        framework = session.launch(WRAPPER, arm_address=address, port=port, own_server=str(own_server).lower())
        framework.wait(TASK_TIMEOUT_S)
        plans = json.loads(watcher.communicate(timeout=60)[0].splitlines()[-1])
    finally:
        watcher.kill()
    log = framework.log()
    assert "Task 'pick_and_hold' ended with outcome 'successful_pipeline': SUCCEEDED" in log, log
    assert emulators.alive(), emulators.log()
    assert ("ezgripper_grasp_action_server" in log) is own_server
    emulators.stop()
    commanded, actual = read_path(path_log)
    assert len(plans) >= 4, "to the pregrasp, to the grasp, up, to where the object is held"
    for plan in plans:
        assert max(distance_to_path(np.array(point), commanded) for point in plan) < 5e-3  # chords of late cycles
    planned = np.concatenate([np.array(plan) for plan in plans])
    moved = commanded[np.r_[True, np.any(np.diff(commanded, axis=0) != 0.0, axis=1)]]
    assert max(distance_to_path(point, planned) for point in moved[::5]) < 0.02  # curves between a plan's points
    assert np.max(np.abs(actual - commanded)) < 0.15  # the arm's lag


# Runs as a node of its own and cuts the power of the gripper's servo a moment after the fingers are commanded to grasp.
CUTTER = """
import sys, threading, time
import rosgraph, rospy
from modular_framework_core.msg import GraspActionGoal, GraspCommand
from modular_framework_testing.emulators.command_port import send_command
while not rosgraph.is_master_online():
    time.sleep(0.05)
rospy.init_node("cutter", anonymous=True, disable_signals=True)
cut = threading.Event()
def on_goal(message):
    if message.goal.grasp_command.grasp_state == GraspCommand.GRASP_STATE and not cut.is_set():
        time.sleep(0.25)
        send_command(int(sys.argv[1]), "power_off")
        print(time.time(), flush=True)
        cut.set()
rospy.Subscriber("/moveit_grasp_action_server/goal", GraspActionGoal, on_goal)
cut.wait()
"""


def test_a_gripper_that_loses_its_power_as_it_closes_ends_the_task_and_the_arm_does_not_lift(
    session: RosSession, tmp_path: Path
) -> None:
    address = random_local_address()
    port, path_log, command_port = tmp_path / "gripper", tmp_path / "path.csv", free_port()
    cutter = subprocess.Popen(
        [sys.executable, "-c", CUTTER, str(command_port)], env=session.env, stdout=subprocess.PIPE, text=True
    )
    try:
        emulators = session.launch_package(
            "modular_framework_testing",
            "emulators.launch",
            arm_address=address,
            arm_log=path_log,
            gripper_port=port,
            gripper_object=1.3,
            gripper_command_port=command_port,
        )
        framework = session.launch(WRAPPER, arm_address=address, port=port, own_server="false")
        framework.wait(TASK_TIMEOUT_S)
        cut_s = float(cutter.communicate(timeout=10)[0].splitlines()[-1])
    finally:
        cutter.kill()
    log = framework.log()
    assert "Task 'pick_and_hold' ended with outcome 'successful_pipeline'" not in log, log
    assert "EzGripper: servo 1 on" in log and "does not respond" in log, log
    assert "stopped at an object" not in log, log
    emulators.stop()
    with path_log.open() as file:
        after = [[float(value) for value in row[8:14]] for row in list(csv.reader(file))[1:] if float(row[0]) > cut_s]
    assert len(after) > 20
    assert np.abs(np.array(after) - after[0]).max() < 1e-3, "the arm moved"


def read_path(log: Path) -> tuple[np.ndarray, np.ndarray]:
    """Commanded and actual joint positions of every cycle that the arm's controller logged, shape (cycles, 6)."""
    with log.open() as file:
        rows = np.array([[float(value) for value in row] for row in list(csv.reader(file))[1:]])
    return rows[:, 2:8], rows[:, 8:14]


def distance_to_path(point: np.ndarray, path: np.ndarray) -> float:
    """Distance of joint positions to the polyline through others [rad]."""
    starts, ways = path[:-1], np.diff(path, axis=0)
    lengths = np.maximum(np.einsum("ij,ij->i", ways, ways), 1e-18)
    shares = np.clip(np.einsum("ij,ij->i", point - starts, ways) / lengths, 0.0, 1.0)
    return float(np.min(np.linalg.norm(starts + shares[:, None] * ways - point, axis=1)))
