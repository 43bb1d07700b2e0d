# SPDX-License-Identifier: BSD-3-Clause
"""Fixtures of the suites of rostest: the master that it brought, and this process as the test node."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from modular_framework_testing.ros_session import RosSession
from modular_framework_testing.ros_session_report import pytest_runtest_makereport  # noqa: F401
from modular_framework_testing.virtual_screen import virtual_screen


@pytest.fixture(scope="session")
def ros_session() -> Iterator[RosSession]:
    """The master of rostest; this process is a node on it (rospy can be a node once a process)."""
    import rospy

    session = RosSession(os.environ["ROS_MASTER_URI"])
    os.environ.update({name: session.env[name] for name in ("ROS_IP", "ROS_HOME", "ROS_LOG_DIR")})
    try:
        rospy.init_node("test", anonymous=True, disable_signals=True)
        yield session
    finally:
        rospy.signal_shutdown("end of the suite")
        session.stop()


@pytest.fixture(scope="module")
def user_packages(ros_session: RosSession) -> Iterator[Path]:
    """The packages of a user, in `tests/packages`: found along ROS_PACKAGE_PATH by this process and all it starts."""
    packages = Path(__file__).parents[1] / "packages"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_PACKAGE_PATH", str(packages), prepend=":")
        patch.setitem(ros_session.env, "ROS_PACKAGE_PATH", os.environ["ROS_PACKAGE_PATH"])
        yield packages


@pytest.fixture(scope="module")
def ros_launch(ros_session: RosSession) -> Callable[..., RosSession]:
    """Starts launch files on the suite's master; answers the session.

    For nodes that a .test file cannot start: with files that the test writes, with settings of its own, or to be ended.
    """

    def launch(launch_xml: str | Path, **args: object) -> RosSession:
        ros_session.launch(launch_xml, **args)
        return ros_session

    return launch


@pytest.fixture(scope="module")
def screen() -> Iterator[str]:
    """A new X server without a monitor; its display name."""
    with virtual_screen() as display:
        yield display
