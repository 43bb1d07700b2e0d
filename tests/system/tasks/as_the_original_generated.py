#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A state machine with the imports and the set-up of those that the original framework generated."""

import actionlib
import rospy
from sr_robot_commander.sr_arm_commander import SrArmCommander

import smach
from modular_framework_core.msg import GraspAction
from modular_framework_core.states.move import Move
from modular_framework_core.states.plan import Plan


class AsTheOriginalGenerated(smach.StateMachine):
    """Plans to a named joint state and goes there."""

    def __init__(self, outcomes=("sm_successful", "sm_failed")):
        smach.StateMachine.__init__(self, outcomes=list(outcomes))
        with self:
            smach.StateMachine.add(
                "PlanMotion",
                Plan(
                    target_state_type="joint_state",
                    target_state_name="initial_pose",
                    plan_name="to_init",
                    outcomes=["success", "fail"],
                    io_keys=["arm_commander"],
                ),
                transitions={"success": "MoveInit", "fail": "sm_failed"},
            )
            smach.StateMachine.add(
                "MoveInit",
                Move(plan_name="to_init", io_keys=["arm_commander"]),
                transitions={"success": "sm_successful", "fail": "sm_failed"},
            )
        self.userdata.selected_plan = None
        commander = SrArmCommander(name=rospy.get_param("/arm_group_name"), set_ground=False)
        commander.set_max_velocity_scaling_factor(rospy.get_param("/robot_speed_factor"))
        commander.set_planner_id(rospy.get_param("/planner_name"))
        commander.set_num_planning_attempts(rospy.get_param("/number_plan_attempt"))
        commander.set_planning_time(rospy.get_param("/planning_max_time"))
        self.userdata.arm_commander = commander
        self.userdata.manipulator_controller_client = actionlib.SimpleActionClient(
            rospy.get_param("/manipulator_controller_action_server_name"), GraspAction
        )
        self.userdata.max_torque = rospy.get_param("/max_torque")


if __name__ == "__main__":
    rospy.init_node("as_the_original_generated_sm")
    AsTheOriginalGenerated().execute()
