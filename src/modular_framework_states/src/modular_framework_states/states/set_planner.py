# SPDX-License-Identifier: BSD-3-Clause
"""A state that changes the planner settings for the following motions."""

from __future__ import annotations

from typing import Annotated, Any, Unpack

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Limits, Share
from modular_framework_core.state_api.option_uses import Named


class SetPlanner(FrameworkState):
    """Changes the settings of the arm commander; omitted settings are kept.

    Args:
        planner_id: Name of the planner, or ``pipeline/planner``; empty keeps the planner.
        planning_time: Maximum planning time [s].
        attempts: Maximum number of planning attempts.
        speed_factor: Fraction of the joints' velocity and acceleration limits.
        group: Planning group whose settings change; empty for the group of the arm commander (``arm_group_name``).
        **keys: Outcomes and userdata keys of any state.
    """

    DEFAULT_IO_KEYS = ("arm_commander",)

    def __init__(
        self,
        planner_id: Annotated[str, Named("planner")] = "",
        planning_time: Annotated[float, Limits(above=0.0, at_most=86400.0)] | None = None,
        attempts: Annotated[int, Limits(at_least=1)] | None = None,
        speed_factor: Share | None = None,
        group: Annotated[str, Named("group")] = "",
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._planner_id, self._group = planner_id, group
        self._settings = {
            "set_planning_time": planning_time,
            "set_num_planning_attempts": attempts,
            "set_max_velocity_scaling_factor": speed_factor,
        }

    def execute(self, userdata: Any) -> str:
        """Applies the given settings, if the planner exists."""
        try:
            commander = userdata.arm_commander.of_group(self._group)
            if self._planner_id:
                commander.set_planner_id(self._planner_id)
            for setter, value in self._settings.items():
                if value is not None:
                    getattr(commander, setter)(value)
        except (ValueError, RuntimeError) as error:
            return self.fail(str(error))
        return self.succeed()
