# SPDX-License-Identifier: BSD-3-Clause
"""Replacement of MoveIt's adapter for iterative parabolic time parameterization."""

from __future__ import annotations

from modular_framework_planning.planning_pipeline.adapters.add_time_optimal_parameterization import (
    AddTimeOptimalParameterization,
)


class AddTimeParameterization(AddTimeOptimalParameterization):
    """Uses TOPP-RA, which avoids the acceleration jumps of parabolic time parameterization."""
