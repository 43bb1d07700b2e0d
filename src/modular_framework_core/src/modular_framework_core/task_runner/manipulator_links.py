# SPDX-License-Identifier: BSD-3-Clause
"""Finds the links of the manipulator by their names."""

from __future__ import annotations

from collections.abc import Sequence


def manipulator_links(link_names: Sequence[str], prefix: str) -> list[int]:
    """Returns the indices of the manipulator's links.

    Args:
        link_names: Link names.
        prefix: Texts separated by spaces. A link whose name contains one of the texts belongs to the manipulator.
    """
    texts = prefix.split()
    return [index for index, name in enumerate(link_names) if any(text in name for text in texts)]
