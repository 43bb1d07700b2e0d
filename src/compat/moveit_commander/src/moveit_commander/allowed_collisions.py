# SPDX-License-Identifier: BSD-3-Clause
"""Gives moveit_msgs/AllowedCollisionMatrix its methods set_default and set_allowed, as the public library does."""
from __future__ import annotations

from moveit_msgs.msg import AllowedCollisionEntry, AllowedCollisionMatrix

from moveit_commander.exception import MoveItCommanderException


def set_default(matrix: AllowedCollisionMatrix, obj: str, allow: bool) -> None:
    """Whether an object may touch everything that has no entry of its own with it."""
    if obj in matrix.default_entry_names:
        matrix.default_entry_values[matrix.default_entry_names.index(obj)] = allow
    else:
        matrix.default_entry_names = [*matrix.default_entry_names, obj]
        matrix.default_entry_values = [*matrix.default_entry_values, allow]


def set_allowed(matrix: AllowedCollisionMatrix, obj: str, other: str | None = None, allow: bool = True) -> None:
    """Whether two objects or links may touch; without `other`: the object's default.

    Raises:
        MoveItCommanderException: `other` has no entry in the matrix.
    """
    if other is None:
        set_default(matrix, obj, allow)
        return
    if other not in matrix.entry_names:
        raise MoveItCommanderException(f"collision matrix: '{other}' has no entry; those there are: "
                                       f"{', '.join(matrix.entry_names)}")
    if obj not in matrix.entry_names:
        _add_entry(matrix, obj)
    first, second = matrix.entry_names.index(obj), matrix.entry_names.index(other)
    for row, column in ((first, second), (second, first)):
        enabled = list(matrix.entry_values[row].enabled)
        enabled[column] = allow
        matrix.entry_values[row].enabled = enabled


def _add_entry(matrix: AllowedCollisionMatrix, obj: str) -> None:
    """A row and a column for an object, filled with the defaults in force."""
    defaults = dict(zip(matrix.default_entry_names, matrix.default_entry_values, strict=True))
    row = [bool(defaults.get(obj, defaults.get(name, False))) for name in matrix.entry_names]
    for entry, enabled in zip(matrix.entry_values, row, strict=True):
        entry.enabled = [*entry.enabled, enabled]
    matrix.entry_names = [*matrix.entry_names, obj]
    matrix.entry_values = [*matrix.entry_values, AllowedCollisionEntry([*row, False])]


AllowedCollisionMatrix.set_default = set_default
AllowedCollisionMatrix.set_allowed = set_allowed
