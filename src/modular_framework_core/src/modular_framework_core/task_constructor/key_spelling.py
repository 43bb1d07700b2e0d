# SPDX-License-Identifier: BSD-3-Clause
"""Reports unknown keys and corrects misspelt keys.

After ``sorce`` is reported, its value is read as ``source``. The mistake then counts as one fault without a second
report of a missing key, and the checks of the value still run.
"""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable

from modular_framework_core.files.faults import FaultList
from modular_framework_core.files.located_yaml import Mapping, Node

MIN_SIMILARITY = 0.75
"""Minimum similarity of a misspelt key to the intended key, 0 to 1."""


def intended_key(misspelt: str, missing: Iterable[str]) -> str | None:
    """Returns the missing key most similar to a misspelt key, or None if no key is similar."""
    matches = difflib.get_close_matches(misspelt, list(missing), n=1, cutoff=MIN_SIMILARITY)
    return matches[0] if matches else None


def value_of(node: Mapping, key: str) -> Node | None:
    """Returns the value of a key or, if the key is missing, of a misspelling of the key."""
    if key in node.entries:
        return node.entries[key]
    return next((value for written, value in node.entries.items() if intended_key(written, [key])), None)


def corrected_keys(node: Mapping, known_keys: Collection[str], noun: str, faults: FaultList) -> Mapping:
    """Returns a mapping with known keys only: misspelt keys are corrected, other unknown keys are dropped.

    Args:
        node: Mapping as written.
        known_keys: Allowed keys.
        noun: Noun phrase for a key, for messages.
        faults: Receives a fault for each unknown key.
    """
    entries = {key: value for key, value in node.entries.items() if key in known_keys}
    keys = {key: node.keys[key] for key in entries}
    for key, value in node.entries.items():
        if key in known_keys:
            continue
        faults.add_unknown(node.keys[key], noun, key, known_keys, used=entries)
        intended = intended_key(key, [name for name in known_keys if name not in entries])
        if intended is not None:
            entries[intended], keys[intended] = value, node.keys[key]
            faults.harmless += 1
    return Mapping(entries, keys, node.location)


def renamed_key(node: Mapping, old: str, new: str) -> Mapping:
    """Returns the mapping with an old key under its new name, unless both are present.

    Args:
        node: Mapping as written.
        old: Former name of the key, which files may still use.
        new: Name of the key.
    """
    if new in node.entries:
        return node
    names = {key: new if key == old else key for key in node.entries}
    return Mapping(
        {names[key]: value for key, value in node.entries.items()},
        {names[key]: location for key, location in node.keys.items()},
        node.location,
    )
