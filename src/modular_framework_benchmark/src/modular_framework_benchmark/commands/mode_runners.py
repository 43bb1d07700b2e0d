# SPDX-License-Identifier: BSD-3-Clause
"""Runners and metrics of each mode."""

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
"""MODULE:NAME of each mode's runner factory."""
COMPONENTS = {
    "task": {"task", "generation", "planning", "execution", "grasp"},
    "planning": {"planning"},
    "kinematics": {"kinematics"},
    "grasps": {"generation"},
}
"""Components whose metrics a mode measures, in addition to success."""


class RunnerError(Exception):
    """The runner of the episodes cannot be loaded; the message names the missing part."""


def known_metrics() -> dict[str, Mapping[str, Metric]]:
    """Returns the metrics of each mode by name; the modes without simulation measure all metrics themselves."""
    from modular_framework_benchmark.metrics.registry import METRICS  # not needed by `resume`

    return {
        mode: {
            name: known.metric if mode == "task" else dataclasses.replace(known.metric, source=Source.MEASURED)
            for name, known in METRICS.items()
            if name == "success" or known.metric.component in components
        }
        for mode, components in COMPONENTS.items()
    }


def runner_factory(mode: str, own: str = "") -> RunnerFactory:
    """Returns the runner factory of a mode.

    Args:
        mode: Mode of the experiment.
        own: MODULE:NAME of a user's factory; "" for the factory of the mode.

    Raises:
        RunnerError: The factory cannot be imported.
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
        raise RunnerError(f"the runner {reference} is not a class or function; correct --runner")
    return factory  # type: ignore[no-any-return]
