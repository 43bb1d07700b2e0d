# SPDX-License-Identifier: BSD-3-Clause
"""Service check_state_validity: says whether a state is free and within bounds, and what touches what."""
from __future__ import annotations

from typing import Any

import rospy
from moveit_msgs.msg import ContactInformation
from moveit_msgs.srv import GetStateValidity, GetStateValidityResponse

from modular_framework_planning import capability_names as names
from modular_framework_planning.collision import CollisionChecker, Contact
from modular_framework_planning.conversions import BODY_TYPES, refuse_constraints, scene_with_state
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.ros_context import MoveGroupContext


class StateValidationService:
    """Offers check_state_validity (moveit_msgs/GetStateValidity)."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context

    def connect(self) -> None:
        """Advertises the service."""
        rospy.Service(names.STATE_VALIDITY_SERVICE, GetStateValidity, self._serve)

    def _serve(self, request: Any) -> GetStateValidityResponse:
        response = GetStateValidityResponse(valid=False)
        try:
            refuse_constraints("constraints", request.constraints, ErrorCode.INVALID_GOAL_CONSTRAINTS)
            if not request.robot_state.joint_state.name or request.robot_state.is_diff:
                self._context.monitor.wait_for_state()
            scene = scene_with_state(self._context.monitor.snapshot(), request.robot_state)
            model = self._context.model
            group = model.group(request.group_name) if request.group_name else None
            moving = group.indices if group else range(len(model.joint_names))
            checker = CollisionChecker(scene, [int(number) for number in moving])
            contacts = checker.contacts(scene.positions, include_fixed=group is None)
            problems = model.bound_violations(scene.positions, [int(number) for number in moving], 1e-6)
        except Exception as error:  # noqa: BLE001 - one bad request must not take the node down; the reporter logs it
            self._context.reporter.failure("validity", error, group=request.group_name)
            if not isinstance(error, PlanningError):
                rospy.logdebug("check_state_validity answered 'not valid' after an unexpected error")
            return response
        response.contacts = [self._contact(item, model.planning_frame) for item in contacts]
        response.valid = not contacts and not problems
        if problems:
            rospy.logdebug("state not valid: %s", "; ".join(problems))
        return response

    @staticmethod
    def _contact(contact: Contact, frame: str) -> ContactInformation:
        message = ContactInformation(depth=contact.depth, contact_body_1=contact.first.name,
                                     body_type_1=BODY_TYPES[contact.first.kind], contact_body_2=contact.second.name,
                                     body_type_2=BODY_TYPES[contact.second.kind])
        message.header.frame_id = frame
        message.position.x, message.position.y, message.position.z = (float(v) for v in contact.position)
        message.normal.x, message.normal.y, message.normal.z = (float(v) for v in contact.normal)
        return message
