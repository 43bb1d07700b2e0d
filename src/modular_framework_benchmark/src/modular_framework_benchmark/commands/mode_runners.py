# SPDX-License-Identifier: BSD-3-Clause
"""What runs the episodes of each mode, and what it can measure."""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Mapping
from typing import Any

from modular_framework_benchmark.records.experiment import Metric
from modular_framework_benchmark.scheduling.episode_runner import RunnerFactory
from modular_framework_ros.reported_figures import Source

_PACKAGE = "modular_framework_benchmark"
RUNNERS = {
    "task": f"{_PACKAGE}.episodes.ros_task_runner:TaskEpisodeRunner",
    "planning": f"{_PACKAGE}.modes.ros_planning_runner:PlanningEpisodeRunner",
    "kinematics": f"{_PACKAGE}.modes.ros_kinematics_runner:KinematicsEpisodeRunner",
    "grasps": f"{_PACKAGE}.modes.ros_grasp_runner:GraspEpisodeRunner",
}
"""MODULE:NAME of the factory of each mode's runner."""
COMPONENTS = {
    "task": {"task", "generation", "planning", "execution", "grasp"},
    "planning": {"planning"},
    "kinematics": {"kinematics"},
    "grasps": {"generation"},
}
"""The components whose metrics a mode has, beside success."""


class RunnerError(Exception):
    """There is nothing that runs the episodes; the message says what is missing."""


def known_metrics() -> dict[str, Mapping[str, Metric]]:
    """Returns the metrics of each mode, by name; a mode without simulation measures all of them itself."""
    from modular_framework_benchmark.metrics.registry import METRICS  # `resume` does without

    return {
        mode: {
            name: known.metric if mode == "task" else dataclasses.replace(known.metric, source=Source.MEASURED)
            for name, known in METRICS.items()
            if name == "success" or known.metric.component in components
        }
        for mode, components in COMPONENTS.items()
    }


def runner_factory(mode: str, own: str = "") -> RunnerFactory:
    """Returns what makes the runners of a mode.

    Args:
        mode: Of the experiment.
        own: MODULE:NAME of a factory of the user's own; empty for that of the mode.

    Raises:
        RunnerError: It cannot be imported.
    """
    reference = own or RUNNERS[mode]
    module, _, name = reference.partition(":")
    try:
        factory: Any = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise RunnerError(
            f"the runner {reference} of mode {mode} cannot be imported ({error}); build and source the workspace, or "
            "correct --runner"
        ) from error
    if not callable(factory):
        raise RunnerError(f"the runner {reference} is no class or function; correct --runner")
    return factory  # type: ignore[no-any-return]
