# SPDX-License-Identifier: BSD-3-Clause
"""Service check_state_validity: checks a state for collisions, joint bounds and constraints."""

from __future__ import annotations

from typing import Any

import numpy as np
import rospy
from moveit_msgs.msg import ContactInformation
from moveit_msgs.srv import GetStateValidity, GetStateValidityResponse

from modular_framework_planning.contacts import Contact
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.constraint_conversions import evaluated_one_by_one, result_messages
from modular_framework_planning.messages.conversions import BODY_TYPES, scene_with_state
from modular_framework_planning.messages.multi_dof import names_joints
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.capabilities.capability import ServiceCapability

_LOG_PERIOD_S = 5.0  # cached messages; clients often check many states with identical messages


class StateValidationService(ServiceCapability):
    """Offers check_state_validity (moveit_msgs/GetStateValidity)."""

    name, kind = names.STATE_VALIDITY_SERVICE, GetStateValidity

    def _serve(self, request: Any) -> GetStateValidityResponse:
        try:
            return self._check(request)
        except Exception as error:  # noqa: BLE001 - one bad request must not take the node down; the reporter logs it
            self._context.reporter.failure("validity", error, group=request.group_name)
            return GetStateValidityResponse(valid=False)

    def _check(self, request: Any) -> GetStateValidityResponse:
        """Checks a state; raises PlanningError for an invalid request.

        The response lists all contacts and one result per constraint: joints, positions, orientations, visibility.
        A malformed constraint is logged and reported as violated with infinite distance. Cost sources stay empty,
        because space in the scene is either free or occupied.
        """
        if not names_joints(request.robot_state) or request.robot_state.is_diff:
            self._context.monitor.wait_for_state()
        scene = scene_with_state(self._context.monitor.snapshot(), request.robot_state)
        model = self._context.model
        if not np.isfinite(scene.positions).all():
            raise PlanningError(ErrorCode.INVALID_ROBOT_STATE, "robot_state: a joint position is not finite")
        group = model.group(request.group_name) if request.group_name else None
        moving = [int(index) for index in (group.indices if group else range(len(model.joint_names)))]
        contacts = self._context.new_checker(scene, moving).contacts(scene.positions, include_fixed=group is None)
        problems = model.bound_violations(scene.positions, moving, 1e-6)
        results, refused = evaluated_one_by_one(
            scene, request.constraints, "constraints", group.tip_link if group else ""
        )
        if refused:
            self._context.reporter.report(
                "validity", ErrorCode.INVALID_GOAL_CONSTRAINTS, "; ".join(refused), group=request.group_name
            )
        problems += [item.text for item in results if not item.satisfied]
        if problems:
            rospy.loginfo_throttle_identical(_LOG_PERIOD_S, f"{self.name}: not valid: {'; '.join(problems)}")
        return GetStateValidityResponse(
            valid=not contacts and not problems,
            contacts=[self._contact(item, model.planning_frame) for item in contacts],
            constraint_result=result_messages(results),
        )

    @staticmethod
    def _contact(contact: Contact, frame: str) -> ContactInformation:
        message = ContactInformation(
            depth=contact.depth,
            contact_body_1=contact.first.name,
            body_type_1=BODY_TYPES[contact.first.kind],
            contact_body_2=contact.second.name,
            body_type_2=BODY_TYPES[contact.second.kind],
        )
        message.header.frame_id = frame
        message.position.x, message.position.y, message.position.z = (float(v) for v in contact.position)
        message.normal.x, message.normal.y, message.normal.z = (float(v) for v in contact.normal)
        return message
