# SPDX-License-Identifier: BSD-3-Clause
"""Reads the initial joint positions of a simulated robot, in the syntax of spawn_model."""

from __future__ import annotations

import math

from modular_framework_simulation.errors import DescriptionError


def parse_starting_pose(text: str) -> dict[str, float]:
    """Parses "-J joint value -J joint value ...".

    Args:
        text: Arguments; empty for no positions.

    Returns:
        Positions by joint name [rad or m].

    Raises:
        DescriptionError: The arguments are not groups of -J, joint and finite number, or a joint occurs twice.
    """
    words = text.split()
    positions: dict[str, float] = {}
    for start in range(0, len(words), 3):
        triple = words[start : start + 3]
        location = f"starting pose, word {start + 1}"
        if len(triple) != 3 or triple[0] != "-J":
            raise DescriptionError(location, f"got '{' '.join(triple)}'", "expected '-J <joint> <value>', repeated")
        try:
            value = float(triple[2])
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise DescriptionError(location, f"got the value '{triple[2]}'", "expected a finite number [rad or m]")
        if triple[1] in positions:
            raise DescriptionError(location, f"names joint '{triple[1]}' again", "give each joint once")
        positions[triple[1]] = value
    return positions
