# SPDX-License-Identifier: BSD-3-Clause
"""The adapter of config packages that ask for MoveIt's spline timing."""

from __future__ import annotations

from modular_framework_planning.planning_pipeline.adapters.add_time_optimal_parameterization import (
    AddTimeOptimalParameterization,
)


class AddIterativeSplineParameterization(AddTimeOptimalParameterization):
    """Times a path by TOPP-RA too: it never needs longer than an iteration over splines, and keeps the same limits."""
