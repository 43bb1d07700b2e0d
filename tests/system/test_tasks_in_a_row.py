# SPDX-License-Identifier: BSD-3-Clause
"""A task finds in a launch what it finds in a fresh one, however many tasks ran before it."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

from modular_framework_testing.ros_session import RosSession, until

CONFIG = Path(__file__).parents[2] / "src/modular_framework_api/config"
TASK_TIMEOUT_S = 180.0
TASKS = 2


def test_each_task_of_a_launch_has_the_grasps_of_a_first_one(session: RosSession, tmp_path: Path) -> None:
    """The method stores two grasps: with those that are left over, the third task would have none."""
    shutil.copytree(CONFIG, tmp_path / "config")
    methods = tmp_path / "config" / "generative_methods_config.yaml"
    text, changes = re.subn(r"max_grasps: \d+", "max_grasps: 2", methods.read_text())
    assert changes
    methods.write_text(text)
    launch = session.launch_package(
        "modular_framework_api",
        "start_framework.launch",
        config_directory=tmp_path / "config",
        end_with_task="false",
        real_time_factor="0",
        wait_for_planning="true",
        seed="1",
    )
    until(lambda: "Task 'simulation_pick' ended" in launch.log(), "the task of the launch has ended", TASK_TIMEOUT_S)
    assert "ended with outcome 'successful_pipeline'" in launch.log(), launch.log()
    for number in range(TASKS):
        subprocess.run(["rosservice", "call", "/gazebo/reset_world"], env=session.env, check=True, timeout=60.0)
        command = ["rosrun", "modular_framework_core", "run_task", "simulation_pick.yaml", f"__name:=again_{number}"]
        run = subprocess.run(
            command, env=session.env, capture_output=True, text=True, timeout=TASK_TIMEOUT_S, check=False
        )
        assert run.returncode == 0, f"task {number + 2} of the launch:\n{run.stdout}{run.stderr}"
        assert "SelectGrasp" in run.stdout
