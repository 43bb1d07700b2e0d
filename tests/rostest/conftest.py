# SPDX-License-Identifier: BSD-3-Clause
"""Fixtures of all suites of rostest."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from modular_framework_testing.ros_fixtures import ros_launch, ros_session  # noqa: F401
from modular_framework_testing.ros_session import RosSession
from modular_framework_testing.ros_session_report import pytest_runtest_makereport  # noqa: F401
from modular_framework_testing.virtual_screen import virtual_screen


@pytest.fixture(scope="module")
def user_packages(ros_session: RosSession) -> Iterator[Path]:  # noqa: F811
    """The packages of a user, in `tests/packages`: found along ROS_PACKAGE_PATH by this process and all it starts."""
    packages = Path(__file__).parents[1] / "packages"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_PACKAGE_PATH", str(packages), prepend=":")
        patch.setitem(ros_session.env, "ROS_PACKAGE_PATH", os.environ["ROS_PACKAGE_PATH"])
        yield packages


@pytest.fixture(scope="module")
def screen() -> Iterator[str]:
    """A new X server without a monitor; its display name."""
    with virtual_screen() as display:
        yield display
