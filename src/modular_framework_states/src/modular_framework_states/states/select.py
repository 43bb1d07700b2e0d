# SPDX-License-Identifier: BSD-3-Clause
"""A state that selects the message for the following states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Unpack

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_uses import Key, Named, kind_of
from modular_framework_states.manager_clients import ManagerError, fetch

MessageType = Annotated[
    Literal["joint_state", "trajectory", "plan", "pose", "pregrasp", "grasp", "postgrasp"], Key("output", "selected_{}")
]
Names = Annotated[Sequence[str] | str | None, Named("option:message_type")]


class Select(FrameworkState):
    """Copies the next message of a manager to the userdata key ``selected_<type>``.

    Every execution selects the next name of the list, or the oldest anonymous message without a list. After the last
    name the outcome is negative, and the next execution starts again with the first. All grasp stages use
    ``selected_grasp``.

    Args:
        message_type: Type of message: joint_state, trajectory, plan, pose, grasp, pregrasp or postgrasp.
        message_names: Names to select in turn; None for anonymous messages.
        **keys: Outcomes and userdata keys of any state; ``selected_<type>`` must be an output key.
    """

    def __init__(self, message_type: MessageType, message_names: Names = None, **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._kind = kind_of(message_type)
        self._key = f"selected_{self._kind}"
        self._names = [message_names] if isinstance(message_names, str) else list(message_names or [""])
        self._anonymous = not message_names
        self._next = 0

    def execute(self, userdata: Any) -> str:
        """Selects the next message."""
        if self._key not in self.get_registered_output_keys():
            return self.fail(
                f"the key '{self._key}' is not among the output keys {sorted(self._output_keys)}; add it, "
                "or the message is lost"
            )
        if self._next >= len(self._names):
            self._next = 0
            return self.fail(f"all {len(self._names)} names were used: {', '.join(self._names)}")
        try:
            message = fetch(self._kind, self._names[self._next])
        except ManagerError as error:
            return self.fail(str(error))
        if not self._anonymous:
            self._next += 1
        setattr(userdata, self._key, message)
        return self.succeed()
