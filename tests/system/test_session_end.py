# SPDX-License-Identifier: BSD-3-Clause
"""A test session refuses a launch without a master, and its end leaves no process behind."""

from __future__ import annotations

import os
import signal

import pytest

from modular_framework_testing.ros_session import RosSession, until


def test_a_session_whose_roslaunch_was_killed_leaves_no_master_behind(session: RosSession) -> None:
    launch = session.launch_package(
        "modular_framework_core", "manage_object.launch", object_type="cube", object_name="a", object_position="0 0 0"
    )
    until(lambda: len(session.processes()) >= 3, "roslaunch, its master and a node run", 60.0)
    os.kill(launch.process.pid, signal.SIGKILL)
    launch.process.wait(30.0)
    assert session.processes(), "the master and the node outlive roslaunch"
    session.stop()
    until(lambda: not session.processes(), "all processes of the session to end", 30.0)


def test_a_launch_without_a_master_is_refused_instead_of_waiting_forever(session: RosSession) -> None:
    session.master_timeout_s = 0.5
    with pytest.raises(AssertionError, match="not within 0.5 s: a ROS master on port .*, started by start_master"):
        session.launch("<launch/>")
