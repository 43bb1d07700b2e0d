# SPDX-License-Identifier: BSD-3-Clause
"""A configuration folder of the original framework is checked without a change."""

from __future__ import annotations

from pathlib import Path

import roslaunch.rlutil

from modular_framework_benchmark.launch_checks.ros_launch_check import launch_faults


def test_a_configuration_folder_of_the_original_names_nothing_unknown_but_its_planner() -> None:
    path = roslaunch.rlutil.resolve_launch_arguments(["modular_framework_api", "start_framework.launch"])[0]
    folder = Path(__file__).resolve().parents[2] / "original_configuration"

    def faults(*arguments: str) -> list[str]:
        return launch_faults(path, [f"config_directory:={folder}", *arguments])

    (planner,) = faults()
    assert "there is no planner 'BiTRRT'" in planner
    assert faults("planner_name:=RRTConnect") == []
    (hardware,) = faults("planner_name:=RRTConnect", "simulation:=false")
    assert "there is no hardware 'sr_ur_robot_hw/UrArmRobotHW'" in hardware
