# SPDX-License-Identifier: BSD-3-Clause
"""Service plan_sequence_path: plans a sequence of optionally blended motions without executing it."""

from __future__ import annotations

from typing import Any

from moveit_msgs.srv import GetMotionSequence, GetMotionSequenceResponse

from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.capabilities.capability import ServiceCapability
from modular_framework_planning.move_group.motion_sequences import solve_sequence


class SequenceService(ServiceCapability):
    """Offers plan_sequence_path (moveit_msgs/GetMotionSequence)."""

    name, kind = names.SEQUENCE_SERVICE, GetMotionSequence

    def _serve(self, request: Any) -> GetMotionSequenceResponse:
        solved = solve_sequence(self._context, request.request, lambda scene: scene, lambda: False)
        return GetMotionSequenceResponse(solved.response)
