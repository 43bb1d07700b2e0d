# SPDX-License-Identifier: BSD-3-Clause
"""Service plan_sequence_path: plans a sequence of motions, blended where asked, without moving."""

from __future__ import annotations

from typing import Any

import rospy
from moveit_msgs.srv import GetMotionSequence, GetMotionSequenceResponse

from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.motion_sequences import solve_sequence


class SequenceService:
    """Offers plan_sequence_path (moveit_msgs/GetMotionSequence)."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context

    def connect(self) -> None:
        """Advertises the service."""
        rospy.Service(names.SEQUENCE_SERVICE, GetMotionSequence, self._serve)

    def _serve(self, request: Any) -> GetMotionSequenceResponse:
        return GetMotionSequenceResponse(solve_sequence(self._context, request.request, lambda scene: scene).response)
