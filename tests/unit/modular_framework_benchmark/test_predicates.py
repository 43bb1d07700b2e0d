# SPDX-License-Identifier: BSD-3-Clause
"""Predicates hold where the world says so, for as long as they are asked for, and say what was found otherwise."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import Any

import pytest
from predicate_worlds import STANDING_M, sample, stage_of, state

from modular_framework_benchmark.episodes.episode_record import EpisodeEnd, make_record
from modular_framework_benchmark.episodes.snapshot import MachineLoad
from modular_framework_benchmark.experiments.success_criteria import SuccessCriteria
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.predicates.conditions import (
    Aligned,
    Cleared,
    Collected,
    HeldFor,
    InRegion,
    Inside,
    JointAtLeast,
    Lifted,
    NoContact,
    NotMoved,
    OnTopOf,
    Region,
    Stacked,
    Untouched,
    Upright,
)
from modular_framework_benchmark.predicates.contradictions import repetition
from modular_framework_benchmark.predicates.predicate import All, Condition, InOrder, Not, Predicate
from modular_framework_benchmark.predicates.predicate import Any as AnyOf
from modular_framework_benchmark.predicates.progress import Milestone, progress_of
from modular_framework_benchmark.predicates.stages import OperatorStage, SimulatedStage
from modular_framework_benchmark.records.episode import EpisodeSpec, EpisodeStatus

GOAL = Region(name="goal", x=(0.1, 0.3), y=(-0.1, 0.1))
START = {"table": state((0, 0, 0)), "cube": state((0, 0, STANDING_M)), "lid": state((0.3, 0.2, STANDING_M))}


def last(predicate: Predicate, states: dict[str, Any], *, contacts: Any = (), held: Any = ()) -> bool:
    """Whether a predicate holds in a world that was at START before."""
    stage = stage_of(sample(0.0, START, [], []), sample(1.0, states, [list(pair) for pair in contacts], list(held)))
    holds = bool(predicate.truth_over(stage)[-1])
    assert bool(predicate.unmet_reasons(stage)) is not holds
    return holds


@pytest.mark.parametrize(
    ("condition", "holds", "fails"),
    [
        (Lifted(object="cube", height=0.1), {"cube": state((0, 0, 0.9301))}, {"cube": state((0, 0, 0.9299))}),
        (InRegion(object="cube", region=GOAL), {"cube": state((0.3, 0.1, 5))}, {"cube": state((0.301, 0.1, 5))}),
        (
            Upright(object="cube", angle=0.2),
            {"cube": state((0, 0, 1), (0.19, 0, 3))},
            {"cube": state((0, 0, 1), (0.15, 0.15, 0))},
        ),
        (
            NotMoved(object="cube", distance=0.01),
            {"cube": state((0.01, 0, STANDING_M))},
            {"cube": state((0.0101, 0, STANDING_M))},
        ),
        (
            NotMoved(object="cube", angle=0.1),
            {"cube": state((0, 0, STANDING_M), (0, 0, 0.09))},
            {"cube": state((0, 0, STANDING_M), (0, 0, 0.11))},
        ),
        (Cleared(region=GOAL, objects=("cube", "lid")), {"lid": state((0.3, 0.2, 0))}, {"lid": state((0.2, 0, 0))}),
        (
            Collected(region=GOAL, objects=("cube", "lid")),
            {"cube": state((0.1, 0, 0)), "lid": state((0.2, 0, 0))},
            {"cube": state((0.1, 0, 0))},
        ),
        (
            Collected(region=GOAL, objects=("cube", "lid"), count=1),
            {"cube": state((0.1, 0, 0))},
            {"cube": state((0.1, 0.2, 0))},
        ),
        (
            Inside(object="cube", container="bin", tolerance=0.0),
            {"bin": state((1, 1, 0), (0, 0, 0.7)), "cube": state((1, 1, 0.031))},
            {"bin": state((1, 1, 0)), "cube": state((1.081, 1, 0.031))},
        ),
        (
            JointAtLeast(model="bin", joint="lid", position=0.3),
            {"bin": state((0, 0, 0), joints={"lid": 0.3})},
            {"bin": state((0, 0, 0), joints={"lid": 0.29})},
        ),
        (
            Aligned(object="cube", relative_to="lid", position=(0, 0, 0.06)),
            {"cube": state((0.3, 0.2, STANDING_M + 0.065))},
            {"cube": state((0.3, 0.2, STANDING_M))},
        ),
        (
            Aligned(object="cube", position=(0, 0, STANDING_M), rpy=(0, 0, 0.5)),
            {"cube": state((0, 0, STANDING_M), (0, 0, 0.45))},
            {},
        ),
        (
            Aligned(object="cube", position=(0, 0, STANDING_M), rpy=(0, 0, 0.5), angle=math.pi),
            {},
            {"cube": state((0, 0, 1))},
        ),
    ],
)
def test_a_condition_on_poses_holds_within_its_tolerance(
    condition: Condition, holds: dict[str, Any], fails: dict[str, Any]
) -> None:
    assert last(condition, holds)
    assert not last(condition, fails)


def test_an_object_above_the_region_counts_as_collected_once_it_is_released() -> None:
    collected, above = Collected(region=GOAL, objects=("cube", "lid"), count=1), {"cube": state((0.2, 0, 0))}
    assert last(collected, above, held=["lid"]) and not last(collected, above, held=["cube"])


def test_objects_that_were_not_collected_are_named() -> None:
    stage = stage_of(sample(0.0, START | {"cube": state((0.2, 0, 0))}, [], []))
    (reason,) = Collected(region=GOAL, objects=("cube", "lid", "table")).unmet_reasons(stage)
    assert reason == "1 of 3 objects are in the region 'goal' (wanted: at least 3; elsewhere: lid, table)"


def test_fewer_collected_objects_are_no_further_milestone() -> None:
    two, one = (
        Milestone(name=str(count), predicate=Collected(region=GOAL, objects=("cube", "lid"), count=count))
        for count in (2, 1)
    )
    assert repetition((two, one)) == (1, "2") and repetition((one, two)) == (-1, "")


def test_an_object_lies_on_what_it_touches_below_its_centre() -> None:
    on, touch = OnTopOf(object="cube", support="table"), [("cube", "table")]
    assert last(on, {}, contacts=touch)
    assert not last(on, {})  # no contact
    assert not last(on, {"cube": state((0, 0, STANDING_M + 0.02))}, contacts=touch)  # above it
    assert last(on, {"cube": state((0.499, 0, STANDING_M))}, contacts=touch)
    assert not last(on, {"cube": state((0.501, 0, STANDING_M))}, contacts=touch)  # beside its edge
    turned = {"table": state((0, 0, 0), (0, 0, math.pi / 2)), "cube": state((0.29, 0.49, STANDING_M))}
    assert last(on, turned, contacts=touch)
    assert not last(on, turned | {"cube": state((0.49, 0.29, STANDING_M))}, contacts=touch)


def test_a_stack_needs_every_pair() -> None:
    stack = Stacked(objects=("table", "cube", "lid"))
    states = {"lid": state((0, 0, STANDING_M + 0.06))}
    assert last(stack, states, contacts=[("cube", "table"), ("cube", "lid")])
    assert not last(stack, states, contacts=[("cube", "table")])


def test_contact_and_grasp_come_from_the_simulation() -> None:
    assert last(HeldFor(object="cube"), {}, held=["cube"]) and not last(HeldFor(object="cube"), {}, held=["lid"])
    assert last(NoContact(object="cube"), {}, contacts=[("arm", "lid"), ("cube", "table")])
    assert not last(NoContact(object="cube"), {}, contacts=[("arm", "cube")])
    assert not last(NoContact(object="cube", other="table"), {}, contacts=[("cube", "table")])


def test_an_object_stays_untouched_until_its_first_contact() -> None:
    contacts = [[], [["arm", "table"]], [["arm", "lid"]], []]
    stage = stage_of(*(sample(0.5 * index, {} if index else START, each, []) for index, each in enumerate(contacts)))
    lid, table = Untouched(object="lid"), Untouched(object="table")
    assert lid.truth_over(stage).tolist() == [True, True, False, False]
    assert lid.unmet_reasons(stage) == ("'lid' touched 'robot' 1.00 s after the start (wanted: no contact)",)
    assert table.truth_over(stage).tolist() == [True, False, False, False]
    assert Untouched(object="lid", other="table").truth_over(stage).all()


def test_a_condition_must_hold_for_its_duration_without_interruption() -> None:
    times_s = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]
    held = [["cube"], ["cube"], [], ["cube"], ["cube"], ["cube"]]
    samples = [
        sample(time_s, START if not time_s else {}, [], each) for time_s, each in zip(times_s, held, strict=True)
    ]
    stage = stage_of(*samples)
    assert HeldFor(object="cube").truth_over(stage).tolist() == [True, True, False, True, True, True]
    assert HeldFor(object="cube", duration=1.0).truth_over(stage).tolist() == [False] * 5 + [True]
    assert HeldFor(object="cube", duration=2.0).unmet_reasons(stage) == ("'cube' is in the gripper for less than 2 s",)


def test_combinations_hold_as_their_names_say() -> None:
    times = [(0.0, [], START), (1.0, ["cube"], {}), (2.0, ["cube"], {"cube": state((0, 0, 1))}), (3.0, [], {})]
    stage = stage_of(*(sample(time_s, states, [], held) for time_s, held, states in times))
    held, lifted = HeldFor(object="cube"), Lifted(object="cube", height=0.1)
    assert All((held, lifted)).truth_over(stage).tolist() == [False, False, True, False]
    assert AnyOf((held, lifted)).truth_over(stage).tolist() == [False, True, True, True]
    assert Not(held).truth_over(stage).tolist() == [True, False, False, True]
    assert InOrder((held, lifted, Not(held))).truth_over(stage).tolist() == [False, False, False, True]
    assert not InOrder((lifted, Not(lifted))).truth_over(stage).any()
    assert InOrder((Not(held), lifted, held)).truth_over(stage).tolist() == [False, False, True, True]
    assert All((held, lifted)).unmet_reasons(stage) == ("'cube' is not in the gripper",)
    assert Not(lifted).unmet_reasons(stage) == (
        "'cube' is more than 0.1 m higher than at the start, which must not hold",
    )


def test_a_model_that_is_not_in_the_world_satisfies_nothing() -> None:
    stage = stage_of(sample(0.0, START, [], []), sample(1.0, {"cube": None}))
    assert not NotMoved(object="cube").truth_over(stage)[-1] and not NoContact(object="cube").truth_over(stage)[-1]
    assert not Untouched(object="cube").truth_over(stage)[-1]
    assert Upright(object="cup").unmet_reasons(stage) == ("there is no 'cup' in the world",)


@pytest.mark.parametrize(
    ("predicate", "text"),
    [
        (JointAtLeast(model="bin", joint="lyd", position=0.1), "'bin' has no joint 'lyd'; allowed: lid; did you mean"),
        (Not(JointAtLeast(model="bin", joint="lyd", position=0.1)), "'bin' has no joint 'lyd'; allowed: lid"),
        (Not(JointAtLeast(model="cube", joint="lid", position=0.1)), "'cube' has no joint 'lid'"),
        (Not(Upright(object="cup")), "there is no 'cup' in the world"),
        (OnTopOf(object="cube", support="tabel"), "there is no 'tabel' in the world"),
        (JointAtLeast(model="bin", joint="lid", position=0.1), ""),
        (All((Upright(object="cube"), NoContact(object="cube"), Aligned(object="cube"))), ""),
    ],
)
def test_a_name_that_the_world_never_had_is_found(predicate: Predicate, text: str) -> None:
    opened = {"bin": state((0, 0, 0), joints={"lid": 0.3})}
    gone = sample(1.0, {"cube": None})  # a deleted model has existed
    stage = stage_of(sample(0.0, START | opened, [], []), gone)
    found = stage.unknown_name_text(predicate.conditions)
    assert found.startswith(text) and bool(found) == bool(text)


@pytest.mark.parametrize("status", [EpisodeStatus.SUCCEEDED, EpisodeStatus.FAILED, EpisodeStatus.TIMED_OUT])
@pytest.mark.parametrize(("joint", "is_invalid"), [("lyd", True), ("lid", False)])
def test_an_episode_with_an_unknown_joint_in_a_predicate_is_invalid_and_has_no_progress(
    status: EpisodeStatus, joint: str, is_invalid: bool, tmp_path: Path
) -> None:
    closed = Not(JointAtLeast(model="bin", joint=joint, position=0.1))
    world = {"samples": [sample(0.0, {"bin": state((0, 0, 0), joints={"lid": 0.3})})], "boxes": {}, "robots": []}
    (tmp_path / "world.json").write_text(json.dumps(world))
    for settings in (
        TaskSettings(success=SuccessCriteria(required=closed), metrics=("success", "progress")),
        TaskSettings(progress=(Milestone(name="closed", predicate=closed),), metrics=("success", "progress")),
    ):
        spec = EpisodeSpec(0, {}, 0, 1, settings)
        end = EpisodeEnd(spec, tmp_path, time.time(), time.monotonic(), MachineLoad.now())
        record = make_record(end.with_status(status, "", {"zero": 0.0, "task_started_s": 0.0}))
        assert record.status is (EpisodeStatus.INVALID if is_invalid else status)
        assert ("'bin' has no joint 'lyd'; allowed: lid; did you mean 'lid'?" in record.cause) is is_invalid
        assert not is_invalid or set(record.metrics.values()) == {None}


def test_the_task_begins_at_its_last_sample_and_what_was_before_does_not_count() -> None:
    stage = stage_of(
        sample(0.0, START | {"cube": state((0, 0, 1.5))}, [], ["cube"]),
        sample(1.0, {"cube": state((0, 0, STANDING_M))}, None, []),
        sample(2.0, {"cube": state((0, 0, STANDING_M + 0.2))}),
        started_s=1.01,
    )
    assert stage.times_s.tolist() == [1.0, 2.0]
    assert Lifted(object="cube").truth_over(stage).tolist() == [False, True]
    assert not HeldFor(object="cube").truth_over(stage).any()


STEPS = (
    Milestone(name="grasped", predicate=HeldFor(object="cube")),
    Milestone(name="lifted", predicate=Lifted(object="cube", height=0.1), weight=2.0),
    Milestone(name="placed", predicate=InRegion(object="cube", region=GOAL)),
)


def test_progress_counts_milestones_in_their_order_and_keeps_what_was_reached() -> None:
    times = [(0.0, [], START), (1.0, ["cube"], {}), (2.0, ["cube"], {"cube": state((0, 0, 1))}), (3.0, [], START)]
    stage = stage_of(*(sample(time_s, states, [], held) for time_s, held, states in times))
    progress = progress_of(STEPS, stage)
    assert progress.times_s == (1.0, 2.0) and progress.first_missed == "placed"
    assert progress.fraction == pytest.approx(3 / 4)
    backwards = progress_of(STEPS[::-1], stage)
    assert backwards.times_s == () and (backwards.fraction, backwards.first_missed) == (0.0, "placed")


def test_milestones_that_are_reached_at_the_same_moment_both_count() -> None:
    stage = stage_of(sample(0.0, START, [], []), sample(1.0, {"cube": state((0.2, 0, 1))}, None, ["cube"]))
    progress = progress_of(STEPS, stage)
    assert progress.times_s == (1.0, 1.0, 1.0) and (progress.fraction, progress.first_missed) == (1.0, "")


def test_an_operator_answers_the_same_predicates() -> None:
    answers = {
        0.0: {"'cube' is in the gripper": False},
        1.0: {"'cube' is in the gripper": True},
        2.0: {"'cube' is in the gripper": True, "'cube' is more than 0.1 m higher than at the start": True},
    }
    asked: list[str] = []
    now_s = 0.0

    def ask(statement: str) -> bool:
        asked.append(statement)
        return answers[now_s].get(statement, False)

    stage = OperatorStage(ask)
    for now_s in answers:
        stage.look(now_s, [step.predicate for step in STEPS])
    assert len(asked) == 9
    progress = progress_of(STEPS, stage)
    assert progress.times_s == (1.0, 2.0) and progress.first_missed == "placed"
    assert HeldFor(object="cube", duration=1.0).truth_over(stage).tolist() == [False, False, False]  # was not asked
    unmet = InRegion(object="cube", region=GOAL).unmet_reasons(stage)
    assert unmet == ("the operator denies that 'cube' is in the region 'goal'",)


def test_the_short_form_of_a_pick_is_made_of_the_same_predicates() -> None:
    pick = SuccessCriteria(lifted=0.2).predicate("cube")
    assert pick == All((Lifted(object="cube", height=0.2), HeldFor(object="cube")))
    stage = stage_of(sample(0.0, START, [], []), sample(1.0, {"cube": state((0, 0, STANDING_M + 0.1))}))
    assert pick.unmet_reasons(stage) == (
        "'cube' is 0.100 m higher (wanted: more than 0.2 m)",
        "'cube' is not in the gripper",
    )
    own = SuccessCriteria(required=Upright(object="cube"))
    assert own.predicate("cube") == All((Upright(object="cube"),)) and not own.is_pick


def test_a_stage_without_moments_has_reached_nothing() -> None:
    empty = OperatorStage(lambda _: True)
    assert Upright(object="cube").unmet_reasons(empty) and isinstance(stage_of(sample(0.0, START)), SimulatedStage)
