# SPDX-License-Identifier: BSD-3-Clause
"""Public names of functions that normalize arguments of actions."""

from launch.core.utilities import ensure_argument_type as ensure_argument_type
from launch.core.utilities import is_a as is_a
from launch.core.utilities import is_a_subclass as is_a_subclass
from launch.core.utilities import normalize_to_list_of_entities as normalize_to_list_of_entities
from launch.core.utilities import normalize_to_list_of_substitutions as normalize_to_list_of_substitutions
from launch.core.utilities import perform_boolean as perform_boolean
from launch.core.utilities import perform_number as perform_number
from launch.core.utilities import perform_substitutions as perform_substitutions
from launch.core.utilities import perform_text as perform_text
