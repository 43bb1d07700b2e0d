# SPDX-License-Identifier: BSD-3-Clause
"""Gets messages from the managers and stores plans in them, for the states."""

from __future__ import annotations

from typing import Any, Literal, get_args

import rospy
from moveit_msgs.msg import RobotTrajectory

from modular_framework_core import srv
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_ros.calls import CallError, request_service

SERVICE_TIMEOUT_S = 10.0

# kind of message: (service, type, request field of the name, response field of the message)
_GET: dict[str, tuple[str, Any, str, str]] = {
    "joint_state": ("get_joint_state", srv.GetJointState, "joint_state_name", "joint_state"),
    "trajectory": ("get_trajectory", srv.GetJointTrajectory, "trajectory_name", "joint_trajectory"),
    "plan": ("get_plan", srv.GetMoveitPlan, "plan_name", "moveit_plan"),
    "pose": ("get_pose_stamped", srv.GetPoseStamped, "pose_name", "pose_stamped"),
    "grasp": ("get_grasp", srv.GetStandardisedGrasp, "grasp_name", "grasp_message"),
}


Kind = Literal["joint_state", "trajectory", "pose", "robot_pose", "plan", "grasp"]


class ManagerError(RuntimeError):
    """A manager does not respond or has no such message; the message gives the service and the remedy."""


def fetch(kind: str, name: str) -> Any:
    """Returns a message from a manager.

    Args:
        kind: Kind of message: joint_state, trajectory, plan, pose or grasp.
        name: Name of the message; empty removes and returns the oldest anonymous message.

    Raises:
        ManagerError: The manager does not respond or has no such message.
    """
    service, service_type, name_field, message_field = _GET[kind]
    response = _call(service, service_type, service_type._request_class(**{name_field: name}))
    if not response.success:
        problem = (
            f"no {kind.replace('_', ' ')} named '{name}' is stored"
            if name
            else (f"no anonymous {kind.replace('_', ' ')} is left")
        )
        raise ManagerError(f"{problem} (service '{rospy.resolve_name(service)}')")
    return getattr(response, message_field)


def selected_or_named(state: FrameworkState, userdata: Any, kind: str, name: str) -> Any:
    """Returns the userdata ``selected_<kind>`` of a state if that is an input key, otherwise a stored message.

    Args:
        state: State that needs the message.
        userdata: Userdata of the execution.
        kind: Kind of message: trajectory, plan or grasp.
        name: Name of the stored message; empty for the oldest anonymous message.

    Raises:
        ManagerError: Nothing was selected, or the manager does not respond or has no such message.
    """
    key = f"selected_{kind}"
    if key not in state.get_registered_input_keys():
        return fetch(kind, name)
    if userdata[key] is None:
        raise ManagerError(f"userdata '{key}' is empty; add a previous state that selects or makes a {kind}")
    return userdata[key]


def store_plan(plan: RobotTrajectory, name: str) -> None:
    """Stores a plan in the plan manager.

    Raises:
        ManagerError: The manager does not respond or rejects the plan.
    """
    response = _call("add_plan", srv.AddMoveitPlan, srv.AddMoveitPlanRequest(moveit_plan=plan, plan_name=name))
    if not response.success:
        raise ManagerError(f"service '{rospy.resolve_name('add_plan')}' refused the plan '{name}'")


def all_kinds() -> tuple[Kind, ...]:
    """Returns the kinds of messages that have a manager."""
    return get_args(Kind)


def file_request(verb: Literal["save", "load", "reload"], kind: Kind, path: str) -> None:
    """Saves, loads or reloads the messages of a manager.

    Args:
        verb: Request: save, load or reload.
        kind: Kind of messages.
        path: Path of the file; empty for reload.

    Raises:
        ManagerError: The manager does not respond or rejects the request.
    """
    plural = "trajectories" if kind == "trajectory" else f"{kind}s"
    response = _call(f"{verb}_{plural}", srv.MessageFile, srv.MessageFileRequest(path=path))
    if not response.success:
        raise ManagerError(f"service '{rospy.resolve_name(f'{verb}_{plural}')}' refused: {response.message}")


def _call(service: str, service_type: Any, request: Any) -> Any:
    try:
        return request_service(service, service_type, request, SERVICE_TIMEOUT_S)
    except CallError as error:
        raise ManagerError(str(error)) from error
