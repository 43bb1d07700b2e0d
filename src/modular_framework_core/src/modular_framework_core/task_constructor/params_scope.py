# SPDX-License-Identifier: BSD-3-Clause
"""``params``: values written once in the header of a machine (or in a state) and used as ``params.<key>`` below it.

The params of a machine are seen by everything inside it, at any depth. A ``params`` further inside hides the outer
one key by key. A reference is a text that is exactly ``params.<key>``; it may stand wherever a value may: as an
option, in a list, in a mapping, in the header of a nested machine.
"""

from __future__ import annotations

import difflib

from modular_framework_core.files.faults import FaultList, SourceLocation, listing, nearest
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence, kind_of

PREFIX = "params."
MISSPELT = 0.75
"""A text counts as a misspelt reference when what is before its point is this similar to ``params`` (0 to 1)."""


class ParamsScope:
    """The params that are visible at one location of a task."""

    def __init__(self, visible: dict[str, Node] | None = None) -> None:
        self._visible = dict(visible or {})
        self.used: set[str] = set()

    def inner(self, params: Mapping | None, faults: FaultList) -> ParamsScope:
        """Returns the scope inside a machine or state that declares ``params``; its values may refer to outer ones."""
        own = {} if params is None else {key: self.resolve(value, faults) for key, value in params.entries.items()}
        return ParamsScope({**self._visible, **own})

    def resolve(self, node: Node, faults: FaultList) -> Node:
        """Replaces every reference in a value; a reference to nothing is noted as a fault and left as it is."""
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
        if key in self._visible and difflib.SequenceMatcher(None, f"{word.lower()}.", PREFIX).ratio() > MISSPELT:
            faults.add_cause(location, f"'{text}' would be taken as text; did you mean '{PREFIX}{key}'?")
            self.used.add(key)

    def _look_up(self, node: Scalar, key: str, faults: FaultList) -> Node:
        found = self._visible.get(key)
        if found is None:
            faults.add_cause(
                node.location,
                f"'{PREFIX}{key}' refers to nothing: no params around it has the key '{key}'; "
                f"{listing(self._visible, 'there are no params around it')}{nearest(key, self._visible)}",
            )
            return node
        self.used.add(key)
        return _moved(found, node)


def _moved(found: Node, reference: Node) -> Node:
    """Returns a value with the location of the reference to it, where a user looks for a mistake."""
    match found:
        case Scalar():
            return Scalar(found.value, reference.location)
        case Sequence():
            return Sequence(found.items, reference.location)
        case Mapping():
            return Mapping(found.entries, found.keys, reference.location)


def params_of(node: Node | None, faults: FaultList) -> Mapping | None:
    """Returns a ``params`` value when it is a mapping; notes a fault when it is something else."""
    if node is None or isinstance(node, Mapping):
        return node
    faults.add(node.location, f"params must be a mapping such as {{outcomes: [success, fail]}}, found {kind_of(node)}")
    return None
