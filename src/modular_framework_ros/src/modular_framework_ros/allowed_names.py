# SPDX-License-Identifier: BSD-3-Clause
"""Text for error messages about unknown names: the allowed names and the most similar name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

MAX_NAME_LENGTH = 100
"""Longer names get no suggestion, which would take a time that grows with the square of their length."""
MISSPELLING_RATIO = 0.85
"""Similarity of a misspelling: a wrong, missing or additional letter in a word of seven letters."""


def listing(allowed: Iterable[str], empty: str = "none is allowed here") -> str:
    """Returns the allowed names as ``allowed: a, b``, or ``empty`` if there are none."""
    names = list(dict.fromkeys(allowed))
    return f"allowed: {', '.join(names)}" if names else empty


def closest(unknown: str, allowed: Iterable[str]) -> str | None:
    """Returns the allowed name that is closest to a name or contains it, or None."""
    lowered = str(unknown).lower()
    if len(lowered) > MAX_NAME_LENGTH:
        return None
    by_lower = {text.lower(): text for text in map(str, allowed) if len(text) <= MAX_NAME_LENGTH}
    matches = difflib.get_close_matches(lowered, list(by_lower), n=1, cutoff=0.65)
    if not matches and len(lowered) >= 3:
        matches = [name for name in by_lower if lowered in name or (len(name) >= 3 and name in lowered)][:1]
    return by_lower[matches[0]] if matches else None


def misspelling(text: str, name: str) -> bool:
    """Returns whether a text is probably a misspelling of a name, so that the text is no name of something else."""
    return bool(difflib.get_close_matches(text.lower(), [name.lower()], cutoff=MISSPELLING_RATIO))


def nearest(unknown: str, allowed: Iterable[str]) -> str:
    """Returns ``; did you mean 'x'?`` for the closest allowed name, or ""."""
    name = closest(unknown, allowed)
    return f"; did you mean '{name}'?" if name is not None else ""
