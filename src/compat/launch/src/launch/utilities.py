# SPDX-License-Identifier: BSD-3-Clause
"""Public names of functions that normalize arguments of actions."""

from __future__ import annotations

from launch.core.utilities import (
    ensure_argument_type,
    is_a,
    is_a_subclass,
    normalize_to_list_of_entities,
    normalize_to_list_of_substitutions,
    perform_boolean,
    perform_number,
    perform_substitutions,
    perform_text,
)

__all__ = [
    "ensure_argument_type",
    "is_a",
    "is_a_subclass",
    "normalize_to_list_of_entities",
    "normalize_to_list_of_substitutions",
    "perform_boolean",
    "perform_number",
    "perform_substitutions",
    "perform_text",
]
