# SPDX-License-Identifier: BSD-3-Clause
"""Replaces the collision matrix in the text of an SRDF; everything else in it stays as it is."""

from __future__ import annotations

import re
from collections.abc import Mapping

REASONS = ("Adjacent", "Default", "Always", "Never")
"""Reasons that are computed; a pair with another one was entered by a person."""
MARK = "compute_self_collisions"
"""In the comment above a computed matrix."""
_COMMENT_OR_PAIR = re.compile(
    r"[ \t]*(?:<!--(?P<comment>.*?)-->|<disable_collisions\b[^>]*?(?:/>|>.*?</disable_collisions\s*>))[ \t]*\n?", re.S
)
_END = re.compile(r"[ \t]*</robot\s*>\s*\Z")


class MatrixError(Exception):
    """The text has no place for a matrix."""


def matrix_text(disabled: Mapping[tuple[str, str], str]) -> str:
    """Returns the elements of a matrix, one a line.

    Args:
        disabled: the reason for each pair of links that needs no check.
    """
    return "".join(
        f'  <disable_collisions link1="{one}" link2="{other}" reason="{reason}"/>\n'
        for (one, other), reason in sorted(disabled.items())
    )


def with_matrix(srdf: str, disabled: Mapping[tuple[str, str], str], made: str) -> str:
    """Returns an SRDF with another matrix, in the place of the one it has, or at its end.

    Args:
        srdf: its text.
        disabled: the reason for each pair of links that needs no check.
        made: how the matrix was made, for the comment above it.

    Raises:
        MatrixError: there is no matrix, and no end tag of `<robot>`.
    """
    block = f"  <!-- Written by {MARK}: {made}. -->\n{matrix_text(disabled)}"
    old = [match for match in _COMMENT_OR_PAIR.finditer(srdf) if match["comment"] is None or MARK in match["comment"]]
    if not old:
        end = _END.search(srdf)
        if end is None:
            raise MatrixError("no </robot> at its end, before which the matrix would stand; write one")
        return f"{srdf[: end.start()]}{block}{srdf[end.start() :]}"
    parts, position = [], 0
    for match in old:
        parts.append(srdf[position : match.start()])
        position = match.end()
    before, *between = [*parts, srdf[position:]]
    return f"{before}{block}{''.join(between)}"
