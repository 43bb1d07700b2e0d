# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task load the messages of a manager from a file."""

from __future__ import annotations

from typing import Any

from modular_framework_states.manager_files import ManagerFileState


class Load(ManagerFileState):
    """Reads what ``store`` wrote into a manager, beside what it holds."""

    def execute(self, userdata: Any) -> str:
        """Loads the file into the manager."""
        return self._run("load")
