# SPDX-License-Identifier: BSD-3-Clause
"""A simulation that is reset in the middle of a task ends the motion under way, says why, and the task goes on."""

from __future__ import annotations

import subprocess
import sys

from modular_framework_testing.ros_session import RosSession

TASK_TIMEOUT_S = 240.0
RESET = """
import sys
import rospy
from actionlib_msgs.msg import GoalStatus, GoalStatusArray
from std_srvs.srv import Empty

rospy.init_node("reset", disable_signals=True)
def moves(message):
    return any(item.status == GoalStatus.ACTIVE for item in message.status_list)
while not moves(rospy.wait_for_message("/arm_trajectory_controller/follow_joint_trajectory/status", GoalStatusArray)):
    pass
rospy.ServiceProxy("/gazebo/reset_simulation", Empty)()
"""


def test_a_task_whose_first_motion_a_reset_ends_begins_that_motion_again(session: RosSession) -> None:
    launch = session.run_framework(gui="false", rviz="false")
    session.wait_for_service("/gazebo/reset_simulation", 120.0)
    subprocess.run([sys.executable, "-c", RESET], env=session.env, check=True, timeout=TASK_TIMEOUT_S)
    assert launch.wait(TASK_TIMEOUT_S) == 0, launch.log()
    log = launch.log()
    assert "ended with PREEMPTED, error_code -1: the simulation was reset" in log
    assert "Task 'simulation_pick' ended with outcome 'successful_pipeline': SUCCEEDED" in log
