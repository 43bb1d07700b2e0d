# SPDX-License-Identifier: BSD-3-Clause
"""A failed episode has one class, from how it ended, what its components reported and what the world shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from predicate_worlds import STANDING_M, sample, stage_of, state

from mbf_method.errors import MethodFault
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.metrics.failure_classes import FailureClass, failure_class
from modular_framework_benchmark.metrics.measurements import ComponentReport, EpisodeMeasurements
from modular_framework_benchmark.predicates.conditions import NoContact, Untouched
from modular_framework_benchmark.predicates.world_track import WorldTrack
from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_ros.reported_figures import (
    CANDIDATES,
    ERROR_CODE,
    METHOD_FAULT,
    PLANNER_FAULT,
    POLICY_FAULT,
    REACHABLE,
    Figure,
)

FAILED = EpisodeMeasurements(TaskSettings(), EpisodeStatus.FAILED, target="cube")


def report(
    component: str, ended_s: float, succeeded: bool = True, figures: dict[Figure, float] | None = None
) -> ComponentReport:
    return ComponentReport(
        component, component, succeeded, "", ended_s - 0.4, ended_s, wall_s=0.4, figures=figures or {}
    )


def world(held_until_s: float | None, height_m: float = 0.0, end_s: float = 10.0) -> WorldTrack:
    """A cube that is held from 3 s on until some moment, at a height above its start, and then is on the table."""
    samples = [sample(0.0, {"cube": state((0, 0, STANDING_M))}, [], [])]
    if held_until_s is not None:
        samples.append(sample(3.0, {}, None, ["cube"]))
        samples.append(sample(held_until_s - 0.1, {"cube": state((0, 0, STANDING_M + height_m))}))
        samples.append(sample(held_until_s, {}))
        if held_until_s < end_s:
            samples.append(sample(held_until_s + 0.02, {"cube": state((0, 0, STANDING_M))}, None, []))
    return stage_of(*samples, sample(end_s)).world


@pytest.mark.parametrize(
    ("status", "expected"),
    [
        (EpisodeStatus.SUCCEEDED, None),
        (EpisodeStatus.TIMED_OUT, FailureClass.TIMEOUT),
        (EpisodeStatus.BROKEN, FailureClass.DIED),
        (EpisodeStatus.INVALID, FailureClass.INVALID),
    ],
)
def test_how_an_episode_ended_comes_first(status: EpisodeStatus, expected: FailureClass | None) -> None:
    reports = (report("planning", 2.0, succeeded=False),)
    assert failure_class(replace(FAILED, status=status, reports=reports), task_succeeded=False) is expected


@pytest.mark.parametrize(
    ("last", "expected"),
    [
        (report("generation", 2.0, figures={CANDIDATES: 0.0, REACHABLE: 0.0}), FailureClass.NO_CANDIDATE),
        (report("generation", 2.0, succeeded=False), FailureClass.NO_CANDIDATE),
        (report("generation", 2.0, figures={CANDIDATES: 24.0, REACHABLE: 0.0}), FailureClass.UNREACHABLE),
        (
            report("generation", 2.0, succeeded=False, figures={METHOD_FAULT: MethodFault.NOT_STARTED}),
            FailureClass.DIED,
        ),
        (report("generation", 2.0, succeeded=False, figures={METHOD_FAULT: MethodFault.DIED}), FailureClass.DIED),
        (report("generation", 2.0, succeeded=False, figures={METHOD_FAULT: MethodFault.LATE}), FailureClass.DIED),
        (report("generation", 2.0, False, {METHOD_FAULT: MethodFault.RAISED}), FailureClass.INVALID_OUTPUT),
        (report("generation", 2.0, False, {METHOD_FAULT: MethodFault.INVALID_RESULT}), FailureClass.INVALID_OUTPUT),
        (report("generation", 2.0, False, {METHOD_FAULT: MethodFault.TOO_LARGE}), FailureClass.INVALID_OUTPUT),
        (report("planning", 2.0, False, {PLANNER_FAULT: MethodFault.DIED}), FailureClass.DIED),
        (report("planning", 2.0, False, {PLANNER_FAULT: MethodFault.RAISED}), FailureClass.INVALID_OUTPUT),
        (report("policy", 2.0, False, {POLICY_FAULT: MethodFault.LATE}), FailureClass.DIED),
        (report("policy", 2.0, False, {POLICY_FAULT: MethodFault.INVALID_RESULT}), FailureClass.INVALID_OUTPUT),
        (report("policy", 2.0, succeeded=False), FailureClass.MOTION),
        (report("planning", 2.0, succeeded=False, figures={ERROR_CODE: -31.0}), FailureClass.UNREACHABLE),
        (report("planning", 2.0, succeeded=False, figures={ERROR_CODE: -1.0}), FailureClass.NO_PLAN),
        (report("execution", 2.0, succeeded=False), FailureClass.MOTION),
        (report("grasp", 2.0, succeeded=False), FailureClass.GRASP_MISSED),
    ],
)
def test_the_last_component_that_failed_decides_about_a_task_that_failed(
    last: ComponentReport, expected: FailureClass
) -> None:
    reports = (report("planning", 1.0, succeeded=False), last, report("execution", 3.0))
    for track in (None, world(None)):
        assert failure_class(replace(FAILED, reports=reports, world=track), task_succeeded=False) is expected


@pytest.mark.parametrize(
    ("contacts", "expected"),
    [
        ({("arm", "shelf"): (1.8, 2.0)}, FailureClass.COLLISION),
        ({("arm", "shelf"): (2.5, 3.0)}, FailureClass.MOTION),  # after the motion
        ({("arm", "pedestal"): (0.0, 3.0)}, FailureClass.MOTION),  # on which it stands
        ({("arm", "cube"): (1.8, 2.0)}, FailureClass.MOTION),  # the target
        ({("cube", "shelf"): (1.8, 2.0)}, FailureClass.MOTION),  # not the robot
    ],
)
def test_a_motion_that_was_not_completed_is_a_collision_if_the_robot_touched_something_else(
    contacts: dict[tuple[str, str], tuple[float, float]], expected: FailureClass
) -> None:
    track = world(None)
    times_s = np.linspace(0.0, 10.0, 101)
    flags = {frozenset(pair): (times_s >= low) & (times_s <= high) for pair, (low, high) in contacts.items()}
    track = replace(track, times_s=times_s, contacts=flags, robots=frozenset({"arm"}))
    reports = (report("execution", 2.0, succeeded=False),)  # from 1.6 s on
    assert failure_class(replace(FAILED, reports=reports, world=track), task_succeeded=False) is expected


@pytest.mark.parametrize(
    ("height_m", "expected"), [(0.0, FailureClass.SLIPPED), (0.04, FailureClass.SLIPPED), (0.06, FailureClass.DROPPED)]
)
def test_an_object_that_the_gripper_lost_slipped_or_was_dropped_whatever_failed_afterwards(
    height_m: float, expected: FailureClass
) -> None:
    reports = (report("grasp", 3.0), report("planning", 8.0, succeeded=False))
    lost = replace(FAILED, reports=reports, world=world(6.0, height_m))
    assert failure_class(lost, task_succeeded=False) is expected
    assert failure_class(lost, task_succeeded=True) is expected


def test_an_object_that_was_released_on_purpose_was_not_dropped() -> None:
    grasp, release = report("grasp", 3.0), report("grasp", 6.2)  # from 5.8 s on
    placed = replace(FAILED, reports=(grasp, release), world=world(6.0, 0.3))
    assert failure_class(placed, task_succeeded=True) is FailureClass.MISPLACED
    gave_up = replace(placed, reports=(grasp, report("planning", 5.0, succeeded=False), release))
    assert failure_class(gave_up, task_succeeded=False) is FailureClass.NO_PLAN


def test_any_object_that_the_gripper_lost_counts_not_only_the_first_one() -> None:
    second = replace(FAILED, target="another", reports=(report("grasp", 3.0),), world=world(6.0, 0.2))
    assert failure_class(second, task_succeeded=True) is FailureClass.DROPPED
    placed = replace(second, reports=(report("grasp", 3.0), report("grasp", 6.2)))
    assert failure_class(placed, task_succeeded=True) is FailureClass.MISPLACED


def test_a_task_that_failed_before_any_plan_had_no_candidate() -> None:
    assert failure_class(replace(FAILED, world=world(None)), task_succeeded=False) is FailureClass.NO_CANDIDATE


def test_what_the_world_shows_decides_about_a_task_that_claims_success() -> None:
    grasp = (report("grasp", 3.0),)
    assert failure_class(replace(FAILED, reports=grasp, world=world(None)), True) is FailureClass.GRASP_MISSED
    assert failure_class(replace(FAILED, reports=grasp, world=world(10.0)), True) is FailureClass.MISPLACED
    assert failure_class(replace(FAILED, world=world(None)), True) is FailureClass.MISPLACED  # it was pushed
    assert failure_class(replace(FAILED, reports=grasp, world=world(10.0)), False) is FailureClass.MISPLACED


def test_a_robot_that_touched_what_had_to_stay_untouched_collided() -> None:
    samples = [sample(0.0, {"cube": state((0, 0, STANDING_M)), "lid": state((1, 0, 0))}, [], [])]
    samples += [sample(3.0, {}, [["arm", "cube"]], ["cube"]), sample(4.0, {}, [["arm", "cube"], ["arm", "lid"]])]
    placed = replace(FAILED, reports=(report("grasp", 3.0),), world=stage_of(*samples, sample(5.0, {}, [])).world)
    assert failure_class(placed, True, (Untouched(object="lid"),)) is FailureClass.COLLISION
    assert failure_class(placed, True, (NoContact(object="lid"),)) is FailureClass.MISPLACED
    assert failure_class(placed, True, (Untouched(object="lid", other="table"),)) is FailureClass.MISPLACED
