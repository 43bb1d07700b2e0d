# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task reset the managers to the configuration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_states.manager_clients import Kind, ManagerError, all_kinds, file_request


class ReinitialiseManagers(FrameworkState):
    """Makes managers forget what was added, and read their files of named messages again.

    Args:
        kinds: Which managers; all of them by default.
        **keys: Outcomes and userdata keys of any state.
    """

    def __init__(self, kinds: Sequence[Kind] = (), **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._kinds = tuple(kinds) or all_kinds()

    def execute(self, userdata: Any) -> str:
        """Calls one manager after the other; continues after one that fails."""
        faults = []
        for kind in self._kinds:
            try:
                file_request("reload", kind, "")
            except ManagerError as error:
                faults.append(str(error))
        return self.fail("; ".join(faults)) if faults else self.succeed()
