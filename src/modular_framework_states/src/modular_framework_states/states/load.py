# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task load the messages of a manager from a file."""

from __future__ import annotations

from typing import Any, Unpack

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_states.manager_clients import Kind, ManagerError, file_request


class Load(FrameworkState):
    """Reads what ``store`` wrote into a manager, beside what it holds.

    Args:
        kind: Kind of messages.
        path: A .yaml file; a relative path starts in the folder of the managers, below ``$ROS_HOME``.
        **keys: Outcomes and userdata keys of any state.
    """

    def __init__(self, kind: Kind, path: str, **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._kind, self._path = kind, str(path)

    def execute(self, userdata: Any) -> str:
        """Loads the file into the manager."""
        try:
            file_request("load", self._kind, self._path)
        except ManagerError as error:
            return self.fail(str(error))
        return self.succeed()
