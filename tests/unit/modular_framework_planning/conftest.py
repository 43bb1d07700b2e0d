# SPDX-License-Identifier: BSD-3-Clause
"""Robots the planner is tested with: the shipped UR5 with EZGripper and a small arm written for the tests."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path += [
    str(ROOT / "src/modular_framework_planning/src"),
    str(ROOT / "src/modular_framework_testing/src"),
    str(ROOT / "src/modular_framework_urdf/src"),
    str(Path(__file__).parent),
]

from modular_framework_planning.errors import ModelError  # noqa: E402
from modular_framework_planning.robot_model.robot_model import RobotModel  # noqa: E402
from modular_framework_planning.robot_model.urdf_document import package_resolver  # noqa: E402
from modular_framework_testing.planning.ur5_limits import LIMITS  # noqa: E402


@dataclass(frozen=True)
class Robot:
    """A robot's texts and the model made of them."""

    urdf: str
    srdf: str
    model: RobotModel


@pytest.fixture(scope="session")
def robot() -> Robot:
    """The shipped robot; skipped where the workspace is not sourced."""
    pytest.importorskip("xacro_rospkg", reason="source the workspace: the shipped robot's xacro cannot be expanded")
    from xacro_rospkg import expand

    robots = ROOT / "src/robots"
    urdf = expand(robots / "ur5_ezgripper_robot/urdf/ur5_with_ezgripper.urdf.xacro")
    srdf = (robots / "ur5_ezgripper_moveit_config/config/ur5_with_ezgripper.srdf").read_text()
    try:
        return Robot(urdf, srdf, RobotModel(urdf, srdf, LIMITS, package_resolver))
    except ModelError as error:
        pytest.skip(f"source the workspace: {error.reason}")


@pytest.fixture(scope="session")
def model(robot: Robot) -> RobotModel:
    """The model of the shipped robot."""
    return robot.model
