# SPDX-License-Identifier: BSD-3-Clause
"""A state that resets the managers to the configuration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_states.manager_clients import Kind, ManagerError, all_kinds, file_request


class ReinitialiseManagers(FrameworkState):
    """Removes messages that were added to managers, and reloads their files of named messages.

    Args:
        kinds: Kinds of messages whose managers are reset; empty for all kinds.
        **keys: Outcomes and userdata keys of any state.
    """

    def __init__(self, kinds: Sequence[Kind] = (), **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._kinds = tuple(kinds) or all_kinds()

    def execute(self, userdata: Any) -> str:
        """Resets the managers one by one, even after a failure."""
        faults = []
        for kind in self._kinds:
            try:
                file_request("reload", kind, "")
            except ManagerError as error:
                faults.append(str(error))
        return self.fail("; ".join(faults)) if faults else self.succeed()
