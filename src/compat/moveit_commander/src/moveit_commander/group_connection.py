# SPDX-License-Identifier: BSD-3-Clause
"""Base class of a group's commander: description of the group, state of the robot, and connection to move_group."""

from __future__ import annotations

from typing import Any

import genpy
import rospy
from geometry_msgs.msg import PoseStamped
from moveit_msgs.msg import (
    ExecuteTrajectoryAction,
    MoveGroupAction,
    MoveItErrorCodes,
    PlannerInterfaceDescription,
    PlanningSceneComponents,
    RobotState,
)
from moveit_msgs.srv import (
    GetPlanningScene,
    GetPlanningSceneRequest,
    GetPositionFK,
    GetPositionFKRequest,
    QueryPlannerInterfaces,
    QueryPlannerInterfacesRequest,
)

from modular_framework_ros.parameter_search import nearest_parameter
from moveit_commander import conversions
from moveit_commander.exception import MoveItCommanderException, ServerError
from moveit_commander.robot_state import CurrentState, current_state
from moveit_commander.servers import Servers

MOVE_ACTION = "move_group"
EXECUTE_ACTION = "execute_trajectory"
CODE_NAMES = {
    value: name for name, value in vars(MoveItErrorCodes).items() if name.isupper() and isinstance(value, int)
}


def code_text(code: MoveItErrorCodes) -> str:
    """Returns the name of an error code with its number."""
    return f"{CODE_NAMES.get(code.val, 'unknown code')} ({code.val})"


def forward_kinematics(servers: Servers, frame: str, link: str, state: RobotState) -> PoseStamped:
    """Returns the pose of a link, an attached object or a subframe in a state, from compute_fk.

    Args:
        servers: Clients of move_group.
        frame: Frame of the returned pose.
        link: Name of the link, object or subframe.
        state: State of the robot.

    Raises:
        ServerError: The service compute_fk is not available.
        MoveItCommanderException: The service rejects the request.
    """
    request = GetPositionFKRequest(fk_link_names=[link], robot_state=state)
    request.header.frame_id = frame
    response = servers.call("compute_fk", GetPositionFK, request)
    if response.error_code.val != MoveItErrorCodes.SUCCESS or not response.pose_stamped:
        raise MoveItCommanderException(
            f"service {servers.resolve('compute_fk')}: no pose of link '{link}' in frame "
            f"'{frame}': {code_text(response.error_code)}"
        )
    return response.pose_stamped[0]


def held_frames(servers: Servers) -> dict[str, str]:
    """Returns the holding link of each attached object and its subframes, keyed by object or subframe name.

    Raises:
        ServerError: The service get_planning_scene is not available.
    """
    request = GetPlanningSceneRequest(PlanningSceneComponents(PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS))
    state = servers.call("get_planning_scene", GetPlanningScene, request).scene.robot_state
    return {
        name: held.link_name
        for held in state.attached_collision_objects
        for name in (held.object.id, *(f"{held.object.id}/{inner}" for inner in held.object.subframe_names))
    }


class GroupConnection:
    """A planning group with its connection to a move_group node."""

    def __init__(self, name: str, robot_description: str, ns: str, wait_for_servers: float) -> None:
        self._state: CurrentState = current_state(robot_description, ns)
        self._model = self._state.model
        self._group = self._model.group(name)
        self._robot_description = robot_description
        self._servers = Servers(ns)
        self._end_effector_link = self._group.tip
        self._pose_reference_frame = self._model.planning_frame
        self._servers.action(MOVE_ACTION, MoveGroupAction, wait_for_servers)
        self._servers.action(EXECUTE_ACTION, ExecuteTrajectoryAction, wait_for_servers)

    def get_name(self) -> str:
        """Returns the name of the group."""
        return self._group.name

    def get_joints(self) -> list[str]:
        """Returns the names of the group's joints, including fixed and mimic joints."""
        return [joint.name for joint in self._group.joints]

    def get_active_joints(self) -> list[str]:
        """Returns the names of the group's active joints, neither fixed nor mimic."""
        return [joint.name for joint in self._group.active_joints]

    def get_variable_names(self) -> list[str]:
        """Returns the names of the group's variables; variables of a planar or floating joint are "joint/variable"."""
        return self._group_names()

    def get_variable_count(self) -> int:
        """Returns the number of the group's variables, including mimic joints."""
        return len(self._group.variables)

    def has_end_effector_link(self) -> bool:
        """Returns whether the group has an end effector link."""
        return bool(self._end_effector_link)

    def get_end_effector_link(self) -> str:
        """Returns the end effector link, the default link of pose targets; "" for none."""
        return self._end_effector_link

    def set_end_effector_link(self, link_name: str) -> None:
        """Sets the end effector link: a link, an attached object or a subframe ("object/subframe").

        Raises:
            MoveItCommanderException: The robot has no such link and holds no such object.
        """
        self._require_frame(link_name, "Unable to set end effector link")
        self._end_effector_link = link_name

    def get_pose_reference_frame(self) -> str:
        """Returns the default frame of pose targets."""
        return self._pose_reference_frame

    def set_pose_reference_frame(self, reference_frame: str) -> None:
        """Sets the default frame of pose targets."""
        self._pose_reference_frame = reference_frame

    def get_planning_frame(self) -> str:
        """Returns the planning frame."""
        return self._model.planning_frame

    def get_interface_description(self) -> PlannerInterfaceDescription:
        """Returns the name and planner ids of move_group's first planner interface."""
        response = self._servers.call(
            "query_planner_interface", QueryPlannerInterfaces, QueryPlannerInterfacesRequest()
        )
        if not response.planner_interfaces:
            raise ServerError("service query_planner_interface: the list is empty; move_group has no planning pipeline")
        return response.planner_interfaces[0]

    def get_current_joint_values(self) -> list[float]:
        """Returns the group's current joint positions [rad or m], in the order of its variables."""
        positions = self._state.positions(self._group_names())
        return [positions.get(joint.name, joint.default) for joint in self._group.variables]

    def get_current_state(self) -> RobotState:
        """Returns the robot's current state."""
        return self._state.message(self._group_names())

    def get_current_state_bounded(self) -> RobotState:
        """Returns the robot's current state with each joint within its bounds."""
        return self.enforce_bounds(self.get_current_state())

    def enforce_bounds(self, robot_state_msg: RobotState) -> RobotState:
        """Returns a copy of a state with each joint wrapped or clipped to its bounds.

        Raises:
            genpy.DeserializationError: The state names no joint; MoveIt deserializes an empty message then.
        """
        if not robot_state_msg.joint_state.name and not robot_state_msg.is_diff:
            raise genpy.DeserializationError(
                "enforce_bounds: the state names no joint; give joint_state.name and "
                "position, as get_current_state() does"
            )
        state = RobotState()
        state.deserialize(conversions.msg_to_string(robot_state_msg))
        joints = self._model.joints
        state.joint_state.position = [
            joints[name].bounded(value) if name in joints else value
            for name, value in zip(state.joint_state.name, state.joint_state.position, strict=True)
        ]
        return state

    def get_current_pose(self, end_effector_link: str = "") -> PoseStamped:
        """Returns the current pose of a link, or of the end effector link, in the planning frame."""
        return self._pose_of(end_effector_link, self.get_current_state())

    def get_current_rpy(self, end_effector_link: str = "") -> list[float]:
        """Returns the current [roll, pitch, yaw] of a link, or of the end effector link [rad]."""
        pose = self.get_current_pose(end_effector_link)
        return conversions.rpy_from_quaternion(conversions.pose_to_list(pose.pose)[3:])

    def _pose_of(self, link: str, state: RobotState) -> PoseStamped:
        link = self._link(link, "get the pose of")
        state.is_diff = link not in self._model.links  # keeps the attached objects, which the state lacks
        pose = forward_kinematics(self._servers, self._model.planning_frame, link, state)
        pose.header.stamp = rospy.Time.now()
        return pose

    def _link(self, link: str, purpose: str) -> str:
        """Returns the given link or the end effector link; raises MoveItCommanderException without one."""
        chosen = link or self._end_effector_link
        if not chosen:
            raise MoveItCommanderException(
                f"There is no end effector to {purpose}: group '{self._group.name}' is not "
                "a chain; name the link, or call set_end_effector_link"
            )
        self._require_frame(chosen, f"Unable to {purpose} '{chosen}'")
        return chosen

    def _require_frame(self, name: str, failure: str) -> None:
        """Raises MoveItCommanderException unless the robot has the link, or holds the object or subframe."""
        if name in self._model.links:
            return
        held = held_frames(self._servers)
        if name not in held:
            raise MoveItCommanderException(
                f"{failure}: robot '{self._model.name}' has no link '{name}', and its attached objects and subframes "
                f"are: {', '.join(held) or 'none'}; get_link_names of RobotCommander lists the links"
            )

    def _group_names(self) -> list[str]:
        return [joint.name for joint in self._group.variables]

    def _parameter(self, name: str, default: float) -> float:
        value: Any = rospy.get_param(nearest_parameter(f"{self._robot_description}{name}"), default)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise MoveItCommanderException(
                f"parameter {rospy.resolve_name(self._robot_description)}{name}: got {value!r}, a number is needed"
            )
        return float(value)
