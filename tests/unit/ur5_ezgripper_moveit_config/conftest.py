# SPDX-License-Identifier: BSD-3-Clause
"""The planning configuration and the robot it is for."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pinocchio
import pytest
import rospkg
from xacro_rospkg import expand


@pytest.fixture(scope="session")
def package() -> Path:
    return Path(rospkg.RosPack().get_path("ur5_ezgripper_moveit_config"))


@pytest.fixture(scope="session")
def srdf(package: Path) -> ElementTree.Element:
    return ElementTree.parse(package / "config" / "ur5_with_ezgripper.srdf").getroot()


@pytest.fixture(scope="session")
def urdf() -> str:
    packages = rospkg.RosPack()
    text = expand(packages.get_path("ur5_ezgripper_robot") + "/urdf/ur5_with_ezgripper.urdf.xacro")
    return re.sub(r"package://([^/]+)", lambda match: packages.get_path(match[1]), text)


@pytest.fixture(scope="session")
def model(urdf: str) -> pinocchio.Model:
    return pinocchio.buildModelFromXML(urdf, mimic=True)
