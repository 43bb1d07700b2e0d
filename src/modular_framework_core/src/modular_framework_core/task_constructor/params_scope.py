# SPDX-License-Identifier: BSD-3-Clause
"""Resolves ``params``: values defined once in a machine's header or a state and referenced as ``params.<key>``.

The params of a machine are visible at any depth inside the machine; an inner ``params`` overrides outer keys one by
one. A reference is a text that is exactly ``params.<key>``. A reference may replace any value: an option, an item of a
list or mapping, or a header field of a nested machine.
"""

from __future__ import annotations

import difflib

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence, kind_of
from modular_framework_ros.allowed_names import listing, nearest

PREFIX = "params."
MIN_SIMILARITY = 0.75
"""Minimum similarity of a misspelt prefix to ``params``, 0 to 1."""


class ParamsScope:
    """Params visible at one location of a task."""

    def __init__(self, visible: dict[str, Node] | None = None) -> None:
        self._visible = dict(visible or {})
        self.used: set[str] = set()

    def inner(self, params: Mapping | None, faults: FaultList) -> ParamsScope:
        """Returns the scope inside a machine or state. The values of its ``params`` may refer to outer params."""
        own_params = (
            {} if params is None else {key: self.resolve(value, faults) for key, value in params.entries.items()}
        )
        return ParamsScope({**self._visible, **own_params})

    def resolve(self, node: Node, faults: FaultList) -> Node:
        """Replaces every reference in a value. An unknown key adds a fault, and its reference stays unchanged."""
        match node:
            case Mapping():
                entries = {key: self.resolve(value, faults) for key, value in node.entries.items()}
                return Mapping(entries, node.keys, node.location)
            case Sequence():
                return Sequence(tuple(self.resolve(item, faults) for item in node.items), node.location)
            case Scalar(value=str(text)) if text.startswith(PREFIX):
                return self._look_up(node, text.removeprefix(PREFIX), faults)
            case Scalar(value=str(text)):
                self._note_misspelt(node.location, text, faults)
        return node

    def _note_misspelt(self, location: SourceLocation, text: str, faults: FaultList) -> None:
        word, _, key = text.partition(".")
        if key in self._visible and difflib.SequenceMatcher(None, f"{word.lower()}.", PREFIX).ratio() > MIN_SIMILARITY:
            faults.add_cause(location, f"'{text}' would be taken as text; did you mean '{PREFIX}{key}'?")
            self.used.add(key)

    def _look_up(self, node: Scalar, key: str, faults: FaultList) -> Node:
        value = self._visible.get(key)
        if value is None:
            faults.add_cause(
                node.location,
                f"'{PREFIX}{key}' refers to nothing: no params around it has the key '{key}'; "
                f"{listing(self._visible, 'there are no params around it')}{nearest(key, self._visible)}",
            )
            return node
        self.used.add(key)
        return _relocated_value(value, node)


def _relocated_value(value: Node, reference: Node) -> Node:
    """Returns a value relocated to its reference, where users look for a mistake.

    A value that another file gives keeps its location, because that file must be corrected.
    """
    if value.location.file != reference.location.file:
        return value
    match value:
        case Scalar():
            return Scalar(value.value, reference.location)
        case Sequence():
            return Sequence(value.items, reference.location)
        case Mapping():
            return Mapping(value.entries, value.keys, reference.location)


def params_of(node: Node | None, faults: FaultList) -> Mapping | None:
    """Returns the ``params`` mapping, or None. A value of another type adds a fault."""
    if node is None or isinstance(node, Mapping):
        return node
    faults.add(node.location, f"params must be a mapping such as {{outcomes: [success, fail]}}, found {kind_of(node)}")
    return None
