# SPDX-License-Identifier: BSD-3-Clause
"""The test of a node on a ROS master of its own: run it with ``./install.sh exec python3 -m pytest <this file>``."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
import rospy
from geometry_msgs.msg import PoseStamped

from modular_framework_core.srv import AddPoseStamped, GetPoseStamped
from modular_framework_testing.ros_session import RosSession, until

LAUNCH = """<launch>
  <node name="managers" pkg="modular_framework_core" type="managers" output="screen"/>
</launch>"""


@pytest.fixture(scope="module")
def session() -> Iterator[RosSession]:
    """The running launch, with this process as a node beside it."""
    session = RosSession()
    try:
        session.start_master()
        os.environ.update(session.env)
        rospy.init_node("test", disable_signals=True)
        session.launch(LAUNCH)
        yield session
    finally:
        rospy.signal_shutdown("end of the tests")
        session.stop()


def test_a_stored_pose_is_returned(session: RosSession) -> None:
    """Replace the managers by your node, and these calls by its services and topics."""
    session.wait_for_service("get_pose", 60.0)
    pose = PoseStamped()
    pose.header.frame_id = "shelf"
    assert rospy.ServiceProxy("add_pose", AddPoseStamped)(pose, "bin").success
    get_pose = rospy.ServiceProxy("get_pose", GetPoseStamped)
    until(lambda: get_pose("bin").success, "the stored pose")
    assert get_pose("bin").pose_stamped.header.frame_id == "shelf"
