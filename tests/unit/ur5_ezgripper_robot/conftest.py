# SPDX-License-Identifier: BSD-3-Clause
"""The expanded description of the UR5 with EZGripper, as text and as a Pinocchio model."""

import re

import pinocchio
import pytest
import rospkg
from xacro_rospkg import expand


@pytest.fixture(scope="session")
def urdf() -> str:
    folder = rospkg.RosPack().get_path("ur5_ezgripper_robot")
    return expand(f"{folder}/urdf/ur5_with_ezgripper.urdf.xacro", {"initial_z": "0.86"})


@pytest.fixture(scope="session")
def urdf_with_paths(urdf: str) -> str:
    packages = rospkg.RosPack()
    return re.sub(r"package://([^/]+)", lambda match: packages.get_path(match[1]), urdf)


@pytest.fixture(scope="session")
def model(urdf: str) -> pinocchio.Model:
    return pinocchio.buildModelFromXML(urdf, mimic=True)
