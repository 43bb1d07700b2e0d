# SPDX-License-Identifier: BSD-3-Clause
"""Contradictions within a predicate and between milestones, found before any episode runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

from modular_framework_benchmark.predicates.conditions import (
    Cleared,
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
    needed = list(dict.fromkeys(_needed(predicate)))
    for one in needed:
        names = one.names if isinstance(one, Condition) else ()
        if len(set(names)) < len(names):
            return f"{_words(one)} names '{max(names, key=names.count)}' twice"
    for one, other in combinations(needed, 2):
        if _excludes(one, other) or _excludes(other, one):
            return f"{_words(one)}, but {_words(other)}"
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


def _needed(predicate: Predicate) -> Iterator[Predicate]:
    """Yields the conditions and negations that must hold together for a predicate to hold."""
    match predicate:
        case All():
            for part in predicate.parts:
                yield from _needed(part)
        case Stacked():
            yield predicate
            yield from predicate.pairs
        case Condition() | Not():
            yield predicate


def _words(predicate: Predicate) -> str:
    statements = " and ".join(condition.statement for condition in predicate.conditions)
    return f"not: {statements}" if isinstance(predicate, Not) else statements


def _excludes(one: Predicate, other: Predicate) -> bool:
    """Returns whether one statement makes another impossible; checked in both orders by the caller."""
    match one, other:
        case Condition(), Not(part=Condition() as part):
            return _implies(one, part)
        case InRegion(), InRegion():
            return one.object == other.object and one.region.is_apart_from(other.region)
        case InRegion(), Cleared():
            return one.object in other.objects and one.region == other.region
        case Lifted(), NotMoved():
            return one.object == other.object and one.height >= other.distance
        case HeldFor(), NoContact():
            return one.object == other.object and other.other == ROBOT
        case OnTopOf(), NoContact():
            return {one.object, one.support} == {other.object, other.other}
        case OnTopOf(), OnTopOf():
            return (one.object, one.support) == (other.support, other.object)
        case Inside(), Inside():
            return (one.object, one.container) == (other.container, other.object)
    return False


def _implies(one: Predicate, other: Predicate) -> bool:
    """Returns whether a predicate holds whenever another predicate of the same kind holds, or is the same."""
    if type(one) is not type(other):
        return False
    match one, other:
        case (Lifted(), Lifted()) if one.height >= other.height and one.duration >= other.duration:
            return replace(one, height=other.height, duration=other.duration) == other
        case (JointAtLeast(), JointAtLeast()) if one.position >= other.position and one.duration >= other.duration:
            return replace(one, position=other.position, duration=other.duration) == other
        case (Condition(), Condition()) if one.duration >= other.duration:
            return replace(one, duration=other.duration) == other
    return one == other
