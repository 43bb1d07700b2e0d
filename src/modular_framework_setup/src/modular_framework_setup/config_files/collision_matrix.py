# SPDX-License-Identifier: BSD-3-Clause
"""Replaces the collision matrix in an SRDF text and keeps all other text."""

from __future__ import annotations

import re
from collections.abc import Mapping

REASONS = ("Adjacent", "Default", "Always", "Never")
"""Computed reasons; a pair with any other reason was added by the user."""
AUTHOR_MARK = "compute_self_collisions"
"""Mark in the comment above a computed matrix."""
_COMMENT_OR_PAIR = re.compile(
    r"[ \t]*(?:<!--(?P<comment>.*?)-->|<disable_collisions\b[^>]*?(?:/>|>.*?</disable_collisions\s*>))[ \t]*\n?", re.S
)
_END = re.compile(r"[ \t]*</robot\s*>\s*\Z")


class MatrixError(Exception):
    """A matrix cannot be inserted into an SRDF."""


def matrix_text(disabled: Mapping[tuple[str, str], str]) -> str:
    """Returns the elements of a matrix, one per line.

    Args:
        disabled: Reason of each pair of links without collision check.
    """
    return "".join(
        f'  <disable_collisions link1="{first}" link2="{second}" reason="{reason}"/>\n'
        for (first, second), reason in sorted(disabled.items())
    )


def with_matrix(srdf: str, disabled: Mapping[tuple[str, str], str], origin: str) -> str:
    """Returns an SRDF with a new matrix, which replaces an existing matrix or is appended.

    Args:
        srdf: SRDF text.
        disabled: Reason of each pair of links without collision check.
        origin: Origin of the matrix, for the comment above it.

    Raises:
        MatrixError: The SRDF has neither a matrix nor a closing `</robot>` tag.
    """
    block = f"  <!-- Written by {AUTHOR_MARK}: {origin}. -->\n{matrix_text(disabled)}"
    old = [
        match
        for match in _COMMENT_OR_PAIR.finditer(srdf)
        if match["comment"] is None or AUTHOR_MARK in match["comment"]
    ]
    if not old:
        end = _END.search(srdf)
        if end is None:
            raise MatrixError("the SRDF has no closing </robot> tag; add it")
        return f"{srdf[: end.start()]}{block}{srdf[end.start() :]}"
    parts, position = [], 0
    for match in old:
        parts.append(srdf[position : match.start()])
        position = match.end()
    before, *between = [*parts, srdf[position:]]
    return f"{before}{block}{''.join(between)}"
