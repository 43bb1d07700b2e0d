# SPDX-License-Identifier: BSD-3-Clause
"""What may stand where a text is wanted: a text, a substitution, or several of them that are joined."""

from __future__ import annotations

from collections.abc import Iterable

from launch.core.substitution import Substitution

SomeSubstitutionsType = str | Substitution | Iterable[str | Substitution]
SomeSubstitutionsType_types_tuple = (str, Substitution, Iterable)
