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


def planner_kind(
    own: Mapping[str, Any], groups: Mapping[str, Mapping[str, Any]], name: str, group: str
) -> tuple[str, dict[str, Any]]:
    """Returns the planner of a configuration's name, and its settings with those of the group.

    Args:
        own: Settings of that name.
        groups: Settings of the pipeline's groups.
        name: Name of the planner or configuration.
        group: Planning group.
    """
    kind = str(own.get("type", name)).removeprefix("geometric::").removesuffix("kConfigDefault")
    not_settings = ("planner_configs", "default_planner_config")
    of_group = {key: value for key, value in groups.get(group, {}).items() if key not in not_settings}
    return kind, of_group | {key: value for key, value in own.items() if key != "type"}


def without_group(planner_id: str) -> str:
    """Returns the planner in a name such as arm[RRTConnect]."""
    return planner_id.split("[")[-1].rstrip("]") if planner_id.endswith("]") and "[" in planner_id else planner_id
