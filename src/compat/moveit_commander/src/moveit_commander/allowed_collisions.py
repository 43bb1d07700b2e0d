# SPDX-License-Identifier: BSD-3-Clause
"""Gives moveit_msgs/AllowedCollisionMatrix its methods set_default and set_allowed, as the public library does."""

from __future__ import annotations

from moveit_msgs.msg import AllowedCollisionEntry, AllowedCollisionMatrix

from moveit_commander.exception import MoveItCommanderException


def set_default(acm: AllowedCollisionMatrix, obj: str, allow: bool) -> None:
    """Returns whether an object may touch everything that has no entry of its own with it."""
    if obj in acm.default_entry_names:
        acm.default_entry_values[acm.default_entry_names.index(obj)] = allow
    else:
        acm.default_entry_names = [*acm.default_entry_names, obj]
        acm.default_entry_values = [*acm.default_entry_values, allow]


def set_allowed(acm: AllowedCollisionMatrix, obj: str, other: str | None = None, allow: bool = True) -> None:
    """Returns whether two objects or links may touch; without `other`: the object's default.

    Raises:
        MoveItCommanderException: `other` has no entry in the acm.
    """
    if other is None:
        set_default(acm, obj, allow)
        return
    if other not in acm.entry_names:
        raise MoveItCommanderException(
            f"collision matrix: '{other}' has no entry; those there are: {', '.join(acm.entry_names)}"
        )
    if obj not in acm.entry_names:
        _add_entry(acm, obj)
    first, second = acm.entry_names.index(obj), acm.entry_names.index(other)
    for row, column in ((first, second), (second, first)):
        enabled = list(acm.entry_values[row].enabled)
        enabled[column] = allow
        acm.entry_values[row].enabled = enabled


def _add_entry(acm: AllowedCollisionMatrix, obj: str) -> None:
    """Returns a row and a column for an object, filled with the defaults in force."""
    defaults = dict(zip(acm.default_entry_names, acm.default_entry_values, strict=True))
    row = [bool(defaults.get(obj, defaults.get(name, False))) for name in acm.entry_names]
    for entry, enabled in zip(acm.entry_values, row, strict=True):
        entry.enabled = [*entry.enabled, enabled]
    acm.entry_names = [*acm.entry_names, obj]
    acm.entry_values = [*acm.entry_values, AllowedCollisionEntry([*row, False])]


AllowedCollisionMatrix.set_default = set_default
AllowedCollisionMatrix.set_allowed = set_allowed
