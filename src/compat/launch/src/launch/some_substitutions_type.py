# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the type of texts with substitutions."""

from __future__ import annotations

from launch.core.some_substitutions_type import SomeSubstitutionsType, SomeSubstitutionsType_types_tuple

__all__ = [
    "SomeSubstitutionsType",
    "SomeSubstitutionsType_types_tuple",
]
