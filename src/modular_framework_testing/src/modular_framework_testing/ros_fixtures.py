# SPDX-License-Identifier: BSD-3-Clause
"""Fixtures of tests that are ROS nodes: a master, and launches on it. Import them in a `conftest.py`."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rospy

from modular_framework_testing.ros_session import RosSession


@pytest.fixture(scope="session")
def ros_session() -> Iterator[RosSession]:
    """The master of rostest, or a new master if rostest does not run the test.

    The process of the test is a node; rospy permits one node per process.
    """
    is_of_rostest = any(word.startswith("__name:=") for word in sys.argv)
    session = RosSession(os.environ["ROS_MASTER_URI"] if is_of_rostest else None)
    os.environ.update({name: session.env[name] for name in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOME", "ROS_LOG_DIR")})
    try:
        if not is_of_rostest:
            session.start_master()
        rospy.init_node("test", anonymous=True, disable_signals=True)
        yield session
    finally:
        rospy.signal_shutdown("end of the suite")
        session.stop()


@pytest.fixture(scope="module")
def ros_launch(ros_session: RosSession) -> Callable[..., RosSession]:
    """A function that starts a launch file, given as path or text, with arguments, and returns the session.

    It starts nodes that a .test file cannot start: with files that the test writes, with settings of the test, or with
    an end during the test.
    """

    def launch(launch_xml: str | Path, **arguments: object) -> RosSession:
        ros_session.launch(launch_xml, **arguments)
        return ros_session

    return launch
