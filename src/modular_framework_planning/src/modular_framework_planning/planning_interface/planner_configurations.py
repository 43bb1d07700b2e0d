# SPDX-License-Identifier: BSD-3-Clause
"""The named settings of a pipeline's planners, which clients may read and change while the node runs."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any


class PlannerConfigurations:
    """Settings by name, for all groups or for one; safe to share between threads."""

    def __init__(self, named: Mapping[str, Mapping[str, Any]]) -> None:
        """Copies the settings.

        Args:
            named: planner_configs of the pipeline's parameters.
        """
        self._lock = threading.Lock()
        self._entries: dict[tuple[str, str], dict[str, Any]] = {
            ("", name): dict(entry or {}) for name, entry in named.items()
        }

    def names(self) -> tuple[str, ...]:
        """Returns the names that settings exist for."""
        with self._lock:
            return tuple(dict.fromkeys(name for _, name in self._entries))

    def get(self, name: str, group: str = "") -> dict[str, Any]:
        """Returns a copy of the settings of a name; those of the group come before those of all groups."""
        with self._lock:
            return {**self._entries.get(("", name), {}), **(self._entries.get((group, name), {}) if group else {})}

    def snapshot(self) -> dict[tuple[str, str], dict[str, Any]]:
        """Returns everything, for `restore` in another process."""
        with self._lock:
            return {key: dict(entry) for key, entry in self._entries.items()}

    def restore(self, entries: Mapping[tuple[str, str], Mapping[str, Any]]) -> None:
        """Takes over what `snapshot` returned."""
        with self._lock:
            self._entries = {key: dict(entry) for key, entry in entries.items()}

    def set(self, name: str, group: str, values: Mapping[str, Any], replace: bool) -> None:
        """Changes settings.

        Args:
            name: of the settings; a new name is added.
            group: they are for; empty for all groups.
            values: new values by key.
            replace: drop all keys that are not given.
        """
        with self._lock:
            old = {} if replace else self._entries.get((group, name), {})
            self._entries[group, name] = {**old, **values}
