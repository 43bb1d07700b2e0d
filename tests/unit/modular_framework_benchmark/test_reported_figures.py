# SPDX-License-Identifier: BSD-3-Clause
"""Each figure is declared once: with its unit, its clock, and who measures it."""

from __future__ import annotations

import json
from collections.abc import Mapping

import pytest

from modular_framework_benchmark.commands.mode_runners import known_metrics
from modular_framework_benchmark.metrics.measurements import EpisodeMeasurements
from modular_framework_benchmark.metrics.recording_files import reports_of
from modular_framework_benchmark.metrics.registry import METRICS, measure
from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.records.episode_settings import EpisodeSettings
from modular_framework_benchmark.records.experiment import MetricKind
from modular_framework_benchmark.reports.tables import metric_title
from modular_framework_ros.reported_figures import CANDIDATES, FIGURES, Clock, Source, declared_figure


def recorded(component: str, figures: Mapping[str, float]) -> EpisodeMeasurements:
    """An episode as it is read back from its file."""
    entry = {
        "component": component, "name": "it", "succeeded": True, "reason": "", "started_s": 0.0, "ended_s": 1.0,
        "wall_begin": 0.0, "wall_s": 1.0, "figures": figures, "motion": None,
    }  # fmt: skip
    recording = json.loads(json.dumps({"reports": [entry]}))
    return EpisodeMeasurements(EpisodeSettings(), EpisodeStatus.SUCCEEDED, reports=reports_of(recording))


def test_a_declared_figure_of_a_recording_is_what_its_metric_measures() -> None:
    episode = recorded("generation", {"candidates": 12.0, "checked": 8.0, "reachable": 2.0})

    assert measure(["candidates", "reachable_share"], episode).values == {"candidates": 12.0, "reachable_share": 0.25}


def test_a_figure_of_a_component_of_a_users_own_is_kept_under_its_name() -> None:
    episode = recorded("my_camera", {"points": 512.0, "candidates": 3.0})

    assert episode.values_of(declared_figure("my_camera", "points")) == [512.0]
    assert episode.values_of(CANDIDATES) == []
    assert declared_figure("my_camera", "points").source is Source.SAID


@pytest.mark.parametrize("figure", FIGURES.values(), ids=lambda figure: figure.name)
def test_a_figure_has_its_unit_as_suffix_and_a_clock_if_it_is_a_duration(figure) -> None:  # type: ignore[no-untyped-def]
    assert figure.description.endswith(".")
    assert not figure.unit or figure.name.endswith(f"_{figure.unit}")
    assert (figure.clock is not None) is (figure.unit == "s")


@pytest.mark.parametrize("name", METRICS)
def test_each_duration_says_its_clock_and_nothing_else_has_one(name: str) -> None:
    metric = METRICS[name].metric

    assert (metric.clock is not None) is (metric.kind is MetricKind.TIME)


def test_a_title_shows_the_clock_and_what_only_the_method_says() -> None:
    assert "[s, simulated time]" in metric_title(METRICS["task_time"].metric)
    assert "[s, real time]" in metric_title(METRICS["task_wall_time"].metric)
    assert "[said by the method]" in metric_title(METRICS["candidates"].metric)


def test_a_mode_without_simulation_counts_itself_what_a_method_says_in_an_episode() -> None:
    known = known_metrics()

    assert known["task"]["candidates"].source is Source.SAID
    assert known["grasps"]["candidates"].source is Source.MEASURED
    assert known["planning"]["planning_time"].clock is Clock.WALL


def test_an_experiment_with_tasks_knows_the_metrics_of_policies_and_what_only_the_policy_says() -> None:
    known = known_metrics()
    assert known["task"]["policy_method_time"].source is Source.SAID
    assert known["task"]["policy_late_answers"].source is Source.MEASURED
    assert "policy_actions" not in known["planning"]
