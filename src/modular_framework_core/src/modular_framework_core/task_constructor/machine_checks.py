# SPDX-License-Identifier: BSD-3-Clause
"""Checks the links between the states of a machine: transitions, outcome maps and reachability."""

from __future__ import annotations

from collections.abc import Container, Iterable
from collections.abc import Mapping as MappingABC
from dataclasses import dataclass

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, kind_of
from modular_framework_ros.allowed_names import closest


@dataclass(frozen=True, slots=True)
class ChildLinks:
    """Links of a child as written in the task.

    Attributes:
        label: Name of the child.
        outcomes: Outcomes of the child; None if unknown.
        transitions: Outcome -> target; None if unreadable.
        keys: Location of each key of ``transitions``.
        location: Position of the child's definition.
    """

    label: str
    outcomes: tuple[str, ...] | None
    transitions: dict[str, Scalar] | None
    keys: dict[str, SourceLocation]
    location: SourceLocation


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineLinks:
    """Links between the children of a sequential machine.

    Attributes:
        children: Readable children.
        labels: Labels of all children as written, including unreadable children and repeated labels.
        first: List with the label of the initial state, or an empty list.
        outcomes: Outcomes of the machine; None if unreadable.
        location: Position of the outcomes.
    """

    children: list[ChildLinks]
    labels: list[str]
    first: list[str]
    outcomes: tuple[str, ...] | None
    location: SourceLocation


def check_sequential(machine: MachineLinks, faults: FaultList) -> None:
    """Checks the transitions of a sequential machine; without readable outcomes, targets are not checked."""
    outcomes = machine.outcomes
    targets = list(dict.fromkeys([*machine.labels, *(outcomes or ())]))
    for child in machine.children:
        transitions = child.transitions or {}
        for outcome, target in transitions.items():
            if child.outcomes is not None and outcome not in child.outcomes:
                faults.add_unknown(
                    child.keys[outcome], f"state '{child.label}': outcome", outcome, child.outcomes, used=transitions
                )
            if outcomes is not None and target.value not in targets:
                noun = f"state '{child.label}': transition target"
                faults.add_unknown(target.location, noun, str(target.value), targets)
        if child.transitions is None or outcomes is None:
            continue
        missing = [name for name in child.outcomes or () if name not in transitions and name not in outcomes]
        if missing:
            faults.add(
                child.location,
                f"state '{child.label}': no transition for {', '.join(map(repr, missing))}; "
                f"add it to transitions, leading to one of: {', '.join(targets)}",
            )
    if outcomes is not None and machine.labels:
        _check_reachability(machine, outcomes, faults)


def _check_reachability(machine: MachineLinks, outcomes: tuple[str, ...], faults: FaultList) -> None:
    """Adds faults for unreachable states, states without a path to an outcome, and unreachable outcomes.

    Other checks report faulty transitions. To avoid follow-up faults, a misspelt target counts as the closest name
    here, and a child with unknown links may lead to any state or outcome.
    """
    anywhere = {*machine.labels, *outcomes}
    leads_to = {label: anywhere for label in machine.labels}
    for child in machine.children:
        if machine.labels.count(child.label) == 1:
            leads_to[child.label] = _targets(child, outcomes, anywhere)
    reachable = _closure(leads_to, machine.first)
    predecessors: dict[str, set[str]] = {}
    for label, targets in leads_to.items():
        for target in targets:
            predecessors.setdefault(target, set()).add(label)
    can_end = _closure(predecessors, outcomes)
    for child in machine.children:
        if child.label not in reachable:
            faults.add(
                child.location,
                f"state '{child.label}' is never reached; add a transition that leads to it, or remove the state",
            )
        elif child.label not in can_end:
            cycle = ", ".join(sorted(_closure(leads_to, [child.label])))
            faults.add(
                child.location,
                f"state '{child.label}' never leads to an outcome: its transitions only lead to {cycle}; "
                f"add a transition to one of: {', '.join(outcomes)}",
            )
    check_outcomes_produced(outcomes, set().union(*leads_to.values()), machine.location, faults)


def _targets(child: ChildLinks, outcomes: tuple[str, ...], anywhere: set[str]) -> set[str]:
    """Returns the targets of a child. An outcome without transition leads to the machine's outcome of the same name."""
    if child.transitions is None or child.outcomes is None:
        return anywhere
    unlinked = {name for name in child.outcomes if name not in child.transitions}
    if not unlinked <= set(outcomes):
        return anywhere
    targets = unlinked
    for target in child.transitions.values():
        name = str(target.value)
        likely = name if name in anywhere else closest(name, sorted(anywhere))
        if likely is None:
            return anywhere
        targets.add(likely)
    return targets


def _closure(leads_to: MappingABC[str, set[str]], start: Iterable[str]) -> set[str]:
    """Returns the start names and all names reachable from them."""
    reachable: set[str] = set()
    pending = list(start)
    while pending:
        label = pending.pop()
        if label not in reachable:
            reachable.add(label)
            pending.extend(leads_to.get(label, ()))
    return reachable


def check_outcomes_produced(
    outcomes: tuple[str, ...], produced: Container[str | None], location: SourceLocation, faults: FaultList
) -> None:
    """Adds a fault for each outcome that nothing leads to, except for ``preempted``, the outcome of a stopped machine.

    Args:
        outcomes: Outcomes of the machine.
        produced: Labels and outcomes that a transition or outcome map leads to.
        location: Position of the outcomes.
        faults: Receives the faults.
    """
    for outcome in outcomes:
        if outcome not in produced and outcome != "preempted":
            faults.add(
                location,
                f"the outcome '{outcome}' is never produced; remove it, or add a transition that leads to it "
                "(in a concurrent machine, an entry of outcome_map)",
            )


def check_concurrent(children: list[ChildLinks], faults: FaultList) -> None:
    """Checks that the children of a concurrence have no transitions, which would have no effect."""
    for child in children:
        if child.transitions:
            location = next(iter(child.keys.values()))
            faults.add(
                location,
                f"state '{child.label}' has transitions, but runs in a concurrent machine, whose states all run at "
                "once; remove the transitions and use outcome_map of the machine",
            )


def check_outcome_map(
    node: Node, outcomes: tuple[str, ...], children: list[ChildLinks], faults: FaultList
) -> dict[str, dict[str, str]]:
    """Returns the outcome map of a concurrence. Unknown states and outcomes add faults.

    Args:
        node: Value of ``outcome_map``.
        outcomes: Outcomes of the machine.
        children: Labels and outcomes of the children.
        faults: Receives the faults.
    """
    if not isinstance(node, Mapping):
        faults.add(node.location, f"outcome_map must be {{outcome: {{State: its outcome}}}}, found {kind_of(node)}")
        return {}
    by_label = {child.label: child for child in children}
    result: dict[str, dict[str, str]] = {}
    for outcome, conditions in node.entries.items():
        if outcome not in outcomes:
            faults.add_unknown(node.keys[outcome], "outcome_map: outcome", outcome, outcomes, used=node.entries)
        if not isinstance(conditions, Mapping):
            faults.add(
                conditions.location,
                f"outcome_map: '{outcome}' must be {{State: its outcome}}, found {kind_of(conditions)}",
            )
            continue
        result[outcome] = {}
        for label, outcome_node in conditions.entries.items():
            value = outcome_node.plain()
            child = by_label.get(label)
            if child is None:
                faults.add_unknown(
                    conditions.keys[label], "outcome_map: state", label, by_label, used=conditions.entries
                )
            elif not isinstance(value, str):
                faults.add(
                    outcome_node.location,
                    f"outcome_map: outcome of '{label}' must be a name, found {kind_of(outcome_node)}",
                )
            elif child.outcomes is not None and value not in child.outcomes:
                faults.add_unknown(outcome_node.location, f"outcome_map: outcome of '{label}'", value, child.outcomes)
            result[outcome][label] = str(value)
    return result
