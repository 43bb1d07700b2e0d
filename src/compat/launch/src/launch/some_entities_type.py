# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the type of one or several entities."""

from launch.core.some_entities_type import SomeEntitiesType as SomeEntitiesType
from launch.core.some_entities_type import SomeEntitiesType_types_tuple as SomeEntitiesType_types_tuple
