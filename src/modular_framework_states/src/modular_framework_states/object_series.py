# SPDX-License-Identifier: BSD-3-Clause
"""Finds the numbered objects of the planning scene, such as the blocks of a tower."""

from __future__ import annotations

from collections.abc import Iterable

from modular_framework_core.managers.acm import LINK_SEPARATOR
from modular_framework_core.managers.ros_simulated_objects import planning_scene_objects
from modular_framework_ros.allowed_names import listing

SERVICE_TIMEOUT_S = 10.0


class SeriesError(ValueError):
    """The numbered objects are incomplete; the text states what was found and what is allowed."""


def scene_objects() -> list[str]:
    """Returns the names of the objects of the planning scene, of models without their links.

    Raises:
        CallError: move_group does not respond.
    """
    return sorted({name.partition(LINK_SEPARATOR)[0] for name in planning_scene_objects(SERVICE_TIMEOUT_S)})


def object_series(prefix: str, names: Iterable[str]) -> list[str]:
    """Returns the objects ``<prefix>_1``, ``<prefix>_2``, ... in the order of their numbers.

    Args:
        prefix: Common part of the names.
        names: Names of all objects.

    Raises:
        SeriesError: There are fewer than two, or a number is missing.
    """
    present = set(names)
    stem = f"{prefix}_"
    numbers = sorted(
        int(number_text)
        for name in present
        if (number_text := name.removeprefix(stem)) != name and number_text.isdecimal()
    )
    if len(numbers) < 2 or numbers != list(range(1, len(numbers) + 1)):
        numbered = ", ".join(f"{stem}{number}" for number in numbers) or "none"
        raise SeriesError(
            f"the planning scene has these objects of '{prefix}': {numbered}; a tower needs {stem}1, {stem}2, ... "
            f"without a gap; {listing(sorted(present), 'the planning scene has no objects')}"
        )
    return [f"{stem}{number}" for number in numbers]
