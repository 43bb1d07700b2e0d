# SPDX-License-Identifier: BSD-3-Clause
"""Path shortening with edge checks at the step of the final validation."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.planner_interface import PlanningProblem
from modular_framework_planning.trajectory_processing.path_shortening import shorten


def shorten_path(problem: PlanningProblem, path: Array, deadline: float, rng: np.random.Generator | None) -> Array:
    """Returns a path with the same ends that is not longer.

    Args:
        problem: Planning problem with collision checks and path constraints.
        path: Path vertices, shape (n, joints).
        deadline: Monotonic time at which to stop [s].
        rng: Random generator; None to only remove vertices.
    """
    fine = problem.settings.finest_step
    return shorten(path, lambda first, second: problem.edge_is_valid(first, second, fine), deadline, rng)
