# SPDX-License-Identifier: BSD-3-Clause
"""Finds the links of the manipulator by texts in their names."""

from __future__ import annotations

from collections.abc import Sequence


def manipulator_links(link_names: Sequence[str], prefix: str) -> list[int]:
    """Returns the indices of the manipulator's links.

    Args:
        link_names: Names of links.
        prefix: Texts separated by spaces; a link belongs to the manipulator if its name contains one of them.
    """
    texts = prefix.split()
    return [index for index, name in enumerate(link_names) if any(text in name for text in texts)]
