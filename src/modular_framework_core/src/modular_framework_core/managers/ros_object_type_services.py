# SPDX-License-Identifier: BSD-3-Clause
"""Services of the types of simulated objects."""

from __future__ import annotations

from typing import Any

import rospy

from modular_framework_core.managers.object_types import ObjectTypeError, ObjectTypes
from modular_framework_core.managers.ros_manager_services import ManagerServices
from modular_framework_core.managers.ros_simulated_objects import remove_deleted_objects
from modular_framework_core.srv import (
    AddGazeboMapping,
    AddGazeboMappingResponse,
    DeleteGazeboMapping,
    DeleteGazeboMappingResponse,
    GetGazeboType,
    GetGazeboTypeResponse,
)


class ObjectTypeServices(ManagerServices):
    """ROS interface of the object types.

    Parameters:
        ``simulation`` (bool): Whether to remove objects that were deleted from the simulation, before each request.

    Services:
        ``add_gazebo_mapping`` (AddGazeboMapping), ``get_object_type`` (GetGazeboType),
        ``delete_gazebo_mapping`` (DeleteGazeboMapping).
    Services called: in simulation ``gazebo/get_world_properties``.
    """

    def __init__(self) -> None:
        """Creates an empty map; :meth:`connect` advertises the services."""
        self.types = ObjectTypes()
        super().__init__()

    def connect(self) -> None:
        """Advertises the services."""
        self._services = [
            rospy.Service("add_gazebo_mapping", AddGazeboMapping, self._add),
            rospy.Service("get_object_type", GetGazeboType, self._get),
            rospy.Service("delete_gazebo_mapping", DeleteGazeboMapping, self._delete),
        ]

    def _remove_deleted_objects(self) -> None:
        remove_deleted_objects(self.types.remove_missing, "object types")

    def _add(self, request: Any) -> AddGazeboMappingResponse:
        self._remove_deleted_objects()
        try:
            self.types.add(request.object_name, request.object_type)
            return AddGazeboMappingResponse(success=True)
        except ObjectTypeError as error:
            rospy.logwarn("add_gazebo_mapping: %s", error)
            return AddGazeboMappingResponse(success=False)

    def _get(self, request: Any) -> GetGazeboTypeResponse:
        self._remove_deleted_objects()
        try:
            return GetGazeboTypeResponse(object_type=self.types.get(request.object_name), success=True)
        except ObjectTypeError as error:
            rospy.logdebug("get_object_type: %s", error)
            return GetGazeboTypeResponse(success=False)

    def _delete(self, request: Any) -> DeleteGazeboMappingResponse:
        try:
            self.types.delete(request.object_name)
            return DeleteGazeboMappingResponse(success=True)
        except ObjectTypeError as error:
            rospy.logwarn("delete_gazebo_mapping: %s", error)
            return DeleteGazeboMappingResponse(success=False)
