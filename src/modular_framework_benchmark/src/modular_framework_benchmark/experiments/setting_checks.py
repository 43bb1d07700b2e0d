# SPDX-License-Identifier: BSD-3-Clause
"""Result of a mode's check of the settings of a combination, before any episode runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class SettingFault:
    """A fault of a setting.

    Attributes:
        keys: Keys that lead to the value in the experiment file, outermost first.
        text: Description of the fault.
    """

    keys: tuple[str, ...]
    text: str


@dataclass(frozen=True, slots=True)
class CheckedSettings:
    """Settings with resolved names.

    Attributes:
        faults: Faults of the settings.
        resolved: Description of the execution as JSON values; equal if the settings execute the same.
        substitutions: Substitutions of named planners and solvers, known in advance.
    """

    faults: tuple[SettingFault, ...]
    resolved: Any
    substitutions: tuple[str, ...] = ()


SettingsCheck = Callable[[Mapping[str, Any]], CheckedSettings]
"""Check that resolves the names in the settings of a combination, which lack keys with unreadable values."""
