# SPDX-License-Identifier: BSD-3-Clause
"""Checks how the states of a machine are linked: transitions, outcome maps, reachability, userdata."""
from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Container, Iterable
from collections.abc import Mapping as MappingABC
from dataclasses import dataclass

from modular_framework_core.task_constructor.faults import FaultList, Place, closest, listing, nearest
from modular_framework_core.task_constructor.located_yaml import Mapping, Node, Scalar, kind_of
from modular_framework_core.task_constructor.task_spec import MachineSpec, StateSpec

MISSPELT = 0.75
"""An io key that only one state uses counts as misspelt when it is this similar to a key of a template (0 to 1)."""


@dataclass(frozen=True, slots=True)
class ChildLinks:
    """How a child is linked, as written.

    Attributes:
        label: the child's name.
        outcomes: what it may end with; None when that could not be found out.
        transitions: outcome -> target; None when they could not be read.
        keys: place of each key of ``transitions``.
        place: where the child is defined.
    """

    label: str
    outcomes: tuple[str, ...] | None
    transitions: dict[str, Scalar] | None
    keys: dict[str, Place]
    place: Place


def check_sequential(
    children: list[ChildLinks], labels: list[str], outcomes: tuple[str, ...] | None, place: Place, faults: FaultList
) -> None:
    """Check the transitions of the children of a state machine.

    Args:
        children: the children that could be read.
        labels: the labels of all children as written, those that could not be read or that repeat one included.
        outcomes: outcomes of the machine; None when they could not be read, which leaves targets unchecked.
        place: where the outcomes are declared.
        faults: where faults are noted.
    """
    targets = list(dict.fromkeys([*labels, *(outcomes or ())]))
    for child in children:
        transitions = child.transitions or {}
        for outcome, target in transitions.items():
            if child.outcomes is not None and outcome not in child.outcomes:
                faults.add_unknown(child.keys[outcome], f"state '{child.label}': outcome", outcome, child.outcomes)
            if outcomes is not None and target.value not in targets:
                what = f"state '{child.label}': transition target"
                faults.add_unknown(target.place, what, str(target.value), targets)
        if child.transitions is None or outcomes is None:
            continue
        missing = [name for name in child.outcomes or () if name not in transitions and name not in outcomes]
        if missing:
            faults.add(
                child.place,
                f"state '{child.label}': no transition for {', '.join(map(repr, missing))}; "
                f"add it to transitions, leading to one of: {', '.join(targets)}",
            )
    if outcomes is not None and labels:
        _check_ways(children, labels, outcomes, place, faults)


def _check_ways(
    children: list[ChildLinks], labels: list[str], outcomes: tuple[str, ...], place: Place, faults: FaultList
) -> None:
    """Note states no transition leads to, states that lead to no outcome, and outcomes nothing leads to.

    What is wrong with a transition is noted by others: here a misspelt target is taken for the nearest one, and what
    cannot be known may lead anywhere, so that nothing is noted that would be well once that is mended.
    """
    anywhere = {*labels, *outcomes}
    leads_to = {label: anywhere for label in labels}
    for child in children:
        if labels.count(child.label) == 1:
            leads_to[child.label] = _targets(child, outcomes, anywhere)
    reached = _closure(leads_to, labels[:1])
    backwards: dict[str, set[str]] = {}
    for label, targets in leads_to.items():
        for target in targets:
            backwards.setdefault(target, set()).add(label)
    with_way_out = _closure(backwards, outcomes)
    for child in children:
        if child.label not in reached:
            faults.add(child.place, f"state '{child.label}' is never reached: no transition leads to it")
        elif child.label not in with_way_out:
            circle = ", ".join(sorted(_closure(leads_to, [child.label])))
            faults.add(child.place, f"state '{child.label}' has no way out: from it the machine only gets to {circle}, "
                                    f"never to an outcome; lead one of them to: {', '.join(outcomes)}")
    check_outcomes_produced(outcomes, set().union(*leads_to.values()), place, faults)


def _targets(child: ChildLinks, outcomes: tuple[str, ...], anywhere: set[str]) -> set[str]:
    """Return what a child leads to; an outcome of the machine's own that has no transition leads there by its name."""
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
    """Return all names that can be reached from some names, themselves included."""
    reached: set[str] = set()
    waiting = list(start)
    while waiting:
        label = waiting.pop()
        if label not in reached:
            reached.add(label)
            waiting.extend(leads_to.get(label, ()))
    return reached


def check_outcomes_produced(
    outcomes: tuple[str, ...], produced: Container[str | None], place: Place, faults: FaultList
) -> None:
    """Note outcomes nothing leads to; ``preempted`` is what a machine ends with when it is stopped."""
    for outcome in outcomes:
        if outcome not in produced and outcome != "preempted":
            faults.add(place, f"the outcome '{outcome}' is never produced: nothing leads to it; remove it, or let a "
                              "transition (in a concurrent machine: an entry of outcome_map) lead to it")


def check_concurrent(children: list[ChildLinks], faults: FaultList) -> None:
    """Check that the children of a concurrent machine have no transitions, which would have no effect."""
    for child in children:
        if child.transitions:
            place = next(iter(child.keys.values()))
            faults.add(
                place,
                f"state '{child.label}' has transitions, but it runs in a concurrent machine, where states end "
                "together; remove them and use outcome_map of the machine",
            )


def check_outcome_map(
    node: Node, outcomes: tuple[str, ...], children: list[ChildLinks], faults: FaultList
) -> dict[str, dict[str, str]]:
    """Return the outcome map of a concurrent machine; note what it names that is not there."""
    if not isinstance(node, Mapping):
        faults.add(node.place, f"outcome_map must be {{outcome: {{State: outcome of it}}}}, found {kind_of(node)}")
        return {}
    by_label = {child.label: child for child in children}
    result: dict[str, dict[str, str]] = {}
    for outcome, conditions in node.entries.items():
        if outcome not in outcomes:
            faults.add_unknown(node.keys[outcome], "outcome_map: outcome", outcome, outcomes)
        if not isinstance(conditions, Mapping):
            faults.add(
                conditions.place,
                f"outcome_map: '{outcome}' must be {{State: outcome of it}}, found {kind_of(conditions)}",
            )
            continue
        result[outcome] = {}
        for label, wanted in conditions.entries.items():
            value = wanted.plain()
            child = by_label.get(label)
            if child is None:
                faults.add_unknown(conditions.keys[label], "outcome_map: state", label, by_label)
            elif not isinstance(value, str):
                faults.add(wanted.place, f"outcome_map: outcome of '{label}' must be a name, found {kind_of(wanted)}")
            elif child.outcomes is not None and value not in child.outcomes:
                faults.add_unknown(wanted.place, f"outcome_map: outcome of '{label}'", value, child.outcomes)
            result[outcome][label] = str(value)
    return result


def check_userdata(root: MachineSpec, provided_by: dict[str, str], faults: FaultList) -> None:
    """Check that every userdata key a state needs is provided in its machine.

    Args:
        root: the outermost machine.
        provided_by: key -> name of the template that provides it, over all templates known.
        faults: where faults are noted.
    """
    for machine in root.machines():
        if machine is root or not machine.shares_userdata:
            _check_scope(machine, machine is root, provided_by, faults)


def _check_scope(machine: MachineSpec, is_root: bool, provided_by: dict[str, str], faults: FaultList) -> None:
    if machine.template.userdata is None:
        return
    members = list(_members(machine))
    available = {*machine.template.userdata, *machine.input_keys}
    exchanged: Counter[str] = Counter()
    for state in members:
        for key in ("output_keys", "io_keys"):
            known = _keys(state, key)
            if known is None:
                return
            (available if key == "output_keys" else exchanged).update(known)
    for child in _nested(machine):
        available.update(child.output_keys)
    for key, users in exchanged.items():
        misspelt = users == 1 and difflib.get_close_matches(key, list(provided_by), n=1, cutoff=MISSPELT)
        if key not in provided_by and not misspelt:
            available.add(key)
    for state in members:
        needed = dict.fromkeys([*(_keys(state, "input_keys") or ()), *(_keys(state, "io_keys") or ())])
        for key in needed:
            if key not in available:
                faults.add(state.place, _missing_key(machine, is_root, state, key, available, provided_by))


def _missing_key(
    machine: MachineSpec, is_root: bool, state: StateSpec, key: str, available: Iterable[str],
    provided_by: dict[str, str],
) -> str:
    text = (
        f"state '{state.label}' needs the userdata key '{key}', which the machine '{machine.label}' does not have; "
        f"{listing(sorted(available), 'it has none')}{nearest(key, sorted(available))}"
    )
    if not is_root:
        return f"{text}; 'userdata: self.userdata' in the header of '{machine.label}' shares the keys around it"
    if key in provided_by:
        return f"{text}; the template {provided_by[key]} provides it"
    return text


def _members(machine: MachineSpec) -> Iterable[StateSpec]:
    """Yield the states that work on the userdata of this machine."""
    for child in machine.states:
        if isinstance(child, StateSpec):
            yield child
        elif child.shares_userdata:
            yield from _members(child)


def _nested(machine: MachineSpec) -> Iterable[MachineSpec]:
    for child in machine.states:
        if isinstance(child, MachineSpec):
            yield child
            if child.shares_userdata:
                yield from _nested(child)


def _keys(state: StateSpec, key: str) -> tuple[str, ...] | None:
    """Return the userdata keys a state declares, as written or by default; None when they are not known."""
    given = state.options.get(key)
    return tuple(given) if isinstance(given, (list, tuple)) else state.source.default_names(key)
