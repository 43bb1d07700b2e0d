# SPDX-License-Identifier: BSD-3-Clause
"""Matches ids of collision objects with model names."""

from __future__ import annotations


def is_named(object_id: str, name: str) -> bool:
    """Returns whether `name` is the object id or the model of the object; an empty name matches all objects."""
    return not name or object_id == name or object_id.startswith(f"{name}__")
