# SPDX-License-Identifier: BSD-3-Clause
"""A task on a robot whose vendor's driver offers only actions and joint states, with the file of the page."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import rospkg

from modular_framework_testing.ros_session import Launch, RosSession, until

ROOT = Path(__file__).parents[2]
TASK_TIMEOUT_S = 240.0
WRAPPER = """<launch>
  <arg name="folder"/>
  <include file="$(find modular_framework_api)/launch/start_framework.launch">
    <arg name="simulation" value="false"/>
    <arg name="config_directory" value="$(arg folder)"/>
    <arg name="vendor_driver_file" value="vendor_driver.yaml"/>
    <arg name="method_launch_file" value="none"/>
    <arg name="task_constructor_script" value="$(arg folder)/vendor_move.yaml"/>
    <arg name="gui" value="false"/>
    <arg name="rviz" value="false"/>
    <arg name="end_with_task" value="true"/>
  </include>
</launch>"""
TASK = """
name: vendor_move
source: framework_state_machine
node_name: vendor_move_state_machine
outcomes: [done, failed]
states:
  - Plan:
      source: plan
      starting_state_type: ""
      starting_state_name: ""
      target_state_type: joint_state
      target_state_name: stability_pose
      plan_name: to_pose
      outcomes: [success, fail]
      transitions: {success: Move, fail: failed}
  - Move:
      source: move
      plan_name: to_pose
      transitions: {success: done, fail: failed}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The configuration folder with the task and the file of the page."""
    copy = tmp_path / "config"
    shutil.copytree(Path(rospkg.RosPack().get_path("modular_framework_api")) / "config", copy)
    example = re.search(r"```yaml\n(.*?)```", (ROOT / "docs/vendor_driver.md").read_text(), re.DOTALL)
    assert example is not None
    (copy / "vendor_driver.yaml").write_text(example[1])
    (copy / "vendor_move.yaml").write_text(TASK)
    return copy


@pytest.fixture
def driver(session: RosSession) -> Iterator[subprocess.Popen[str]]:
    arm = [sys.executable, str(Path(__file__).parent / "vendor_arm.py")]
    process = subprocess.Popen(arm, env=session.env, stdout=subprocess.PIPE, text=True)
    yield process
    process.kill()
    process.communicate()


def launch(session: RosSession, folder: Path) -> Launch:
    """Starts a master and the framework with the configuration folder."""
    session.start_master()
    return session.launch(WRAPPER, folder=folder)


def wait_for_goal(driver: subprocess.Popen[str], framework: Launch) -> None:
    """Waits until the arm has accepted a goal; fails if the launch ends before."""
    lines: list[str] = []
    assert driver.stdout is not None
    threading.Thread(target=lambda output: lines.append(output.readline()), args=(driver.stdout,), daemon=True).start()
    until(lambda: bool(lines) or not framework.alive(), "goal of the arm", TASK_TIMEOUT_S)
    assert lines == ["goal accepted\n"], framework.log()


def test_a_task_moves_the_arm_of_a_vendor_without_controllers_of_ours(
    session: RosSession, folder: Path, driver: subprocess.Popen[str]
) -> None:
    framework = launch(session, folder)
    wait_for_goal(driver, framework)
    framework.wait(TASK_TIMEOUT_S)
    log = framework.log()
    assert "Task 'vendor_move' ended with outcome 'done': SUCCEEDED" in log, log
    assert "the vendor's driver is ready" in log and "robot_hw" not in log and "custom_controller_spawner" not in log


def test_a_driver_killed_in_a_motion_ends_the_task_with_the_cause(
    session: RosSession, folder: Path, driver: subprocess.Popen[str]
) -> None:
    framework = launch(session, folder)
    wait_for_goal(driver, framework)
    driver.kill()
    framework.wait(TASK_TIMEOUT_S)
    log = framework.log()
    assert re.search("the vendor's driver is lost: .*action /vendor/scaled_pos_joint_traj_controller/follow", log), log
    assert "ended with outcome 'done'" not in log, log


def test_a_driver_that_is_not_there_ends_the_launch_before_the_first_state(session: RosSession, folder: Path) -> None:
    file = folder / "vendor_driver.yaml"
    file.write_text(file.read_text().replace("ready_timeout: 60.0", "ready_timeout: 2.0"))
    framework = launch(session, folder)
    framework.wait(TASK_TIMEOUT_S)
    log = framework.log()
    assert "is not ready after 2 s: action /vendor/scaled_pos_joint_traj_controller/follow_joint_trajectory has" in log
    assert "topic /vendor/robot_program_running is not true" in log and "Plan" not in log, log
