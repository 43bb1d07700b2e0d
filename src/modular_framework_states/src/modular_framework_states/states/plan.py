# SPDX-License-Identifier: BSD-3-Clause
"""A state that plans an arm motion for later execution."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Unpack

from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from modular_framework_core.commander.arm_commander import CommanderError
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_uses import FROM_USERDATA, GRASP_STAGES, Named, kind_of
from modular_framework_states.grasp_stages import StageError, arrival_fingers, near_joints, stage_joints
from modular_framework_states.manager_clients import ManagerError, fetch, store_plan

StateType = Literal["pose", "joint_state", "pregrasp", "grasp", "postgrasp"]
TargetName = Annotated[str, Named("option:target_state_type", userdata=True)]
StartName = Annotated[str, Named("option:starting_state_type", userdata=True)]


class Plan(FrameworkState):
    """Plans an arm motion and stores the plan.

    Target poses are converted to the joint positions nearest to the start of the plan, so that concurrent plans fit
    together (see ``grasp_stages``). At the start stage of a grasp, the fingers have the pregrasp posture.

    Args:
        target_state_type: Pose, joint_state, grasp, pregrasp or postgrasp.
        target_state_name: Name of the message; ``userdata`` for ``selected_<type>``; empty for the oldest anonymous
            message.
        plan_name: Name of the stored plan; empty for an anonymous plan.
        starting_state_type: As for the target; empty for the current position.
        starting_state_name: As for the target.
        group: Planning group; empty for the group of the arm commander (``arm_group_name``).
        **keys: Outcomes and userdata keys of any state; the output key ``selected_plan`` receives the plan.
    """

    DEFAULT_IO_KEYS = ("arm_commander",)

    def __init__(
        self,
        target_state_type: StateType,
        target_state_name: TargetName = "",
        plan_name: Annotated[str, Named("plan", made=True)] = "",
        starting_state_type: StateType | Literal[""] = "",
        starting_state_name: StartName = "",
        group: Annotated[str, Named("group")] = "",
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._target_type, self._target_name = target_state_type, target_state_name
        self._start_type, self._start_name = starting_state_type, starting_state_name
        self._plan_name, self._group = plan_name, group

    def execute(self, userdata: Any) -> str:
        """Makes and stores the plan."""
        try:
            commander = userdata.arm_commander.of_group(self._group)
            start = self._start(userdata, commander)
            target = self._target(userdata, commander, start)
            if self.preempt_requested():
                return self.stopped()
            result = commander.plan_to_joint_value_target(target, custom_start_state=start)
            if not result.success:
                return self.fail(f"{self._describe()}: {result.reason}")
            if self.preempt_requested():
                return self.stopped()
            store_plan(result.trajectory, self._plan_name)
        except (ManagerError, StageError, CommanderError) as error:
            return self.fail(f"{self._describe()}: {error}")
        if "selected_plan" in self.get_registered_output_keys():
            userdata.selected_plan = result.trajectory
        return self.succeed()

    def _start(self, userdata: Any, commander: Any) -> dict[str, float] | None:
        """Returns {joint: position} at the start; None for the current state."""
        if not self._start_type:
            return None
        message = self._message(userdata, self._start_type, self._start_name)
        if self._start_type in GRASP_STAGES:
            return stage_joints(commander, message, self._start_type) | arrival_fingers(message)
        return message_joints(commander, message, self._start_name, None)

    def _target(self, userdata: Any, commander: Any, start: Mapping[str, float] | None) -> dict[str, float]:
        """Returns {joint: position} of the target."""
        message = self._message(userdata, self._target_type, self._target_name)
        if self._target_type not in GRASP_STAGES:
            return message_joints(commander, message, self._target_name, start)
        if start is None and self._target_type == "pregrasp":
            return stage_joints(commander, message, self._target_type)
        return near_joints(commander, message, self._target_type, start or commander.current_joints())

    def _message(self, userdata: Any, state_type: str, name: str) -> Any:
        kind = kind_of(state_type)
        if name != FROM_USERDATA:
            return fetch(kind, name)
        keys = [
            key for key in (f"selected_{state_type}", f"selected_{kind}") if key in self.get_registered_input_keys()
        ]
        if not keys:
            raise ManagerError(
                f"the {state_type} is taken from userdata, but 'selected_{kind}' is not among the "
                f"input keys {sorted(self.get_registered_input_keys())}; add the key"
            )
        message = getattr(userdata, keys[0])
        if message is None:
            raise ManagerError(f"userdata '{keys[0]}' is empty; select a message before planning with it")
        return message

    def _describe(self) -> str:
        start = f"{self._start_type} {self._start_name}".strip() or "the current state"
        return f"plan '{self._plan_name}' from {start} to {self._target_type} {self._target_name}".rstrip()


def message_joints(
    commander: Any, message: JointState | PoseStamped, name: str, seed: Mapping[str, float] | None
) -> dict[str, float]:
    """Returns the positions of a joint state, or the joint positions for a pose that are nearest to a seed.

    Args:
        commander: Arm commander that solves inverse kinematics.
        message: Joint state or pose.
        name: Name of the joint state, for errors.
        seed: {joint: position} [rad or m]; None for the current state.

    Raises:
        ManagerError: The joint state has no positions, or the numbers of positions and names differ.
        StageError: The pose cannot be reached.
    """
    if isinstance(message, JointState):
        if not message.name or len(message.name) != len(message.position):
            raise ManagerError(
                f"joint state '{name}' has {len(message.name)} names and {len(message.position)} positions; "
                "it needs the same number of each, at least one"
            )
        return dict(zip(message.name, message.position, strict=True))
    result = commander.solve_ik(message, seed)
    if not result:
        raise StageError(result.reason)
    return dict(result.joints)
