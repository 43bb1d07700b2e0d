# SPDX-License-Identifier: BSD-3-Clause
"""A state that executes a plan and checks that the arm reached its end."""

from __future__ import annotations

from typing import Annotated, Any, Unpack

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import NotNegative
from modular_framework_core.state_api.option_uses import Named
from modular_framework_states.arm_positions import run_to_end, worst_joint
from modular_framework_states.manager_clients import ManagerError, selected_or_named


class Move(FrameworkState):
    """Executes a plan; positive only if the joints are at its last point afterwards.

    Args:
        plan_name: Name of the plan; empty for the oldest anonymous plan. The input key ``selected_plan`` replaces it.
        start_tolerance: Maximum deviation of a joint from the first point of the plan before the motion [rad or m].
        goal_tolerance: Maximum deviation of a joint from the last point afterwards [rad or m].
        **keys: Outcomes and userdata keys of any state.
    """

    DEFAULT_IO_KEYS = ("arm_commander",)

    def __init__(
        self,
        plan_name: Annotated[str, Named("plan")] = "",
        start_tolerance: NotNegative = 0.02,
        goal_tolerance: NotNegative = 0.03,
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._plan_name = plan_name
        self._start_tolerance, self._goal_tolerance = float(start_tolerance), float(goal_tolerance)

    def execute(self, userdata: Any) -> str:
        """Executes the plan."""
        commander = userdata.arm_commander
        try:
            plan = selected_or_named(self, userdata, "plan", self._plan_name)
        except ManagerError as error:
            return self.fail(str(error))
        trajectory = plan.joint_trajectory
        if not trajectory.points:
            return self.fail(f"plan '{self._plan_name}' has no points")
        first = dict(zip(trajectory.joint_names, trajectory.points[0].positions, strict=False))
        deviation = worst_joint(commander.positions_of(first), first)
        if deviation[1] > self._start_tolerance:
            return self.fail(
                f"plan '{self._plan_name}' starts elsewhere: joint '{deviation[0]}' is {deviation[1]:.4f} away from "
                f"its first point; the tolerance is {self._start_tolerance}; plan again from the current state"
            )
        return run_to_end(self, commander, plan, self._goal_tolerance, f"plan '{self._plan_name}'")
