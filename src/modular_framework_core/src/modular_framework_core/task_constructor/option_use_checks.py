# SPDX-License-Identifier: BSD-3-Clause
"""Checks what the options of states stand for: names that must exist, and userdata the states must declare."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from modular_framework_core.files.faults import FaultList, SourceLocation, listing, nearest
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence
from modular_framework_core.state_api.option_types import complaint
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
from modular_framework_core.task_constructor.known_names import KnownNames
from modular_framework_core.task_constructor.task_spec import MachineSpec, StateSpec
from modular_framework_core.task_constructor.userdata_checks import declared_keys

_PLURALS = {"trajectory": "trajectories"}
_WORDS = {"posture": "posture", "group": "planning group", "planner": "planner"}


def check_uses(root: MachineSpec, known: KnownNames, faults: FaultList, *, complete: bool) -> None:
    """Checks the options of all states of a task.

    Args:
        root: The outermost machine.
        known: The names there are beside those that states of the task make.
        faults: Where faults are noted.
        complete: Whether all states of the task could be read, so that no other makes a plan.
    """
    states = list(root.leaf_states())
    maybe_made = frozenset(_unexplained(states))
    names = known.with_names(_made(states))
    open_kinds = {kind for kind in names.names if any(_may_make(state, kind) for state in states)}
    open_kinds |= set() if complete else {"plan"}
    for state in states:
        _Checker(state, names, open_kinds, maybe_made, faults).check()


class _Checker:
    """Checks the options of one state."""

    def __init__(
        self, state: StateSpec, known: KnownNames, open_kinds: set[str], maybe_made: frozenset[str], faults: FaultList
    ) -> None:
        self._state = state
        self._known = known
        self._open = open_kinds
        self._maybe_made = maybe_made
        self._faults = faults
        self._inputs = _declared(state, ("input_keys", "io_keys"))
        self._outputs = _declared(state, ("output_keys", "io_keys"))

    def check(self) -> None:
        """Notes everything that is wrong."""
        source = self._state.source
        for option in source.options.values():
            node = self._state.nodes.get(option.name)
            if node is not None and complaint(option.type, node):
                continue  # noted already: other faults would only follow from it
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
                needed = str(value) if not key else key.format(kind_of(str(value)))
                self._need(direction, needed, f"option '{name}' {value!r}", location)
            case Fields() if node is not None:
                for location, text in _references(node):
                    self._need("input", text.removeprefix(USERDATA_PREFIX).split(".")[0], f"'{text}'", location)
            case OutputKeys() if isinstance(node, Mapping):
                for key in node:
                    self._need("output", key, f"option '{name}'", node.keys[key])
            case OutcomeNames() if isinstance(node, Mapping) and self._state.outcomes:
                for key in node:
                    if key not in self._state.outcomes:
                        what = f"state '{self._state.label}': {name}: outcome"
                        self._faults.add_unknown(node.keys[key], what, key, self._state.outcomes, given=node.entries)

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
                    self._need("input", keys[-1], f"option '{option}' 'userdata'", item.location)
                continue
            names = self._known.names.get(kind)
            made = name in self._maybe_made and kind not in _WORDS
            if names is not None and kind not in self._open and name not in names and not made:
                self._faults.add(item.location, self._unknown(option, kind, name, names))

    def _unknown(self, option: str, kind: str, name: str, names: frozenset[str]) -> str:
        word = _WORDS.get(kind, kind.replace("_", " "))
        text = (
            f"state '{self._state.label}' ({self._state.source.name}): option '{option}': the {word} '{name}' is "
            f"unknown; {listing(sorted(names), 'there is none')}"
        )
        origin = self._known.origins.get(kind, "" if kind == "planner" else "the manager's file")
        meant = nearest(name, sorted(names))
        if kind in _WORDS:
            return (
                f"{text}; name one of these{meant}"
                if not origin
                else f"{text}; name one of these, or add it to {origin}{meant}"
            )
        maker = "let a state make it (plan_name)" if kind == "plan" else f"add it to {origin}"
        return f"{text}; {maker}, or name it in external_names of the task where another node adds it{meant}"

    def _kind_word(self, kind: str) -> str:
        if not kind.startswith("option:"):
            return kind
        return str(self._state.options.get(kind.removeprefix("option:"), ""))

    def _need(self, direction: str, key: str, what: str, location: SourceLocation, listed: str = "") -> None:
        declared = self._inputs if direction == "input" else self._outputs
        if declared is None or key in declared:
            return
        does, listed = "takes" if direction == "input" else "writes", listed or f"{direction}_keys"
        source = self._state.source
        where = f"{listed} in {source.file.name}" if listed in source.own_keys else listed
        self._faults.add(
            location,
            f"state '{self._state.label}' ({source.name}): {what} {does} the userdata key "
            f"'{key}', but its {direction} keys are: {', '.join(sorted(declared)) or 'none'}; "
            f"add it to {where}",
        )

    def _check_reads(self) -> None:
        """Notes keys that the source reads and the task's own lists of keys leave out."""
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
            listed = "io_keys" if key in (source.default_names("io_keys") or ()) else "input_keys"
            location = self._state.nodes[listed].location if listed in self._state.nodes else self._state.location
            self._need("input", key, source.file.name, location, listed)


def _declared(state: StateSpec, lists: tuple[str, ...]) -> frozenset[str] | None:
    """Returns the keys of some lists together; None where one of them is not known."""
    found = [declared_keys(state, name) for name in lists]
    return None if None in found else frozenset(key for keys in found for key in keys or ())


def _references(node: Node) -> Iterator[tuple[SourceLocation, str]]:
    """Yields the references to userdata in the fields of a message, with their locations."""
    return ((location, text) for location, text in _texts(node) if text.startswith(USERDATA_PREFIX))


def _made(states: list[StateSpec]) -> dict[str, frozenset[str]]:
    """Returns the names that states of the task store messages under: kind -> names."""
    found: dict[str, set[str]] = {}
    for state in states:
        for option in state.source.options.values():
            for use in option.uses:
                if isinstance(use, Named) and use.made:
                    name = state.options.get(option.name, option.default)
                    found.setdefault(use.kind, set()).update([name] if isinstance(name, str) else [])
    return {kind: frozenset(names - {""}) for kind, names in found.items()}


def _unexplained(states: list[StateSpec]) -> Iterator[str]:
    """Yields the texts in options whose annotations do not declare the name of a message to be read.

    A state with such an option may store a message under that name: a state of the user's, or a service called with it.
    """
    for state in states:
        for name, node in state.nodes.items():
            option = state.source.options.get(name)
            if option is None or not any(isinstance(use, Named) for use in option.uses):
                yield from (text for _, text in _texts(node))


def _texts(node: Node) -> Iterator[tuple[SourceLocation, str]]:
    """Yields all texts in a value, with their locations."""
    match node:
        case Scalar(value=str(text)):
            yield node.location, text
        case Sequence(items=items):
            for item in items:
                yield from _texts(item)
        case Mapping(entries=entries):
            for item in entries.values():
                yield from _texts(item)


def _may_make(state: StateSpec, kind: str) -> bool:
    """Returns whether a state may store messages of a kind under names that the task does not show.

    It may if it loads files of messages, if it calls a service of the kind's manager by its name, or if its source
    names such a service and it has no option for the name.
    """
    plural = _PLURALS.get(kind, f"{kind}s")
    if state.source.name == "load" and state.options.get("kind") == kind:
        return True
    services = (f"add_{kind}", f"load_{plural}", f"reload_{plural}", f"store_{kind}(")
    words = [str(value) for value in state.options.values() if isinstance(value, str)]
    declares_names = any(
        isinstance(use, Named) and use.made and use.kind == kind
        for option in state.source.options.values()
        for use in option.uses
    )
    texts = words if declares_names else [*words, state.source.text]
    return any(service in text for service in services for text in texts)
