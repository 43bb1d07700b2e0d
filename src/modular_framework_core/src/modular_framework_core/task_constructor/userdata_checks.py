# SPDX-License-Identifier: BSD-3-Clause
"""Checks a task's userdata: every key that a state reads is provided, and every remapped key exists."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterable

from modular_framework_core.files.faults import FaultList
from modular_framework_core.files.located_yaml import Mapping, Node
from modular_framework_core.task_constructor import header_fields
from modular_framework_core.task_constructor.task_spec import ChildSpec, MachineSpec, StateSpec
from modular_framework_ros.allowed_names import listing, nearest

MIN_SIMILARITY = 0.75
"""An io key of only one state counts as misspelt above this similarity to a template's key, 0 to 1."""


def check_remapping(child: ChildSpec, node: Node | None, faults: FaultList) -> None:
    """Checks that a child's remapping contains only userdata keys of the child.

    Args:
        child: State or machine.
        node: Value of ``remapping``; None if absent.
        faults: Receives the faults.
    """
    if node is None:
        return
    label = f"state '{child.label}': remapping"
    names = header_fields.name_map(node, label, faults, example="{key_of_the_state: key_of_the_machine}")
    known_keys = _interface_keys(child)
    if names is None or known_keys is None or not isinstance(node, Mapping):
        return
    for key in names:
        if key not in known_keys:
            faults.add_unknown(node.keys[key], f"{label}: key", key, sorted(known_keys), used=names)


def _interface_keys(child: ChildSpec) -> set[str] | None:
    """Returns the input, output and io keys of a state or machine; None if unknown."""
    if isinstance(child, MachineSpec):
        return {*child.input_keys, *child.output_keys}
    declared = [declared_keys(child, key) for key in ("input_keys", "output_keys", "io_keys")]
    return None if None in declared else {name for names in declared for name in names or ()}


def check_userdata(root: MachineSpec, provided_by: dict[str, str], faults: FaultList) -> None:
    """Checks that every userdata key that a state needs is provided in its machine.

    Args:
        root: Outermost machine.
        provided_by: Userdata key -> template that provides the key, over all available templates.
        faults: Receives the faults.
    """
    for machine in root.machines():
        if machine is root or not machine.shares_userdata:
            _check_scope(machine, machine is root, provided_by, faults)


def _check_scope(machine: MachineSpec, is_root: bool, provided_by: dict[str, str], faults: FaultList) -> None:
    if machine.template.userdata is None:
        return
    children = list(_userdata_users(machine))
    states = [child for child in children if isinstance(child, StateSpec)]
    nested = [child for child in children if isinstance(child, MachineSpec)]
    available = {*machine.template.userdata, *machine.input_keys}
    io_key_counts: Counter[str] = Counter()
    for state in states:
        for key in ("output_keys", "io_keys"):
            known_keys = _remapped_keys(state, key)
            if known_keys is None:
                return
            (available if key == "output_keys" else io_key_counts).update(known_keys)
    for machine_inside in nested:
        available.update(machine_inside.remapping.get(key, key) for key in machine_inside.output_keys)
    for key, users in io_key_counts.items():
        misspelt = users == 1 and difflib.get_close_matches(key, list(provided_by), n=1, cutoff=MIN_SIMILARITY)
        if key not in provided_by and not misspelt:
            available.add(key)
    required_keys: list[tuple[ChildSpec, list[str]]] = [
        (state, [*(_remapped_keys(state, "input_keys") or ()), *(_remapped_keys(state, "io_keys") or ())])
        for state in states
    ]
    required_keys += [
        (machine_inside, [machine_inside.remapping.get(key, key) for key in machine_inside.input_keys])
        for machine_inside in nested
        if not machine_inside.shares_userdata
    ]
    for child, keys in required_keys:
        for key in dict.fromkeys(keys):
            if key not in available:
                text = f"{_missing_key(machine, child, key, available)}; {_source(machine, is_root, key, provided_by)}"
                faults.add(child.location, text)


def _missing_key(machine: MachineSpec, child: ChildSpec, key: str, available: Iterable[str]) -> str:
    return (
        f"state '{child.label}' needs the userdata key '{key}', which the machine '{machine.label}' does not have; "
        f"{listing(sorted(available), 'it has none')}{nearest(key, sorted(available))}"
    )


def _source(machine: MachineSpec, is_root: bool, key: str, provided_by: dict[str, str]) -> str:
    """Returns the remedy for a missing key."""
    if not is_root:
        return f"'userdata: self.userdata' in the header of '{machine.label}' shares the enclosing machine's keys"
    if key in provided_by:
        return f"the template {provided_by[key]} provides it"
    return "name it in the output_keys of the state that writes it"


def _userdata_users(machine: MachineSpec) -> Iterable[ChildSpec]:
    """Yields the states and machines that use a machine's userdata."""
    for child in machine.states:
        yield child
        if isinstance(child, MachineSpec) and child.shares_userdata:
            yield from _userdata_users(child)


def _remapped_keys(state: StateSpec, key: str) -> tuple[str, ...] | None:
    """Returns a state's declared keys under their names in the enclosing machine; None if unknown."""
    names = declared_keys(state, key)
    return None if names is None else tuple(state.remapping.get(name, name) for name in names)


def declared_keys(state: StateSpec, key: str) -> tuple[str, ...] | None:
    """Returns the userdata keys under one of input_keys, output_keys and io_keys of a state; None if unknown."""
    option_value = None if key in state.source.own_keys else state.options.get(key)
    return tuple(option_value) if isinstance(option_value, (list, tuple)) else state.source.default_names(key)
