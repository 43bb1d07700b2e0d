# SPDX-License-Identifier: BSD-3-Clause
"""The adapter of config packages that ask for MoveIt's iterative parabolic timing."""

from __future__ import annotations

from modular_framework_planning.planning_pipeline.adapters.add_time_optimal_parameterization import (
    AddTimeOptimalParameterization,
)


class AddTimeParameterization(AddTimeOptimalParameterization):
    """Times a path by TOPP-RA too: parabolic timing has jumps of acceleration at its points, this has none."""
