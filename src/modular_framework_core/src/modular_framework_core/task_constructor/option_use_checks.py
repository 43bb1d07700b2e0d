# SPDX-License-Identifier: BSD-3-Clause
"""Checks the names and userdata keys that the options of states refer to."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence
from modular_framework_core.state_api.option_types import option_fault
from modular_framework_core.state_api.option_uses import (
    FROM_USERDATA,
    USERDATA_PREFIX,
    Fields,
    Key,
    Named,
    OutcomeNames,
    OutputKeys,
    kind_of,
)
from modular_framework_core.task_constructor.known_names import MODEL, PLANNER, SERIES, KnownNames, model_of
from modular_framework_core.task_constructor.task_spec import MachineSpec, StateSpec
from modular_framework_core.task_constructor.userdata_checks import declared_keys
from modular_framework_ros.allowed_names import listing, nearest

_PLURALS = {"trajectory": "trajectories"}
_NON_MESSAGE_KINDS = {
    "posture": "posture",
    "group": "planning group",
    "region": "region",
    SERIES: "series of objects",
    PLANNER: "planner",
}
"""Kinds without external names, and their words in messages."""


def check_uses(root: MachineSpec, known: KnownNames, faults: FaultList, *, complete: bool) -> None:
    """Checks the options of all states of a task.

    Args:
        root: Outermost machine.
        known: Known names, without the names that the task's states store.
        faults: Receives the faults.
        complete: Whether all states were readable. Otherwise unknown plan names are not reported, because an unreadable
            state may store them.
    """
    states = list(root.leaf_states())
    possibly_stored = frozenset(_undeclared_texts(states))
    names = known.with_names(_stored_names(states))
    unchecked_kinds = {kind for kind in names.names if any(_may_store(state, kind) for state in states)}
    unchecked_kinds |= set() if complete else {"plan"}
    for state in states:
        _Checker(state, names, unchecked_kinds, possibly_stored, faults).check()


def names_used(root: MachineSpec, kind: str) -> tuple[str, ...]:
    """Returns the names of a kind in the options of a task's states, without duplicates.

    Args:
        root: Outermost machine.
        kind: Kind of name, such as planner.
    """
    names: dict[str, None] = {}
    for state in root.leaf_states():
        for option in state.source.options.values():
            if any(isinstance(use, Named) and use.kind == kind and not use.made for use in option.uses):
                value = state.options.get(option.name, option.default)
                names |= dict.fromkeys(str(name) for name in (value if isinstance(value, list) else [value]) if name)
    return tuple(names)


def names_made(root: MachineSpec, kind: str) -> frozenset[str]:
    """Returns the names of a kind that the states of a task store or spawn."""
    return _stored_names(list(root.leaf_states())).get(kind, frozenset())


def texts_used(root: MachineSpec) -> frozenset[str]:
    """Returns all texts in the options of a task's states, at any depth."""
    return frozenset(text for state in root.leaf_states() for node in state.nodes.values() for _, text in _texts(node))


class _Checker:
    """Checks the options of one state."""

    def __init__(
        self,
        state: StateSpec,
        known: KnownNames,
        unchecked_kinds: set[str],
        possibly_stored: frozenset[str],
        faults: FaultList,
    ) -> None:
        self._state = state
        self._known = known
        self._unchecked_kinds = unchecked_kinds
        self._possibly_stored = possibly_stored
        self._faults = faults
        self._inputs = _declared_key_union(state, ("input_keys", "io_keys"))
        self._outputs = _declared_key_union(state, ("output_keys", "io_keys"))

    def check(self) -> None:
        """Adds all faults of the state."""
        source = self._state.source
        for option in source.options.values():
            node = self._state.nodes.get(option.name)
            if node is not None and option_fault(option.type, node):
                continue  # already reported; further faults would only follow from this fault
            value = option.default if node is None else node.plain()
            for use in option.uses:
                self._check_use(use, option.name, value, node)
        self._check_reads()

    def _check_use(self, use: Any, name: str, value: Any, node: Node | None) -> None:
        location = self._state.location if node is None else node.location
        match use:
            case Named():
                self._check_name(use, name, node)
            case Key(direction=direction, name=key, when=when):
                if not value or (when and value not in (when, [when])):
                    return
                userdata_key = str(value) if not key else key.format(kind_of(str(value)))
                self._require_key(direction, userdata_key, f"option '{name}' {value!r}", location)
            case Fields() if node is not None:
                for location, text in _references(node):
                    self._require_key("input", text.removeprefix(USERDATA_PREFIX).split(".")[0], f"'{text}'", location)
            case OutputKeys() if isinstance(node, Mapping):
                for key in node:
                    self._require_key("output", key, f"option '{name}'", node.keys[key])
            case OutcomeNames() if isinstance(node, Mapping) and self._state.outcomes:
                for key in node:
                    if key not in self._state.outcomes:
                        noun = f"state '{self._state.label}': {name}: outcome"
                        self._faults.add_unknown(node.keys[key], noun, key, self._state.outcomes, used=node.entries)

    def _check_name(self, use: Named, option: str, node: Node | None) -> None:
        kind_word = self._kind_word(use.kind)
        kind = kind_of(kind_word)
        for item in node.items if isinstance(node, Sequence) else [] if node is None else [node]:
            name = item.value if isinstance(item, Scalar) else None
            if not isinstance(name, str) or not name or use.made:
                continue
            if use.userdata and name == FROM_USERDATA:
                keys = tuple(dict.fromkeys((f"selected_{kind_word}", f"selected_{kind}")))
                if self._inputs is not None and not self._inputs.intersection(keys):
                    self._require_key("input", keys[-1], f"option '{option}' 'userdata'", item.location)
                continue
            if kind == MODEL:
                if name == FROM_USERDATA:
                    continue  # the annotation Key names the userdata key
                name = model_of(name)
            names = None if kind in self._unchecked_kinds else self._known.of_kind(kind)
            may_be_stored = name in self._possibly_stored and kind not in _NON_MESSAGE_KINDS
            if names is not None and name not in names and not may_be_stored:
                self._faults.add(item.location, self._unknown(option, kind, name, names))

    def _unknown(self, option: str, kind: str, name: str, names: Collection[str]) -> str:
        noun = _NON_MESSAGE_KINDS.get(kind, kind.replace("_", " "))
        text = (
            f"state '{self._state.label}' ({self._state.source.name}): option '{option}': the {noun} '{name}' is "
            f"unknown; {listing(sorted(names), 'there is none')}"
        )
        origin = self._known.origins.get(kind, "" if kind == PLANNER else "the manager's file")
        hint = nearest(name, sorted(names))
        if kind in _NON_MESSAGE_KINDS:
            return (
                f"{text}; name one of these{hint}"
                if not origin
                else f"{text}; name one of these, or add it to {origin}{hint}"
            )
        remedy = "store it with a state (plan_name)" if kind == "plan" else f"add it to {origin}"
        return f"{text}; {remedy}, or name it in external_names of the task if another node adds it{hint}"

    def _kind_word(self, kind: str) -> str:
        if not kind.startswith("option:"):
            return kind
        return str(self._state.options.get(kind.removeprefix("option:"), ""))

    def _require_key(self, direction: str, key: str, user: str, location: SourceLocation, key_list: str = "") -> None:
        declared = self._inputs if direction == "input" else self._outputs
        if declared is None or key in declared:
            return
        verb, key_list = "takes" if direction == "input" else "writes", key_list or f"{direction}_keys"
        source = self._state.source
        key_place = f"{key_list} in {source.file.name}" if key_list in source.own_keys else key_list
        self._faults.add(
            location,
            f"state '{self._state.label}' ({source.name}): {user} {verb} the userdata key "
            f"'{key}', but its {direction} keys are: {', '.join(sorted(declared)) or 'none'}; "
            f"add it to {key_place}",
        )

    def _check_reads(self) -> None:
        """Adds a fault for each key that the source reads but the task's key lists omit."""
        source, inputs = self._state.source, self._inputs
        if inputs is None:
            return
        by_default = {
            key
            for option in ("input_keys", "io_keys")
            if option in self._state.nodes
            for key in source.default_names(option) or ()
        }
        for key in sorted((by_default & source.userdata.anywhere) | source.userdata.always):
            if key in inputs:
                continue
            key_list = "io_keys" if key in (source.default_names("io_keys") or ()) else "input_keys"
            location = self._state.nodes[key_list].location if key_list in self._state.nodes else self._state.location
            self._require_key("input", key, source.file.name, location, key_list)


def _declared_key_union(state: StateSpec, lists: tuple[str, ...]) -> frozenset[str] | None:
    """Returns the union of some key lists of a state; None if one of them is unknown."""
    declared = [declared_keys(state, name) for name in lists]
    return None if None in declared else frozenset(key for keys in declared for key in keys or ())


def _references(node: Node) -> Iterator[tuple[SourceLocation, str]]:
    """Yields location and text of each userdata reference in the fields of a message."""
    return ((location, text) for location, text in _texts(node) if text.startswith(USERDATA_PREFIX))


def _stored_names(states: list[StateSpec]) -> dict[str, frozenset[str]]:
    """Returns the names under which the task's states store messages, kind -> names."""
    stored: dict[str, set[str]] = {}
    for state in states:
        for option in state.source.options.values():
            for use in option.uses:
                if isinstance(use, Named) and use.made:
                    name = state.options.get(option.name, option.default)
                    stored.setdefault(use.kind, set()).update([name] if isinstance(name, str) else [])
    return {kind: frozenset(names - {""}) for kind, names in stored.items()}


def _undeclared_texts(states: list[StateSpec]) -> Iterator[str]:
    """Yields the texts in options whose annotations declare no name.

    User states, and states that call services, may store messages under such names.
    """
    for state in states:
        for name, node in state.nodes.items():
            option = state.source.options.get(name)
            if option is None or not any(isinstance(use, Named) for use in option.uses):
                yield from (text for _, text in _texts(node))


def _texts(node: Node) -> Iterator[tuple[SourceLocation, str]]:
    """Yields location and text of all texts in a value."""
    match node:
        case Scalar(value=str(text)):
            yield node.location, text
        case Sequence(items=items):
            for item in items:
                yield from _texts(item)
        case Mapping(entries=entries):
            for item in entries.values():
                yield from _texts(item)


def _may_store(state: StateSpec, kind: str) -> bool:
    """Returns whether a state may store messages of a kind under names that the task does not contain.

    This holds if the state loads message files, if an option names a storing service of the kind's manager, or if the
    source names such a service and no option declares the stored name.
    """
    plural = _PLURALS.get(kind, f"{kind}s")
    if state.source.name == "load" and state.options.get("kind") == kind:
        return True
    services = (f"add_{kind}", f"load_{plural}", f"reload_{plural}", f"store_{kind}(")
    option_texts = [str(value) for value in state.options.values() if isinstance(value, str)]
    declares_names = any(
        isinstance(use, Named) and use.made and use.kind == kind
        for option in state.source.options.values()
        for use in option.uses
    )
    texts = option_texts if declares_names else [*option_texts, state.source.text]
    return any(service in text for service in services for text in texts)
