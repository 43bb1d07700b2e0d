# SPDX-License-Identifier: BSD-3-Clause
"""Type of a text, a substitution, or a sequence of both that is concatenated."""

from __future__ import annotations

from collections.abc import Iterable

from launch.core.substitution import Substitution

SomeSubstitutionsType = str | Substitution | Iterable[str | Substitution]
SomeSubstitutionsType_types_tuple = (str, Substitution, Iterable)
