# SPDX-License-Identifier: BSD-3-Clause
"""Checks how the states of a machine are linked: transitions, outcome maps, reachability, userdata."""

from __future__ import annotations

from collections.abc import Container, Iterable
from collections.abc import Mapping as MappingABC
from dataclasses import dataclass

from modular_framework_core.files.faults import FaultList, SourceLocation, closest
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, kind_of


@dataclass(frozen=True, slots=True)
class ChildLinks:
    """Links of a child as they are written in the task.

    Attributes:
        label: The child's name.
        outcomes: What it may end with; None when that could not be found out.
        transitions: Outcome -> target; None when they could not be read.
        keys: Location of each key of ``transitions``.
        location: Where the child is defined.
    """

    label: str
    outcomes: tuple[str, ...] | None
    transitions: dict[str, Scalar] | None
    keys: dict[str, SourceLocation]
    location: SourceLocation


def check_sequential(
    children: list[ChildLinks],
    labels: list[str],
    first: list[str],
    outcomes: tuple[str, ...] | None,
    location: SourceLocation,
    faults: FaultList,
) -> None:
    """Checks the transitions of the children of a state machine.

    Args:
        children: The children that could be read.
        labels: The labels of all children as written, those that could not be read or that repeat one included.
        first: The label the machine begins with, in a list; empty when there is none.
        outcomes: Outcomes of the machine; None when they could not be read, which leaves targets unchecked.
        location: Where the outcomes are declared.
        faults: Where faults are noted.
    """
    targets = list(dict.fromkeys([*labels, *(outcomes or ())]))
    for child in children:
        transitions = child.transitions or {}
        for outcome, target in transitions.items():
            if child.outcomes is not None and outcome not in child.outcomes:
                faults.add_unknown(
                    child.keys[outcome], f"state '{child.label}': outcome", outcome, child.outcomes, given=transitions
                )
            if outcomes is not None and target.value not in targets:
                what = f"state '{child.label}': transition target"
                faults.add_unknown(target.location, what, str(target.value), targets)
        if child.transitions is None or outcomes is None:
            continue
        missing = [name for name in child.outcomes or () if name not in transitions and name not in outcomes]
        if missing:
            faults.add(
                child.location,
                f"state '{child.label}': no transition for {', '.join(map(repr, missing))}; "
                f"add it to transitions, leading to one of: {', '.join(targets)}",
            )
    if outcomes is not None and labels:
        _check_reachability(children, labels, first, outcomes, location, faults)


def _check_reachability(
    children: list[ChildLinks],
    labels: list[str],
    first: list[str],
    outcomes: tuple[str, ...],
    location: SourceLocation,
    faults: FaultList,
) -> None:
    """Notes states no transition leads to, states that lead to no outcome, and outcomes nothing leads to.

    What is wrong with a transition is noted by others: here a misspelt target counts as the nearest one, and what
    cannot be known may lead anywhere, so that nothing is noted that is right once that other fault is corrected.
    """
    anywhere = {*labels, *outcomes}
    leads_to = {label: anywhere for label in labels}
    for child in children:
        if labels.count(child.label) == 1:
            leads_to[child.label] = _targets(child, outcomes, anywhere)
    reached = _closure(leads_to, first)
    backwards: dict[str, set[str]] = {}
    for label, targets in leads_to.items():
        for target in targets:
            backwards.setdefault(target, set()).add(label)
    can_end = _closure(backwards, outcomes)
    for child in children:
        if child.label not in reached:
            faults.add(
                child.location,
                f"state '{child.label}' is never reached: no transition leads to it; lead one to it, or remove it",
            )
        elif child.label not in can_end:
            circle = ", ".join(sorted(_closure(leads_to, [child.label])))
            faults.add(
                child.location,
                f"state '{child.label}' has no way out: from it the machine only gets to "
                f"{circle}, never to an outcome; lead one of them to: {', '.join(outcomes)}",
            )
    check_outcomes_produced(outcomes, set().union(*leads_to.values()), location, faults)


def _targets(child: ChildLinks, outcomes: tuple[str, ...], anywhere: set[str]) -> set[str]:
    """Returns what a child leads to; an outcome of the machine's own that has no transition leads there by its name."""
    if child.transitions is None or child.outcomes is None:
        return anywhere
    unlinked = {name for name in child.outcomes if name not in child.transitions}
    if not unlinked <= set(outcomes):
        return anywhere
    meant = unlinked
    for target in child.transitions.values():
        name = str(target.value)
        likely = name if name in anywhere else closest(name, sorted(anywhere))
        if likely is None:
            return anywhere
        meant.add(likely)
    return meant


def _closure(leads_to: MappingABC[str, set[str]], start: Iterable[str]) -> set[str]:
    """Returns all names that can be reached from some names, themselves included."""
    reached: set[str] = set()
    waiting = list(start)
    while waiting:
        label = waiting.pop()
        if label not in reached:
            reached.add(label)
            waiting.extend(leads_to.get(label, ()))
    return reached


def check_outcomes_produced(
    outcomes: tuple[str, ...], produced: Container[str | None], location: SourceLocation, faults: FaultList
) -> None:
    """Notes outcomes nothing leads to; ``preempted`` is what a machine ends with when it is stopped."""
    for outcome in outcomes:
        if outcome not in produced and outcome != "preempted":
            faults.add(
                location,
                f"the outcome '{outcome}' is never produced: nothing leads to it; remove it, or let a "
                "transition (in a concurrent machine: an entry of outcome_map) lead to it",
            )


def check_concurrent(children: list[ChildLinks], faults: FaultList) -> None:
    """Checks that the children of a concurrent machine have no transitions, which would have no effect."""
    for child in children:
        if child.transitions:
            location = next(iter(child.keys.values()))
            faults.add(
                location,
                f"state '{child.label}' has transitions, but it runs in a concurrent machine, where states end "
                "together; remove them and use outcome_map of the machine",
            )


def check_outcome_map(
    node: Node, outcomes: tuple[str, ...], children: list[ChildLinks], faults: FaultList
) -> dict[str, dict[str, str]]:
    """Returns the outcome map of a concurrent machine; notes what it names that is not there."""
    if not isinstance(node, Mapping):
        faults.add(node.location, f"outcome_map must be {{outcome: {{State: outcome of it}}}}, found {kind_of(node)}")
        return {}
    by_label = {child.label: child for child in children}
    result: dict[str, dict[str, str]] = {}
    for outcome, conditions in node.entries.items():
        if outcome not in outcomes:
            faults.add_unknown(node.keys[outcome], "outcome_map: outcome", outcome, outcomes, given=node.entries)
        if not isinstance(conditions, Mapping):
            faults.add(
                conditions.location,
                f"outcome_map: '{outcome}' must be {{State: outcome of it}}, found {kind_of(conditions)}",
            )
            continue
        result[outcome] = {}
        for label, wanted in conditions.entries.items():
            value = wanted.plain()
            child = by_label.get(label)
            if child is None:
                faults.add_unknown(
                    conditions.keys[label], "outcome_map: state", label, by_label, given=conditions.entries
                )
            elif not isinstance(value, str):
                faults.add(
                    wanted.location, f"outcome_map: outcome of '{label}' must be a name, found {kind_of(wanted)}"
                )
            elif child.outcomes is not None and value not in child.outcomes:
                faults.add_unknown(wanted.location, f"outcome_map: outcome of '{label}'", value, child.outcomes)
            result[outcome][label] = str(value)
    return result
