# SPDX-License-Identifier: BSD-3-Clause
"""What the states share that exchange the messages of a manager with a file."""

from __future__ import annotations

from typing import Literal, Unpack

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_states.manager_clients import Kind, ManagerError, file_request


class ManagerFileState(FrameworkState):
    """Base of these states.

    Args:
        kind: Kind of messages.
        path: A .yaml file; a relative path starts in the folder of the managers, below ``$ROS_HOME``.
        **keys: Outcomes and userdata keys of any state.
    """

    def __init__(self, kind: Kind, path: str, **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._kind, self._path = kind, str(path)

    def _run(self, verb: Literal["save", "load"]) -> str:
        """Asks the manager to save its messages to the file, or to load them; returns the outcome."""
        try:
            file_request(verb, self._kind, self._path)
        except ManagerError as error:
            return self.fail(str(error))
        return self.succeed()
