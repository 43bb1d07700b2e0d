# SPDX-License-Identifier: BSD-3-Clause
"""Services of the allowed collision matrix."""

from __future__ import annotations

from typing import Any

import rospy
from moveit_msgs.msg import AllowedCollisionEntry, AllowedCollisionMatrix, PlanningScene
from moveit_msgs.srv import ApplyPlanningScene, ApplyPlanningSceneRequest

from modular_framework_core.managers.acm import AcmManager, AcmResult
from modular_framework_core.managers.collision_matrix import AcmError, CollisionMatrix
from modular_framework_core.managers.ros_manager_services import ManagerServices
from modular_framework_core.managers.ros_simulated_objects import new_movable_objects, remove_deleted_objects
from modular_framework_core.srv import (
    GetModifiedACM,
    GetModifiedACMRequest,
    GetModifiedACMResponse,
    ModifyACM,
    ModifyACMRequest,
    ModifyACMResponse,
    SetInitACM,
    SetInitACMResponse,
    UpdateACMEntry,
    UpdateACMEntryRequest,
    UpdateACMEntryResponse,
    UpdateAndPublishACMEntry,
    UpdateAndPublishACMEntryResponse,
)
from modular_framework_ros.calls import CallError, request_service
from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.node_handle import ParameterError

APPLY_TIMEOUT_S = 3.0


def matrix_from_message(message: AllowedCollisionMatrix) -> CollisionMatrix:
    """Returns the matrix of a message.

    Raises:
        AcmError: The matrix is not square or has duplicate names.
    """
    rows = tuple(tuple(map(bool, row.enabled)) for row in message.entry_values)
    defaults = tuple(map(bool, message.default_entry_values))
    return CollisionMatrix(tuple(message.entry_names), rows, tuple(message.default_entry_names), defaults)


def matrix_to_message(matrix: CollisionMatrix) -> AllowedCollisionMatrix:
    """Returns a matrix as a message."""
    return AllowedCollisionMatrix(
        entry_names=list(matrix.names),
        entry_values=[AllowedCollisionEntry(enabled=list(row)) for row in matrix.rows],
        default_entry_names=list(matrix.default_names),
        default_entry_values=list(matrix.default_values),
    )


def apply_matrix(message: AllowedCollisionMatrix, timeout_s: float) -> None:
    """Applies a matrix to move_group's planning scene and waits until it is in effect.

    Args:
        message: Allowed collision matrix.
        timeout_s: Timeout of the service call [s].

    Raises:
        CallError: move_group does not answer in time or refuses the matrix.
    """
    scene = PlanningScene(is_diff=True, allowed_collision_matrix=message)
    scene.robot_state.is_diff = True
    request = ApplyPlanningSceneRequest(scene=scene)
    if not request_service("apply_planning_scene", ApplyPlanningScene, request, timeout_s).success:
        raise CallError(
            f"service '{rospy.resolve_name('apply_planning_scene')}' refused the collision matrix of "
            f"{len(message.entry_names)} entries; its node logged the reason"
        )


class AcmServices(ManagerServices):
    """ROS interface of the ACM manager.

    Parameters:
        ``manipulator_links_indices`` (list of int): Indices of the manipulator's links in the matrix of
            ``set_init_acm``. Read at every ``set_init_acm``.
        ``manipulator_prefix`` (string): Texts in the names of the manipulator's links, used without indices. Read at
            every ``set_init_acm``.
        ``~grip_interfaces`` (bool, false): Whether ``update_acm_entry`` has GRIP's type with the field ``publish``.
        ``simulation`` (bool): Whether to add the movable objects of the simulation before a request about objects,
            and to remove deleted objects before any request.

    Services:
        ``set_init_acm`` (SetInitACM), ``update_acm_entry`` (UpdateACMEntry), ``get_modified_acm`` (GetModifiedACM):
        For the manipulator.
        ``modify_acm`` (ModifyACM): For any links.
    Services called: ``apply_planning_scene`` if ``modify_acm`` requests it or ``update_acm_entry`` disallows a
        collision; in simulation ``get_planning_scene``, ``gazebo/get_model_properties`` and
        ``gazebo/get_world_properties``.
    """

    def __init__(self) -> None:
        """Creates a manager without a matrix; :meth:`connect` advertises the services."""
        self.manager = AcmManager()
        super().__init__()

    def connect(self) -> None:
        """Advertises the services."""
        read = DeclaredParameters("modular_framework_core", "managers").value
        entry_type = UpdateAndPublishACMEntry if read("~grip_interfaces") else UpdateACMEntry
        self._services = [
            rospy.Service("set_init_acm", SetInitACM, self._set_init),
            rospy.Service("update_acm_entry", entry_type, self._update_entry),
            rospy.Service("get_modified_acm", GetModifiedACM, self._get_modified),
            rospy.Service("modify_acm", ModifyACM, self._modify_links),
        ]

    def _set_init(self, request: Any) -> SetInitACMResponse:
        try:
            read = DeclaredParameters("modular_framework_core", "managers").values
            indices, prefix = read("manipulator_links_indices", "manipulator_prefix")
            if self.manager.set_initial(matrix_from_message(request.acm), indices, "" if indices else prefix):
                rospy.loginfo("set_init_acm: an earlier reference collision matrix was replaced.")
            return SetInitACMResponse(success=True)
        except (AcmError, ParameterError, rospy.ROSException) as error:
            rospy.logerr("set_init_acm: %s", error)
            return SetInitACMResponse(success=False)

    def _update_entry(self, request: Any) -> Any:
        permissions_before, publish = self.manager.permissions(), bool(getattr(request, "publish", False))
        self._remove_deleted_objects()
        response = (
            UpdateACMEntryResponse if isinstance(request, UpdateACMEntryRequest) else (UpdateAndPublishACMEntryResponse)
        )
        try:
            warning = self._apply_update(request.action, request.entry_name)
            self._remove_deleted_objects()
            if publish or permissions_before - self.manager.permissions():
                apply_matrix(matrix_to_message(self.manager.current().matrix), APPLY_TIMEOUT_S)
        except AcmError as error:
            rospy.logerr("update_acm_entry: %s", error)
            return response(success=False)
        except CallError as error:
            if publish:
                rospy.logerr("update_acm_entry: the matrix could not be published: %s", error)
                return response(success=False)
            warning = f"move_group keeps the previous collision matrix: {error}"
        if warning:
            rospy.logwarn("update_acm_entry: %s", warning)
        return response(success=True)

    def _apply_update(self, action: int, entry_name: str) -> str:
        match action:
            case UpdateACMEntryRequest.ADD_ENTRY:
                return self.manager.add_object(entry_name)
            case UpdateACMEntryRequest.DELETE_ENTRY:
                return self.manager.delete_object(entry_name)
            case UpdateACMEntryRequest.REINIT:
                self.manager.reinitialise()
                return ""
            case _:
                raise AcmError(f"got action {action}; allowed: ADD_ENTRY=0, DELETE_ENTRY=1, REINIT=2")

    def _get_modified(self, request: Any) -> GetModifiedACMResponse:
        self._remove_deleted_objects()
        try:
            result = self._modify(request)
        except AcmError as error:
            rospy.logerr("get_modified_acm: %s", error)
            return GetModifiedACMResponse(success=False)
        for warning in result.warnings:
            rospy.logwarn("get_modified_acm: %s", warning)
        return GetModifiedACMResponse(acm=matrix_to_message(result.matrix), success=True)

    def _modify(self, request: Any) -> AcmResult:
        match request.modification:
            case GetModifiedACMRequest.NOTHING:
                return self.manager.current()
            case GetModifiedACMRequest.MANIPULATOR_SELF_COLLISION:
                return self.manager.allow_self_collision(request.allow_collision)
            case GetModifiedACMRequest.MANIPULATOR_OBJECT_COLLISION:
                self._add_simulated_objects()
                return self.manager.allow_object_collision(request.objects, request.allow_collision)
            case _:
                raise AcmError(
                    f"got modification {request.modification}; allowed: NOTHING=0, "
                    "MANIPULATOR_SELF_COLLISION=1, MANIPULATOR_OBJECT_COLLISION=2"
                )

    def _modify_links(self, request: Any) -> ModifyACMResponse:
        self._remove_deleted_objects()
        try:
            result = self._modify_matrix(request)
            if request.publish:
                apply_matrix(matrix_to_message(result.matrix), APPLY_TIMEOUT_S)
        except (AcmError, CallError) as error:
            rospy.logerr("modify_acm: %s", error)
            return ModifyACMResponse(success=False)
        for warning in result.warnings:
            rospy.logwarn("modify_acm: %s", warning)
        return ModifyACMResponse(success=True)

    def _modify_matrix(self, request: Any) -> AcmResult:
        match request.modification:
            case ModifyACMRequest.ROBOT_SELF_COLLISION:
                return self.manager.allow_self_collision(request.allow_collision, request.robot_links)
            case ModifyACMRequest.ROBOT_OBJECT_COLLISION:
                self._add_simulated_objects()
                return self.manager.allow_object_collision(
                    request.objects, request.allow_collision, request.robot_links
                )
            case _:
                raise AcmError(
                    f"got modification {request.modification}; allowed: ROBOT_SELF_COLLISION=0, "
                    "ROBOT_OBJECT_COLLISION=1"
                )

    def _remove_deleted_objects(self) -> None:
        remove_deleted_objects(self.manager.remove_missing, "collision matrix")

    def _add_simulated_objects(self) -> None:
        """Adds objects that appeared in the simulation since the last request."""
        try:
            for name in new_movable_objects(self.manager.objects):
                self.manager.add_object(name)
        except CallError as error:
            rospy.logwarn(
                "get_modified_acm: the objects of the simulation are unknown, only added objects are used: %s",
                error,
            )
