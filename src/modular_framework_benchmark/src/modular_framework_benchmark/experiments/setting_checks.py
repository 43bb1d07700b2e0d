# SPDX-License-Identifier: BSD-3-Clause
"""What a mode finds out about the settings of a combination of levels before any episode runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class SettingFault:
    """What is wrong with a setting.

    Attributes:
        keys: Keys that lead to its value in the experiment file, outermost first.
        text: A sentence.
    """

    keys: tuple[str, ...]
    text: str


@dataclass(frozen=True, slots=True)
class CheckedSettings:
    """Settings whose names were looked up.

    Attributes:
        faults: What is wrong with them.
        resolved: What runs, as JSON values; equal for settings that run the same.
        substitutions: What will run in place of what is named where requests need it, known beforehand.
    """

    faults: tuple[SettingFault, ...]
    resolved: Any
    substitutions: tuple[str, ...] = ()


SettingsCheck = Callable[[Mapping[str, Any]], CheckedSettings]
"""Looks up the names in the settings of a combination; keys whose values cannot be read are missing."""
