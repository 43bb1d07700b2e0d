# SPDX-License-Identifier: BSD-3-Clause
"""Modes of experiments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from modular_framework_benchmark.experiments.grasps_mode import GRASPS
from modular_framework_benchmark.experiments.kinematics_mode import KINEMATICS
from modular_framework_benchmark.experiments.mode import Mode
from modular_framework_benchmark.experiments.planning_mode import PLANNING
from modular_framework_benchmark.experiments.task_mode import TASK
from modular_framework_benchmark.records.episode_settings import EpisodeSettings, from_json

MODES: Mapping[str, Mode] = {mode.name: mode for mode in (TASK, PLANNING, KINEMATICS, GRASPS)}


def stored_settings(mode: str, content: Mapping[str, Any]) -> EpisodeSettings:
    """Returns the settings of a stored episode; for an unknown mode, only the settings that all modes have.

    Args:
        mode: Name of the mode.
        content: JSON values.
    """
    return from_json(MODES[mode].settings if mode in MODES else EpisodeSettings, content)
