# SPDX-License-Identifier: BSD-3-Clause
"""Base class of the states that save a manager's messages to a file or load them."""

from __future__ import annotations

from typing import Literal, Unpack

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_states.manager_clients import Kind, ManagerError, file_request


class ManagerFileState(FrameworkState):
    """Saves the messages of a manager to a file, or loads them.

    Args:
        kind: Kind of messages.
        path: Path of a .yaml file; a relative path starts in the managers' folder below ``$ROS_HOME``.
        **keys: Outcomes and userdata keys of any state.
    """

    def __init__(self, kind: Kind, path: str, **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._kind, self._path = kind, str(path)

    def _run(self, verb: Literal["save", "load"]) -> str:
        """Requests the manager to save or load the file; returns the outcome."""
        try:
            file_request(verb, self._kind, self._path)
        except ManagerError as error:
            return self.fail(str(error))
        return self.succeed()
