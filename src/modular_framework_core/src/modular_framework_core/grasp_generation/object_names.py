# SPDX-License-Identifier: BSD-3-Clause
"""Compares names of models with ids of collision objects."""

from __future__ import annotations


def is_named(object_id: str, wanted: str) -> bool:
    """Returns whether an object id belongs to a model, or is the id itself; an empty name matches all."""
    return not wanted or object_id == wanted or object_id.startswith(f"{wanted}__")
