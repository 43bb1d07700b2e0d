# SPDX-License-Identifier: BSD-3-Clause
"""A state that loads a manager's messages from a file."""

from __future__ import annotations

from typing import Any

from modular_framework_states.manager_files import ManagerFileState


class Load(ManagerFileState):
    """Adds the messages of a file written by ``store`` to a manager."""

    def execute(self, userdata: Any) -> str:
        """Loads the file into the manager."""
        return self._run("load")
