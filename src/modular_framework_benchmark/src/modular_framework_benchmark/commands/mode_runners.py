# SPDX-License-Identifier: BSD-3-Clause
"""Runners, checks and metrics of each mode."""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Mapping
from functools import partial
from typing import Any

from modular_framework_benchmark.experiments.mode import SettingsCheck
from modular_framework_benchmark.experiments.modes import MODES
from modular_framework_benchmark.experiments.task_mode import TASK
from modular_framework_benchmark.records.experiment import Metric
from modular_framework_benchmark.scheduling.episode_runner import RunnerFactory
from modular_framework_ros.reported_figures import Source


class RunnerError(Exception):
    """The runner of the episodes cannot be loaded; the message names the missing part."""


def known_metrics() -> dict[str, Mapping[str, Metric]]:
    """Returns the metrics of each mode by name; the modes without simulation measure all metrics themselves."""
    from modular_framework_benchmark.metrics.registry import METRICS  # not needed by `resume`

    return {
        mode.name: {
            name: metric.metric if mode is TASK else dataclasses.replace(metric.metric, source=Source.MEASURED)
            for name, metric in METRICS.items()
            if name == "success" or metric.metric.component in mode.components
        }
        for mode in MODES.values()
    }


def setting_checks() -> dict[str, SettingsCheck]:
    """Returns the checks of the settings, keyed by mode."""
    return {mode.name: partial(_load_object(mode.check), _load_object(mode.runner)()) for mode in MODES.values()}


def runner_factory(mode: str, own: str = "") -> RunnerFactory:
    """Returns the runner factory of a mode.

    Args:
        mode: Mode of the experiment.
        own: MODULE:NAME of a user's factory; "" for the factory of the mode.

    Raises:
        RunnerError: The factory cannot be imported.
    """
    reference = own or MODES[mode].runner
    try:
        factory = _load_object(reference)
    except (ImportError, AttributeError, ValueError) as error:
        raise RunnerError(
            f"the runner {reference} of mode {mode} cannot be imported ({error}); build and source the workspace, or "
            "correct --runner"
        ) from error
    if not callable(factory):
        raise RunnerError(f"the runner {reference} is not a class or function; correct --runner")
    return factory  # type: ignore[no-any-return]


def _load_object(reference: str) -> Any:
    """Returns the object that MODULE:NAME names."""
    module, _, name = reference.partition(":")
    return getattr(importlib.import_module(module), name)
