# SPDX-License-Identifier: BSD-3-Clause
"""Small config packages, written into a folder that comes first on ROS_PACKAGE_PATH."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

Files = dict[str, str]
SRDF = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="group" default="arm"/>'
SRDF += '<group name="$(arg group)"/></robot>'
CONTROLLERS = "controller_list: [{name: arm_controller, type: FollowJointTrajectory, joints: [j1]}]\n"
CONFIG: Files = {
    "config/r.srdf": SRDF,
    "config/r.urdf": '<robot name="r"><link name="plain"/></robot>',
    "config/kinematics.yaml": "arm: {kinematics_solver: kdl_kinematics_plugin/KDLKinematicsPlugin}\n",
    "config/joint_limits.yaml": "default_velocity_scaling_factor: 0.2\njoint_limits: {j1: {max_velocity: 1.0}}\n",
    "config/moveit_controllers.yaml": CONTROLLERS,
    "config/pilz_cartesian_limits.yaml": "cartesian_limits: {max_trans_vel: 1.0}\n",
}
PackageMaker = Callable[..., Path]


@pytest.fixture
def make_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> PackageMaker:
    """Writes a package and returns its folder.

    Its arguments: other files and texts than those of CONFIG, files to leave out, and the package's name.
    """
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path}{os.pathsep}{os.environ['ROS_PACKAGE_PATH']}")

    def make(files: Files | None = None, without: Sequence[str] = (), name: str = "r_moveit_config") -> Path:
        folder = tmp_path / name
        manifest = {"package.xml": f"<package><name>{name}</name></package>"}
        for path, text in {**manifest, **CONFIG, **(files or {})}.items():
            if path not in without:
                (folder / path).parent.mkdir(parents=True, exist_ok=True)
                (folder / path).write_text(text)
        return folder

    return make
