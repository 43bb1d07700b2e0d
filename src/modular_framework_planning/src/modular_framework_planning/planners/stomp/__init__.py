# SPDX-License-Identifier: BSD-3-Clause
"""The planning pipeline `stomp`: stochastic optimisation of whole motions."""
from modular_framework_planning.planners.stomp.planner import StompPlanner

__all__ = ["StompPlanner"]
