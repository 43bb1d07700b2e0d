# SPDX-License-Identifier: BSD-3-Clause
"""Replacement of MoveIt's adapter for iterative spline parameterization."""

from __future__ import annotations

from modular_framework_planning.planning_pipeline.adapters.add_time_optimal_parameterization import (
    AddTimeOptimalParameterization,
)


class AddIterativeSplineParameterization(AddTimeOptimalParameterization):
    """Uses TOPP-RA, which satisfies the same limits as iterative splines and is never slower."""
