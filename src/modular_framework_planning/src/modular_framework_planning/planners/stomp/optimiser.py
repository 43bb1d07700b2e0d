# SPDX-License-Identifier: BSD-3-Clause
"""STOMP: improves a motion by noisy copies of it, weighted by their costs, smoothed by the cost of accelerations.

Source: M. Kalakrishnan, S. Chitta, E. Theodorou, P. Pastor, S. Schaal, "STOMP: Stochastic Trajectory Optimization for
Motion Planning", ICRA 2011. Besides the weighted average, the cheapest copy itself may become the next motion.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planners.stomp.settings import StompSettings

CostFunction = Callable[[Array], Array]


class Optimiser:
    """The matrices of one number of time steps; start and goal of a motion stay fixed.

    A motion is an array (steps, joints); costs of its states have shape (steps,).
    """

    def __init__(self, settings: StompSettings, lower: Array, upper: Array, rng: np.random.Generator) -> None:
        """Computes the matrices.

        Args:
            settings: of the planner.
            lower: bounds of the joints, shape (joints,) [rad or m].
            upper: bounds of the joints, shape (joints,) [rad or m].
            rng: source of the noise.
        """
        self._settings, self._lower, self._upper, self._rng = settings, lower, upper, rng
        inner = settings.num_timesteps - 2
        differences = np.zeros((inner + 2, inner))  # second differences of a motion whose ends do not move
        for column in range(inner):
            differences[column : column + 3, column] = 1.0, -2.0, 1.0
        inverse = np.linalg.inv(differences.T @ differences)
        self._noise = np.linalg.cholesky(inverse / inverse.max())
        self._smoothing = inverse / (inverse.max(axis=0) * inner)

    def line(self, start: Array, goal: Array) -> Array:
        """Returns the straight motion."""
        return np.linspace(start, goal, self._settings.num_timesteps)

    def disturbed(self, motion: Array, stddev: Array | float) -> Array:
        """Returns noisy copies of a motion within the bounds: one for each value, shape (n, steps, joints)."""
        sizes = np.atleast_1d(stddev)
        white = self._rng.standard_normal((len(sizes), len(self._noise), motion.shape[1]))
        copies = np.repeat(motion[None], len(sizes), axis=0)
        copies[:, 1:-1] += np.einsum("ij,njk->nik", self._noise, white) * sizes[:, None, None]
        return np.clip(copies, np.minimum(self._lower, motion.min(axis=0)), np.maximum(self._upper, motion.max(axis=0)))

    def costs(self, motions: Array, state_costs: CostFunction) -> Array:
        """Returns costs of the states of some motions (n, steps, joints), shape (n, steps)."""
        count, steps, joints = motions.shape
        settings = self._settings
        accelerations = np.zeros_like(motions)
        accelerations[:, 1:-1] = np.diff(motions, 2, axis=1) / settings.delta_t**2
        control = 0.5 * settings.control_cost_weight * settings.delta_t * (accelerations**2).sum(axis=2)
        return state_costs(motions.reshape(-1, joints)).reshape(count, steps) + control

    def update(self, motion: Array, copies: Array, costs: Array) -> Array:
        """Returns the motion moved towards the cheaper copies, at each time step for itself, then smoothed."""
        low, high = costs.min(axis=0), costs.max(axis=0)
        weights = np.exp(-self._settings.exponentiated_cost_sensitivity * (costs - low) / np.maximum(high - low, 1e-9))
        weights /= weights.sum(axis=0)
        change = np.einsum("nt,ntj->tj", weights, copies - motion)
        result = motion.copy()
        result[1:-1] += self._smoothing @ change[1:-1]
        return np.clip(result, np.minimum(self._lower, motion.min(axis=0)), np.maximum(self._upper, motion.max(axis=0)))
