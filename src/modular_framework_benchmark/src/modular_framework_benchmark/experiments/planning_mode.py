# SPDX-License-Identifier: BSD-3-Clause
"""The mode `planning`: planners on motion planning problems, without simulation."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from modular_framework_benchmark.experiments.mode import (
    Mode,
    count,
    named_values,
    ros_parameters,
    setting,
)
from modular_framework_benchmark.experiments.problem_sets import NO_PROBLEM, Problem, read_problems
from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_benchmark.experiments.robot_setting import ModelSettings
from modular_framework_benchmark.records.episode_settings import as_json


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanningSettings(ModelSettings):
    """Settings of an episode of the mode `planning`.

    Attributes:
        problem: Problem to solve; the key `problems` names folders of problems.
        planner: Name of the planner; "" for the default of the pipeline.
        planner_parameters: Parameters of the planner, keyed by name.
        pipeline: Name of the planning pipeline.
        group: Planning group; "" for the group of the problem.
        planning_time: Time budget [s].
        attempts: Number of attempts within the budget.
        parameters: ROS parameters of the pipeline, keyed by full name.
    """

    problem: Problem = setting(read_problems, NO_PROBLEM, required=True, key="problems")
    planner: str = setting(Reading.optional_text, "")
    planner_parameters: Mapping[str, Any] = setting(named_values("{range: 0.5}"), {})
    pipeline: str = setting(Reading.optional_text, "ompl")
    group: str = setting(Reading.optional_text, "")
    planning_time: float = setting(Reading.seconds, 5.0)
    attempts: int = setting(count(1000), 1)
    parameters: Mapping[str, Any] = setting(ros_parameters, {})

    @property
    def budget_s(self) -> float | None:
        """Returns the time budget [s]."""
        return self.planning_time

    @property
    def drawn_problem(self) -> str:
        """Returns the problem as canonical JSON."""
        return json.dumps(as_json(self.problem), sort_keys=True)


PLANNING = Mode(
    "planning",
    PlanningSettings,
    "modular_framework_benchmark.modes.ros_planning_runner:PlanningEpisodeRunner",
    "modular_framework_benchmark.modes.ros_setting_checks:check_planning",
    frozenset({"planning"}),
)
