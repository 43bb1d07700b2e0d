# SPDX-License-Identifier: BSD-3-Clause
"""A state that saves a manager's messages to a file."""

from __future__ import annotations

from typing import Any

from modular_framework_states.manager_files import ManagerFileState


class Store(ManagerFileState):
    """Writes the messages of a manager to a file."""

    def execute(self, userdata: Any) -> str:
        """Saves the messages of the manager."""
        return self._run("save")
