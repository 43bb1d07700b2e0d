# SPDX-License-Identifier: BSD-3-Clause
"""Named planner configurations of a pipeline, which clients can read and change at runtime."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any


class PlannerConfigurations:
    """Planner settings, keyed by configuration name, for all groups or a single group; thread-safe."""

    def __init__(self, named: Mapping[str, Mapping[str, Any]]) -> None:
        """Copies the settings.

        Args:
            named: Entry planner_configs of the pipeline parameters.
        """
        self._lock = threading.Lock()
        self._entries: dict[tuple[str, str], dict[str, Any]] = {
            ("", name): dict(entry or {}) for name, entry in named.items()
        }

    def names(self) -> tuple[str, ...]:
        """Returns the configuration names."""
        with self._lock:
            return tuple(dict.fromkeys(name for _, name in self._entries))

    def get(self, name: str, group: str = "") -> dict[str, Any]:
        """Returns a copy of the settings of a configuration; group settings override general settings."""
        with self._lock:
            return {**self._entries.get(("", name), {}), **(self._entries.get((group, name), {}) if group else {})}

    def snapshot(self) -> dict[tuple[str, str], dict[str, Any]]:
        """Returns a copy of all settings, for `restore` in a different process."""
        with self._lock:
            return {key: dict(entry) for key, entry in self._entries.items()}

    def restore(self, entries: Mapping[tuple[str, str], Mapping[str, Any]]) -> None:
        """Replaces all settings by a snapshot."""
        with self._lock:
            self._entries = {key: dict(entry) for key, entry in entries.items()}

    def set(self, name: str, group: str, values: Mapping[str, Any], replace: bool) -> None:
        """Changes settings.

        Args:
            name: Configuration name; a new name is added.
            group: Planning group; empty for all groups.
            values: New values, keyed by setting.
            replace: Whether to delete all other settings of the configuration.
        """
        with self._lock:
            old = {} if replace else self._entries.get((group, name), {})
            self._entries[group, name] = {**old, **values}


def resolve_configuration(
    configuration: Mapping[str, Any], groups: Mapping[str, Mapping[str, Any]], name: str, group: str
) -> tuple[str, dict[str, Any]]:
    """Returns the planner of a configuration, and its settings merged with the group's settings.

    Args:
        configuration: Settings of the configuration.
        groups: Settings of the pipeline, keyed by group.
        name: Name of the planner or configuration.
        group: Planning group.
    """
    planner_type = str(configuration.get("type", name)).removeprefix("geometric::").removesuffix("kConfigDefault")
    ignored_keys = ("planner_configs", "default_planner_config")
    group_settings = {key: value for key, value in groups.get(group, {}).items() if key not in ignored_keys}
    return planner_type, group_settings | {key: value for key, value in configuration.items() if key != "type"}


def without_group(planner_id: str) -> str:
    """Returns the planner id without its group, such as RRTConnect for arm[RRTConnect]."""
    return planner_id.split("[")[-1].rstrip("]") if planner_id.endswith("]") and "[" in planner_id else planner_id
