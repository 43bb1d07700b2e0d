# SPDX-License-Identifier: BSD-3-Clause
"""Notes unknown keys, and reads a misspelt one as the key that was meant.

One mistake is one fault: once ``sorce`` is noted, its value is read as that of ``source``, so that no missing key is
reported as well, and all other faults are found too.
"""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable

from modular_framework_core.files.faults import FaultList
from modular_framework_core.files.located_yaml import Mapping, Node

SIMILAR = 0.75
"""A key stands for one that is not given when it is this similar to it (0 to 1)."""


def meant_key(found: str, missing: Iterable[str]) -> str | None:
    """Returns which of the keys that are not given a misspelt key stands for; None when it is like none of them."""
    matches = difflib.get_close_matches(found, list(missing), n=1, cutoff=SIMILAR)
    return matches[0] if matches else None


def value_of(node: Mapping, key: str) -> Node | None:
    """Returns the value of a key, or, where that is not given, of the key that is spelt nearly like it."""
    if key in node.entries:
        return node.entries[key]
    return next((value for found, value in node.entries.items() if meant_key(found, [key])), None)


def spelt_as_meant(node: Mapping, known: Collection[str], what: str, faults: FaultList) -> Mapping:
    """Returns a mapping that has known keys only.

    Args:
        node: The mapping as written.
        known: The keys it may have.
        what: What its keys are, for messages.
        faults: Where each unknown key is noted.

    Returns:
        The mapping; a key that is spelt nearly like one that is not given has become that one, others that are unknown
        are left out.
    """
    entries = {key: value for key, value in node.entries.items() if key in known}
    keys = {key: node.keys[key] for key in entries}
    for key, value in node.entries.items():
        if key in known:
            continue
        faults.add_unknown(node.keys[key], what, key, known, given=entries)
        meant = meant_key(key, [name for name in known if name not in entries])
        if meant is not None:
            entries[meant], keys[meant] = value, node.keys[key]
            faults.harmless += 1
    return Mapping(entries, keys, node.location)
