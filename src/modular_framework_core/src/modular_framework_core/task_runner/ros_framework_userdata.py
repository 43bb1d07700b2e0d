# SPDX-License-Identifier: BSD-3-Clause
"""Provides the userdata keys that the framework's states expect.

Keys: ``selected_grasp``, ``selected_joint_state``, ``selected_trajectory``, ``selected_pose``, ``selected_plan`` (None
until a state selects a message), ``arm_commander`` (ArmCommander), ``manipulator_controller_client``
(actionlib.SimpleActionClient of the Grasp action) and ``max_torque``. The last two are None without a manipulator
(empty parameter ``manipulator_prefix``).

Parameters: see ``parameters/run_task.yaml``. Written: ``manipulator_links_indices``.
Services called: ``get_planning_scene``, ``set_init_acm``.
"""

from __future__ import annotations

from typing import Any

import rospy
from moveit_msgs.msg import PlanningSceneComponents
from moveit_msgs.srv import GetPlanningScene, GetPlanningSceneRequest

from modular_framework_core.commander.arm_commander import ArmCommander
from modular_framework_core.msg import GraspAction
from modular_framework_core.srv import SetInitACM, SetInitACMRequest
from modular_framework_core.task_runner.manipulator_links import manipulator_links
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_ros.calls import call_service, wait_for_service
from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.start_up import start_timeout

SERVICE_TIMEOUT_S = 10.0
SELECTED_KEYS = ("selected_grasp", "selected_joint_state", "selected_trajectory", "selected_pose", "selected_plan")


class UserdataError(RuntimeError):
    """The userdata cannot be initialised."""


def initialise_userdata(userdata: Any) -> None:
    """Adds the framework's keys to the userdata.

    Raises:
        ParameterError: Parameters are missing or invalid; the message names all of them and their files.
        UserdataError, CallError, CommanderError: move_group or a manager is missing or refused a request.
    """
    arm = ("/planner_name", "/robot_speed_factor", "/arm_group_name", "/number_plan_attempt", "/planning_max_time")
    hand = ("/manipulator_prefix", "/manipulator_controller_action_server_name", "/max_torque")
    *arm_settings, prefix, action, max_torque = DeclaredParameters("modular_framework_core", "run_task").values(
        *arm, *hand
    )
    for key in SELECTED_KEYS:
        userdata[key] = None
    initialise_acm(prefix)
    userdata.arm_commander = _make_arm_commander(*arm_settings)
    userdata.max_torque = max_torque if prefix else None
    userdata.manipulator_controller_client = SteadyActionClient(action, GraspAction) if prefix else None


def initialise_acm(manipulator_prefix: str) -> None:
    """Sends move_group's allowed collision matrix to the ACM manager and publishes the manipulator's link indices.

    Args:
        manipulator_prefix: Texts separated by spaces. A link whose name contains one of the texts belongs to the
            manipulator. "" without a manipulator.

    Raises:
        UserdataError: No link name contains one of the texts, or the ACM manager refused the matrix.
        CallError: A service is missing or did not answer.
    """
    get_scene = rospy.ServiceProxy("/get_planning_scene", GetPlanningScene)
    set_acm = rospy.ServiceProxy("set_init_acm", SetInitACM)
    for proxy in (get_scene, set_acm):
        wait_for_service(proxy, start_timeout())
    components = PlanningSceneComponents.ALLOWED_COLLISION_MATRIX | PlanningSceneComponents.SCENE_SETTINGS
    request = GetPlanningSceneRequest(components=PlanningSceneComponents(components=components))
    acm = call_service(get_scene, request, SERVICE_TIMEOUT_S).scene.allowed_collision_matrix
    indices = manipulator_links(list(acm.entry_names), manipulator_prefix)
    if manipulator_prefix and not indices:
        raise UserdataError(
            f"manipulator_prefix is '{manipulator_prefix}', but no link name contains it; the links are: "
            f"{', '.join(acm.entry_names)}; correct it in the launch file, or leave it empty for a task without gripper"
        )
    rospy.set_param("manipulator_links_indices", indices)
    if not call_service(set_acm, SetInitACMRequest(acm=acm), SERVICE_TIMEOUT_S).success:
        raise UserdataError(
            f"the ACM manager refused move_group's allowed collision matrix of {len(acm.entry_names)} entries; "
            "its node logged the reason"
        )


def _make_arm_commander(planner: str, speed: float, group: str, attempts: int, time_s: float) -> ArmCommander:
    """Returns a connected commander of a planning group.

    Args:
        planner: Planner ID.
        speed: Velocity scaling factor, above 0 and at most 1.
        group: Planning group.
        attempts: Number of planning attempts.
        time_s: Planning time [s].

    Raises:
        CommanderError: A service, action or topic is missing, or the planner is unknown.
    """
    commander = ArmCommander(name=group, set_ground=False)
    commander.set_max_velocity_scaling_factor(speed)
    commander.set_num_planning_attempts(attempts)
    commander.set_planning_time(time_s)
    commander.connect()
    commander.set_planner_id(planner)
    return commander
