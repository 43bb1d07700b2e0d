# SPDX-License-Identifier: BSD-3-Clause
"""Plain roslaunch resolves the names of a launch and its configuration files before any node."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import roslaunch.rlutil

from modular_framework_benchmark.experiments.ros_launch_check import launch_faults

START = ("modular_framework_api", "start_framework.launch", "gui:=false", "rviz:=false")
JOINT = """<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="10" velocity="1"/></joint>"""


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        (
            'parent link="base"',
            'parent link="bse"',
            "robot_description:[0-9]+: joint 'turn' has the parent link 'bse'.*'base'",
        ),
        (
            'xyz="0 0 1"',
            'xyz="0 0 0"',
            "robot_description:[0-9]+: joint 'turn' has the axis 0 0 0; give it a direction",
        ),
        (JOINT, "", re.escape("2 links have no parent joint (base, arm); allowed: a URDF with one root link")),
    ],
)
def test_a_robot_that_is_no_tree_of_links_is_named_with_its_file(
    old: str, new: str, fault: str, tmp_path: Path
) -> None:
    urdf = f'<robot name="a"><link name="base"/><link name="arm"/>{JOINT}</robot>'
    (tmp_path / "mine.urdf").write_text(urdf.replace(old, new))
    file = f"{'../' * 20}{tmp_path}/mine.urdf"
    path = roslaunch.rlutil.resolve_launch_arguments(list(START[:2]))[0]
    faults = launch_faults(path, [*START[2:], f"robot_urdf_file:={file}", "urdf_args:="])
    assert [text for text in faults if re.search(f"^argument 'robot_urdf_file' is '{file}': {fault}", text)], faults
