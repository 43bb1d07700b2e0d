# SPDX-License-Identifier: BSD-3-Clause
"""Fixtures of the tests that need a ROS master: one master and one test node a module."""
from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from ros_session import RosSession  # noqa: E402


@pytest.fixture(scope="module")
def ros_session() -> Iterator[RosSession]:
    """A private master; this process is a node on it (rospy can be a node once a process: one module a process)."""
    import rospy

    session = RosSession()
    os.environ.update(
        {name: session.env[name] for name in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOME", "ROS_LOG_DIR")}
    )
    try:
        session.start_master()
        rospy.init_node("test", anonymous=True, disable_signals=True)
        yield session
    finally:
        rospy.signal_shutdown("end of the test module")
        session.stop()


@pytest.fixture(scope="module")
def ros_launch(ros_session: RosSession) -> Callable[..., RosSession]:
    """Starts launch files (a path, or the text of one) on the module's master; answers the session."""

    def launch(launch_xml: str | Path, **args: object) -> RosSession:
        ros_session.launch(launch_xml, **args)
        return ros_session

    return launch
