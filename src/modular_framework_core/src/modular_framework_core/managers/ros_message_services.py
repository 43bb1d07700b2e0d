# SPDX-License-Identifier: BSD-3-Clause
"""Serves message stores on the wire: one ``add`` and one ``get`` service for each kind of message."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import rospy

from modular_framework_core import srv
from modular_framework_core.managers.message_store import MessageNotFoundError, MessageStore


@dataclass(frozen=True, slots=True)
class MessageKind:
    """How one kind of message travels.

    Attributes:
        noun: Word for the message in log lines.
        add_type: Service type that stores a message.
        get_type: Service type that hands one out.
        message_field: Field of the message in both types.
        name_field: Field of the name in both requests.
        suffixes: Services are called ``add_<suffix>`` and ``get_<suffix>``.
    """

    noun: str
    add_type: Any
    get_type: Any
    message_field: str
    name_field: str
    suffixes: tuple[str, ...]


JOINT_STATE = MessageKind("joint state", srv.AddJointState, srv.GetJointState, "joint_state", "joint_state_name",
                          ("joint_state",))
TRAJECTORY = MessageKind("trajectory", srv.AddJointTrajectory, srv.GetJointTrajectory, "joint_trajectory",
                         "trajectory_name", ("trajectory",))
POSE = MessageKind("pose", srv.AddPoseStamped, srv.GetPoseStamped, "pose_stamped", "pose_name",
                   ("pose_stamped", "pose"))
ROBOT_POSE = MessageKind("robot pose", srv.AddRobotPose, srv.GetRobotPose, "robot_pose", "robot_pose_name",
                         ("robot_pose",))
PLAN = MessageKind("plan", srv.AddMoveitPlan, srv.GetMoveitPlan, "moveit_plan", "plan_name", ("plan",))
GRASP = MessageKind("grasp", srv.AddStandardisedGrasp, srv.GetStandardisedGrasp, "grasp_message", "grasp_name",
                    ("grasp",))


def complete_grasp_id(grasp: Any, name: str) -> None:
    """Gives a grasp without an id the name it is stored under."""
    if not grasp.grasp_id:
        grasp.grasp_id = name


class MessageServices:
    """One store behind its services.

    A request that cannot be served answers ``success=False`` and logs the reason; it never raises.

    Services:
        ``add_<suffix>``, ``get_<suffix>``: of the kind's types, for each of its suffixes.
    """

    def __init__(self, kind: MessageKind) -> None:
        """Makes an empty store; nothing is advertised before :meth:`connect`."""
        self.kind = kind
        self.store: MessageStore[Any] = MessageStore(kind.noun, complete_grasp_id if kind is GRASP else None)
        self._services: list[rospy.Service] = []

    def connect(self) -> None:
        """Advertises the services."""
        for suffix in self.kind.suffixes:
            self._services.append(rospy.Service(f"add_{suffix}", self.kind.add_type, self._add))
            self._services.append(rospy.Service(f"get_{suffix}", self.kind.get_type, self._get))

    def close(self) -> None:
        """Withdraws the services; may be called twice."""
        while self._services:
            self._services.pop().shutdown("the manager is closed")

    def _add(self, request: Any) -> Any:
        name = getattr(request, self.kind.name_field)
        if self.store.add(getattr(request, self.kind.message_field), name):
            rospy.loginfo("The %s '%s' was overwritten.", self.kind.noun, name)
        return self.kind.add_type._response_class(success=True)

    def _get(self, request: Any) -> Any:
        response = self.kind.get_type._response_class()
        try:
            setattr(response, self.kind.message_field, self.store.get(getattr(request, self.kind.name_field)))
            response.success = True
        except MessageNotFoundError as error:
            rospy.logerr("%s", error)
            response.success = False
        return response
