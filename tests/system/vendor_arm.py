# SPDX-License-Identifier: BSD-3-Clause
"""Plays a vendor's driver: an arm and a gripper that offer only actions and joint states, in the namespace /vendor."""

from __future__ import annotations

import threading
import time

import actionlib
import numpy as np
import rosgraph
import rospy
from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    GripperCommandAction,
    GripperCommandGoal,
    GripperCommandResult,
)
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

ARM = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
START = [3.1375783963, -1.6559683943, 1.3870131566, -1.2662363723, -1.5707963268, 0.0]
FINGER = "ezgripper_knuckle_palm_L1_1"
PERIOD_S = 0.02


class VendorArm:
    """Follows trajectories exactly, and moves the finger at once."""

    def __init__(self) -> None:
        self._positions = dict(zip([*ARM, FINGER], [*START, 0.0], strict=True))
        self._states = rospy.Publisher("/vendor/joint_states", JointState, queue_size=10)
        running = rospy.Publisher("/vendor/robot_program_running", Bool, queue_size=1, latch=True)
        running.publish(True)
        arm = "/vendor/scaled_pos_joint_traj_controller/follow_joint_trajectory"
        self._arm = actionlib.SimpleActionServer(arm, FollowJointTrajectoryAction, self._follow, auto_start=False)
        gripper = "/vendor/gripper/gripper_cmd"
        self._gripper = actionlib.SimpleActionServer(gripper, GripperCommandAction, self._grip, auto_start=False)
        self._arm.start()
        self._gripper.start()
        threading.Thread(target=self._publish, daemon=True).start()

    def _publish(self) -> None:
        while not rospy.is_shutdown():
            message = JointState(name=list(self._positions), position=list(self._positions.values()))
            message.velocity = [0.0] * len(message.name)
            message.header.stamp = rospy.Time.now()
            self._states.publish(message)
            time.sleep(PERIOD_S)

    def _follow(self, goal: FollowJointTrajectoryGoal) -> None:
        print("goal accepted", flush=True)
        points = goal.trajectory.points
        times = [point.time_from_start.to_sec() for point in points]
        paths = np.array([point.positions for point in points])
        begun = time.monotonic()
        while (passed := time.monotonic() - begun) < times[-1]:
            if self._arm.is_preempt_requested():
                self._arm.set_preempted()
                return
            self._move(goal.trajectory.joint_names, [float(np.interp(passed, times, path)) for path in paths.T])
            time.sleep(PERIOD_S)
        self._move(goal.trajectory.joint_names, list(points[-1].positions))
        self._arm.set_succeeded(FollowJointTrajectoryResult())

    def _move(self, names: list[str], positions: list[float]) -> None:
        self._positions.update(zip(names, positions, strict=True))

    def _grip(self, goal: GripperCommandGoal) -> None:
        self._positions[FINGER] = goal.command.position
        self._gripper.set_succeeded(GripperCommandResult(position=goal.command.position, reached_goal=True))


if __name__ == "__main__":
    while not rosgraph.is_master_online():
        time.sleep(PERIOD_S)
    rospy.init_node("vendor_arm")
    vendor_arm = VendorArm()
    rospy.spin()
