# SPDX-License-Identifier: BSD-3-Clause
"""Contradictions within a predicate and between milestones, found before any episode runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

from modular_framework_benchmark.predicates.conditions import (
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
    Stacked,
)
from modular_framework_benchmark.predicates.predicate import All, Condition, Not, Predicate
from modular_framework_benchmark.predicates.progress import Milestone
from modular_framework_benchmark.predicates.world_track import ROBOT


def contradiction(predicate: Predicate) -> str:
    """Returns two statements that cannot hold at the same time although the predicate needs both; "" for none."""
    required = list(dict.fromkeys(_required_statements(predicate)))
    for first in required:
        names = first.names if isinstance(first, Condition) else ()
        if len(set(names)) < len(names):
            return f"{_statement_text(first)} names '{max(names, key=names.count)}' twice"
    for first, second in combinations(required, 2):
        if _excludes(first, second) or _excludes(second, first):
            return f"{_statement_text(first)}, but {_statement_text(second)}"
    return ""


def repetition(milestones: Sequence[Milestone]) -> tuple[int, str]:
    """Returns the index of a milestone that is always reached together with the previous milestone, and its name.

    Args:
        milestones: Milestones in their order.

    Returns:
        Index of the later milestone and name of the previous milestone; (-1, "") for none.
    """
    for later, (before, after) in enumerate(zip(milestones, milestones[1:], strict=False), 1):
        if _implies(before.predicate, after.predicate):
            return later, before.name
    return -1, ""


def _required_statements(predicate: Predicate) -> Iterator[Predicate]:
    """Yields the conditions and negations that must hold together for a predicate to hold."""
    match predicate:
        case All():
            for part in predicate.parts:
                yield from _required_statements(part)
        case Stacked():
            yield predicate
            yield from predicate.pairs
        case Condition() | Not():
            yield predicate


def _statement_text(predicate: Predicate) -> str:
    statements = " and ".join(condition.statement for condition in predicate.conditions)
    return f"not: {statements}" if isinstance(predicate, Not) else statements


def _excludes(first: Predicate, second: Predicate) -> bool:
    """Returns whether one statement makes another impossible; checked in both orders by the caller."""
    match first, second:
        case Condition(), Not(part=Condition() as part):
            return _implies(first, part)
        case InRegion(), InRegion():
            return first.object == second.object and first.region.is_apart_from(second.region)
        case InRegion(), Cleared():
            return first.object in second.objects and first.region == second.region
        case Collected(), Cleared():
            return set(first.objects) <= set(second.objects) and first.region == second.region
        case Lifted(), NotMoved():
            return first.object == second.object and first.height >= second.distance
        case HeldFor(), NoContact():
            return first.object == second.object and second.other == ROBOT
        case OnTopOf(), NoContact():
            return {first.object, first.support} == {second.object, second.other}
        case OnTopOf(), OnTopOf():
            return (first.object, first.support) == (second.support, second.object)
        case Inside(), Inside():
            return (first.object, first.container) == (second.container, second.object)
    return False


def _implies(first: Predicate, second: Predicate) -> bool:
    """Returns whether a predicate holds whenever another predicate of the same kind holds, or is the same."""
    if type(first) is not type(second):
        return False
    match first, second:
        case (Lifted(), Lifted()) if first.height >= second.height and first.duration >= second.duration:
            return replace(first, height=second.height, duration=second.duration) == second
        case (Collected(), Collected()) if first.wanted >= second.wanted and first.duration >= second.duration:
            return replace(first, count=second.count, duration=second.duration) == second
        case (JointAtLeast(), JointAtLeast()) if (
            first.position >= second.position and first.duration >= second.duration
        ):
            return replace(first, position=second.position, duration=second.duration) == second
        case (Condition(), Condition()) if first.duration >= second.duration:
            return replace(first, duration=second.duration) == second
    return first == second
