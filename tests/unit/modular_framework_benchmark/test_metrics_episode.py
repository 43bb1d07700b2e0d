# SPDX-License-Identifier: BSD-3-Clause
"""Metrics of an episode whose values are known, and a user's own metric."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from modular_framework_benchmark.metrics.measurements import (
    ComponentReport,
    EpisodeMeasurements,
    JointSamples,
    Motion,
    ObjectTrack,
    Shake,
    TrackingSamples,
)
from modular_framework_benchmark.metrics.registry import METRICS, MetricError, find_metric, load_metric, measure
from modular_framework_benchmark.records.episode import EpisodeStatus, Span
from modular_framework_benchmark.records.episode_settings import EpisodeSettings, OwnMetric
from modular_framework_ros.reported_figures import CANDIDATES, CHECKED, PLANNING_TIME, REACHABLE, declared_figure

JOINTS = ("pan", "lift")
TIMES = np.linspace(0.0, 4.0, 401)


def planned(succeeded: bool, planning_time_s: float, length: float = 1.0, **figures: float) -> ComponentReport:
    motion = Motion(JOINTS, np.array([0.0, 1.0, 2.0]), np.array([[0, 0], [length, 0], [length, length]], dtype=float))
    return ComponentReport(
        *("planning", "to_grasp", succeeded, "" if succeeded else "no path", 0.0, 0.0),
        wall_s=planning_time_s,
        figures={PLANNING_TIME: planning_time_s}
        | {declared_figure("planning", name): value for name, value in figures.items()},
        motion=motion if succeeded else None,
    )


def turned_track(name: str, offset: tuple[float, float, float], drift_m: float = 0.0) -> ObjectTrack:
    """A body that turns about the world's z axis and goes up; an offset in its frame, which grows by a drift."""
    turns = Rotation.from_euler("z", TIMES[:, None])
    shift = np.array(offset) + drift_m * (TIMES / TIMES[-1])[:, None] * np.array([0.0, 1.0, 0.0])
    return ObjectTrack(
        name, TIMES, turns.apply(shift) + 0.09 * TIMES[:, None] * np.array([0.0, 0.0, 1.0]), turns.as_quat()
    )


def episode(status: EpisodeStatus = EpisodeStatus.SUCCEEDED) -> EpisodeMeasurements:
    positions = np.column_stack([TIMES, np.zeros_like(TIMES)])
    efforts = np.zeros((len(TIMES), 2))
    efforts[5, 1] = -7.0
    blank = np.full((len(TIMES), 2), np.nan)
    moving = (TIMES >= 1.0) & (TIMES <= 3.0)
    desired = positions + np.where(moving, 0.01, 5.0)[:, None] * np.array([1.0, -1.0])
    return EpisodeMeasurements(
        settings=EpisodeSettings(),
        status=status,
        states=(
            Span("state", "A", 0.0, 1.0, "fail", failed=True, reason="because"),
            Span("state", "B", 1.0, 2.0, "success"),
        ),
        task_s=12.5,
        task_wall_s=13.5,
        generation_s=0.75,
        method_processor_s=6.5,
        reports=(
            ComponentReport(
                *("generation", "top_down", True, "", 0.0, 0.5),
                wall_s=0.25,
                figures={CANDIDATES: 40.0, CHECKED: 20.0, REACHABLE: 5.0},
            ),
            planned(True, 0.1, 1.0, clearance_m=0.03, processor_s=0.04, concurrent=2.0),
            planned(False, 5.0),
            planned(True, 0.3, 2.0, clearance_m=0.02, processor_s=0.08, concurrent=3.0),
            ComponentReport(
                "execution", "", True, "", 1.0, 3.0, wall_s=2.0, motion=Motion(("pan",), TIMES, positions[:, :1])
            ),
            ComponentReport("execution", "", False, "stopped", 3.5, 3.6, wall_s=0.1),
        ),
        joints=JointSamples(JOINTS, TIMES, positions, blank, efforts, blank),
        tracking=(TrackingSamples("arm", JOINTS, TIMES, desired, positions),),
        objects={"can": turned_track("can", (0.2, 0.0, 0.1), drift_m=0.004)},
        hand=turned_track("palm", (0.0, 0.0, 0.0)),
        target="can",
        task_started_s=0.5,
        held=True,
    )


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("success", 1.0),
        ("task_time", 12.5),
        ("task_wall_time", 13.5),
        ("failed_states", 1.0),
        ("generation_time", 0.75),
        ("method_processor_time", 6.5),
        ("generation_success", 1.0),
        ("candidates", 40.0),
        ("reachable_share", 0.25),
        ("planning_time", 1.8),
        ("planning_processor_time", 0.06),
        ("concurrent_plans", 3.0),
        ("planning_success", 2 / 3),
        ("path_length", 3.0),
        ("motion_duration", 2.0),
        ("clearance", 0.02),
        ("attempts", 3.0),
        ("execution_time", 2.0),
        ("execution_success", 0.5),
        ("tracking_error", 0.01),
        ("greatest_tracking_error", 0.01),
        ("executed_length", 2.0),
        ("greatest_effort", 7.0),
        ("lift", 0.315),
        ("slip", 0.004 * (4.0 - 0.56) / 4.0),
        ("grasp_time", 0.06),
        ("hold_time", None),
    ],
)
def test_each_metric_of_a_known_episode_has_its_value(name: str, value: float | None) -> None:
    assert METRICS[name].measure(episode()) == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize(("drift_m", "held_s"), [(0.004, 2.0), (0.121, 1.0)])
def test_an_object_is_held_until_it_has_moved_by_3_cm_in_the_hand(drift_m: float, held_s: float) -> None:
    moved = turned_track("can", (0.2, 0.0, 0.1), drift_m)
    shaken = replace(episode(), objects={"can": moved}, shake=Shake(1.0, 2.0))
    assert METRICS["hold_time"].measure(shaken) == pytest.approx(held_s, abs=1e-9)
    assert METRICS["slip"].measure(shaken) == pytest.approx(drift_m * (1.0 - 0.56) / 4.0, abs=1e-9)


def policy_run(**figures: float) -> ComponentReport:
    return ComponentReport(
        *("policy", "run_policy", True, "", 1.0, 3.0),
        wall_s=2.0,
        figures={declared_figure("policy", name): value for name, value in figures.items()},
    )


def test_the_metrics_of_a_policy_cover_all_its_runs_and_its_times_are_means_per_query() -> None:
    counts = {"queries": 3.0, "chunks": 2.0, "actions": 16.0, "late_answers": 1.0, "clipped_actions": 5.0}
    times = {"method_time_s": 0.6, "queue_time_s": 0.03, "transport_time_s": 0.06}
    again = policy_run(queries=1.0, chunks=1.0, actions=8.0, method_time_s=0.2, clipped_actions=0.0)
    not_started = policy_run(method_fault=1.0)
    runs = replace(episode(), reports=(policy_run(**counts, **times), again, not_started))
    names = [name for name, entry in METRICS.items() if entry.metric.component == "policy"]
    assert measure(names, runs).values == pytest.approx(
        {
            "policy_method_time": 0.2,
            "policy_queue_time": 0.0075,
            "policy_transport_time": 0.015,
            "policy_late_answers": 1.0,
            "policy_chunks": 3.0,
            "policy_actions": 24.0,
            "policy_clipped_actions": 5.0,
        }
    )
    unanswered = replace(episode(), reports=(policy_run(queries=0.0, actions=0.0),))
    measured = measure(["policy_method_time", "policy_actions"], unanswered)
    assert measured.values == {"policy_method_time": None, "policy_actions": 0.0}


def test_an_object_that_stays_on_its_support_has_no_slip_and_no_grasp_time() -> None:
    standing = ObjectTrack("can", TIMES, np.zeros((len(TIMES), 3)), np.tile([0.0, 0.0, 0.0, 1.0], (len(TIMES), 1)))
    measured = measure(["lift", "slip", "grasp_time"], replace(episode(), objects={"can": standing}))
    assert measured.values == {"lift": 0.0, "slip": None, "grasp_time": None}


def test_a_mean_has_the_same_bits_in_whatever_sequence_concurrent_plans_ended() -> None:
    reports = tuple(planned(True, length, length) for length in (0.1, 0.2, 0.3))
    there, back = (replace(episode(), reports=order) for order in (reports, reports[::-1]))
    assert (
        measure(["planning_time", "path_length"], there).values
        == measure(["planning_time", "path_length"], back).values
    )


def test_a_plan_that_was_made_to_see_whether_there_is_one_and_made_again_counts_once() -> None:
    thrown_away, executed = planned(True, 0.1, 1.0), planned(True, 0.1, 3.0)
    motion = ComponentReport("execution", "", True, "", 1.0, 3.0, wall_s=2.0, motion=executed.motion)
    measured = measure(
        ["path_length", "motion_duration", "planning_time"],
        replace(episode(), reports=(thrown_away, replace(executed, wall_s=0.3), motion)),
    )
    assert measured.values == {"path_length": 6.0, "motion_duration": 2.0, "planning_time": 0.1}


def test_what_was_not_recorded_has_no_value_and_no_metric_raises() -> None:
    nothing = EpisodeMeasurements(settings=EpisodeSettings(), status=EpisodeStatus.BROKEN)
    measured = measure(METRICS, nothing)
    assert measured.faults == {}
    assert all(value is None for value in measured.values.values()), measured.values


def test_a_failed_episode_has_no_task_time_and_counts_as_no_success() -> None:
    failed = measure(["success", "task_time"], episode(EpisodeStatus.FAILED))
    assert failed.values == {"success": 0.0, "task_time": None}


def test_every_metric_says_in_its_first_line_what_it_is_and_has_a_unit_or_none() -> None:
    for name, entry in METRICS.items():
        assert entry.metric.name == name == entry.measure.__name__
        assert entry.metric.description.endswith((".", ";")) or "[" in entry.metric.description or ":" in name, name
        assert len(entry.metric.description) > 20, name


def test_an_unknown_metric_is_named_with_the_nearest_one() -> None:
    with pytest.raises(MetricError, match="no metric 'sucess'.*did you mean 'success'"):
        find_metric("sucess")


def test_a_users_metric_is_one_function_in_one_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text("def height(episode):\n    return episode.objects['can'].positions[-1, 2]\n")
    measured = measure([OwnMetric("height", f"{file}:height"), OwnMetric("z", f"{file}:height")], episode())
    assert measured.values == pytest.approx({"height": 0.46, "z": 0.46})


def test_a_users_metric_that_raises_costs_its_own_value_only(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text("def bad(episode):\n    return episode.nothing\n")
    measured = measure([OwnMetric("bad", f"{file}:bad"), "task_time"], episode())
    assert measured.values == {"bad": None, "task_time": 12.5}
    assert "AttributeError" in measured.faults["bad"]


@pytest.mark.parametrize(
    ("text", "reference", "message"),
    [
        ("def a(e): pass\n", "mine.py:b", "has no function 'b'; it has a"),
        ("import nothing_at_all\n", "mine.py:b", "cannot be imported: ModuleNotFoundError"),
        ("", "other.py:b", "there is no file"),
        ("", "mine.txt:b", "does not have the form FILE.py:FUNCTION"),
    ],
)
def test_a_users_metric_that_cannot_be_loaded_is_explained(
    tmp_path: Path, text: str, reference: str, message: str
) -> None:
    (tmp_path / "mine.py").write_text(text)
    with pytest.raises(MetricError, match=message):
        load_metric(str(tmp_path / reference))


def test_a_value_that_is_no_number_is_a_fault(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text("def text(episode):\n    return 'much'\n")
    assert "ValueError" in measure([OwnMetric("text", f"{file}:text")], episode()).faults["text"]
    assert math.isfinite(measure(["lift"], episode()).values["lift"] or math.nan)


@pytest.mark.parametrize(
    ("metric", "value", "fault"),
    [
        ({"lowest": 0.0, "highest": 1.0}, 87.0, "the value is 87; allowed: 0 to 1"),
        ({"lowest": 0.0}, -1.0, "the value is -1; allowed: 0 to inf"),
        ({"is_rate": True}, 0.5, "the value of the rate is 0.5; allowed: 0 or 1"),
    ],
)
def test_a_value_outside_the_bounds_of_a_users_metric_is_a_fault(
    tmp_path: Path, metric: dict[str, float], value: float, fault: str
) -> None:
    file = tmp_path / "mine.py"
    file.write_text(f"def mine(episode):\n    return {value}\n")
    measured = measure([OwnMetric("mine", f"{file}:mine", **metric)], episode())  # type: ignore[arg-type]
    assert measured.values == {"mine": None}
    assert fault in measured.faults["mine"]


def test_rounding_at_a_bound_of_a_users_metric_is_corrected(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text("def mine(episode):\n    return 1.0 + 2.0**-52\n")
    measured = measure([OwnMetric("mine", f"{file}:mine", lowest=0.0, highest=1.0)], episode())
    assert (measured.values, measured.faults) == ({"mine": 1.0}, {})
