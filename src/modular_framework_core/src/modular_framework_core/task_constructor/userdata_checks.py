# SPDX-License-Identifier: BSD-3-Clause
"""Checks of a task's userdata: every key that a state needs is there, and every remapping names a key."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterable

from modular_framework_core.files.faults import FaultList, listing, nearest
from modular_framework_core.files.located_yaml import Mapping, Node
from modular_framework_core.task_constructor import header_fields
from modular_framework_core.task_constructor.task_spec import ChildSpec, MachineSpec, StateSpec

MISSPELT = 0.75
"""An io key that only one state uses counts as misspelt when it is this similar to a key of a template (0 to 1)."""


def check_remapping(child: ChildSpec, node: Node | None, faults: FaultList) -> None:
    """Checks that a remapping gives names to keys that the state or machine has."""
    if node is None:
        return
    what = f"state '{child.label}': remapping"
    names = header_fields.name_map(node, what, faults, example="{key_here: key_around}")
    known = _interface(child)
    if names is None or known is None or not isinstance(node, Mapping):
        return
    for key in names:
        if key not in known:
            faults.add_unknown(node.keys[key], f"{what}: key", key, sorted(known), given=names)


def _interface(child: ChildSpec) -> set[str] | None:
    """Returns the userdata keys that a state or machine exchanges; None when they are not known."""
    if isinstance(child, MachineSpec):
        return {*child.input_keys, *child.output_keys}
    found = [declared_keys(child, key) for key in ("input_keys", "output_keys", "io_keys")]
    return None if None in found else {name for names in found for name in names or ()}


def check_userdata(root: MachineSpec, provided_by: dict[str, str], faults: FaultList) -> None:
    """Checks that every userdata key a state needs is provided in its machine.

    Args:
        root: The outermost machine.
        provided_by: Key -> name of the template that provides it, over all templates known.
        faults: Where faults are noted.
    """
    for machine in root.machines():
        if machine is root or not machine.shares_userdata:
            _check_scope(machine, machine is root, provided_by, faults)


def _check_scope(machine: MachineSpec, is_root: bool, provided_by: dict[str, str], faults: FaultList) -> None:
    if machine.template.userdata is None:
        return
    children = list(_children(machine))
    members = [child for child in children if isinstance(child, StateSpec)]
    nested = [child for child in children if isinstance(child, MachineSpec)]
    available = {*machine.template.userdata, *machine.input_keys}
    exchanged: Counter[str] = Counter()
    for state in members:
        for key in ("output_keys", "io_keys"):
            known = _keys_around(state, key)
            if known is None:
                return
            (available if key == "output_keys" else exchanged).update(known)
    for inner in nested:
        available.update(inner.remapping.get(key, key) for key in inner.output_keys)
    for key, users in exchanged.items():
        misspelt = users == 1 and difflib.get_close_matches(key, list(provided_by), n=1, cutoff=MISSPELT)
        if key not in provided_by and not misspelt:
            available.add(key)
    needed: list[tuple[ChildSpec, list[str]]] = [
        (state, [*(_keys_around(state, "input_keys") or ()), *(_keys_around(state, "io_keys") or ())])
        for state in members
    ]
    needed += [
        (inner, [inner.remapping.get(key, key) for key in inner.input_keys])
        for inner in nested
        if not inner.shares_userdata
    ]
    for child, keys in needed:
        for key in dict.fromkeys(keys):
            if key not in available:
                faults.add(child.location, _missing_key(machine, is_root, child, key, available, provided_by))


def _missing_key(
    machine: MachineSpec,
    is_root: bool,
    child: ChildSpec,
    key: str,
    available: Iterable[str],
    provided_by: dict[str, str],
) -> str:
    text = (
        f"state '{child.label}' needs the userdata key '{key}', which the machine '{machine.label}' does not have; "
        f"{listing(sorted(available), 'it has none')}{nearest(key, sorted(available))}"
    )
    if not is_root:
        return f"{text}; 'userdata: self.userdata' in the header of '{machine.label}' shares the keys around it"
    if key in provided_by:
        return f"{text}; the template {provided_by[key]} provides it"
    return f"{text}; name it in the output_keys of the state that writes it"


def _children(machine: MachineSpec) -> Iterable[ChildSpec]:
    """Yields the states and machines that work on the userdata of a machine."""
    for child in machine.states:
        yield child
        if isinstance(child, MachineSpec) and child.shares_userdata:
            yield from _children(child)


def _keys_around(state: StateSpec, key: str) -> tuple[str, ...] | None:
    """Returns the keys a state declares as the machine around it calls them; None when they are not known."""
    names = declared_keys(state, key)
    return None if names is None else tuple(state.remapping.get(name, name) for name in names)


def declared_keys(state: StateSpec, key: str) -> tuple[str, ...] | None:
    """Returns the userdata keys a state declares, as written or by default; None when they are not known.

    Args:
        state: The state.
        key: input_keys, output_keys or io_keys.
    """
    given = None if key in state.source.own_keys else state.options.get(key)
    return tuple(given) if isinstance(given, (list, tuple)) else state.source.default_names(key)
