# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the type of texts with substitutions."""

from launch.core.some_substitutions_type import SomeSubstitutionsType as SomeSubstitutionsType
from launch.core.some_substitutions_type import SomeSubstitutionsType_types_tuple as SomeSubstitutionsType_types_tuple
