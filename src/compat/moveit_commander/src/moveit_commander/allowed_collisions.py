# SPDX-License-Identifier: BSD-3-Clause
"""Adds the methods set_default and set_allowed of the public library to moveit_msgs/AllowedCollisionMatrix."""

from __future__ import annotations

from moveit_msgs.msg import AllowedCollisionEntry, AllowedCollisionMatrix

from moveit_commander.exception import MoveItCommanderException


def set_default(acm: AllowedCollisionMatrix, obj: str, allow: bool) -> None:
    """Sets whether an object may touch everything without an entry for the pair.

    Args:
        acm: Matrix to change.
        obj: Name of the object.
        allow: Whether contact is allowed.
    """
    if obj in acm.default_entry_names:
        acm.default_entry_values[acm.default_entry_names.index(obj)] = allow
    else:
        acm.default_entry_names = [*acm.default_entry_names, obj]
        acm.default_entry_values = [*acm.default_entry_values, allow]


def set_allowed(acm: AllowedCollisionMatrix, obj: str, other: str | None = None, allow: bool = True) -> None:
    """Sets whether two objects or links may touch.

    Args:
        acm: Matrix to change.
        obj: Name of an object or link.
        other: Name of the other object or link; None for the default of `obj`.
        allow: Whether contact is allowed.

    Raises:
        MoveItCommanderException: The matrix has no entry for `other`.
    """
    if other is None:
        set_default(acm, obj, allow)
        return
    if other not in acm.entry_names:
        raise MoveItCommanderException(
            f"collision matrix: '{other}' has no entry; the entries are: {', '.join(acm.entry_names)}"
        )
    if obj not in acm.entry_names:
        _add_entry(acm, obj)
    first, second = acm.entry_names.index(obj), acm.entry_names.index(other)
    for row, column in ((first, second), (second, first)):
        enabled = list(acm.entry_values[row].enabled)
        enabled[column] = allow
        acm.entry_values[row].enabled = enabled


def _add_entry(acm: AllowedCollisionMatrix, obj: str) -> None:
    """Adds a row and a column for an object, filled with the default entries."""
    defaults = dict(zip(acm.default_entry_names, acm.default_entry_values, strict=True))
    row = [bool(defaults.get(obj, defaults.get(name, False))) for name in acm.entry_names]
    for entry, enabled in zip(acm.entry_values, row, strict=True):
        entry.enabled = [*entry.enabled, enabled]
    acm.entry_names = [*acm.entry_names, obj]
    acm.entry_values = [*acm.entry_values, AllowedCollisionEntry([*row, False])]


AllowedCollisionMatrix.set_default = set_default
AllowedCollisionMatrix.set_allowed = set_allowed
