# SPDX-License-Identifier: BSD-3-Clause
"""STOMP update: moves a trajectory towards its cheaper noisy copies and smooths the change.

Source: M. Kalakrishnan, S. Chitta, E. Theodorou, P. Pastor, S. Schaal, "STOMP: Stochastic Trajectory Optimization for
Motion Planning", ICRA 2011. In addition, the planner can continue from the cheapest copy instead of the average.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planners.stomp.settings import StompSettings

CostFunction = Callable[[Array], Array]


class Optimiser:
    """Noise, cost and update of motions with a fixed number of time steps, fixed start and fixed goal.

    A motion is an array (steps, joints); the costs of its states have shape (steps,).
    """

    def __init__(self, settings: StompSettings, lower: Array, upper: Array, rng: np.random.Generator) -> None:
        """Computes the noise and smoothing matrices.

        Args:
            settings: Planner settings.
            lower: Lower joint bounds, shape (joints,) [rad or m].
            upper: Upper joint bounds, shape (joints,) [rad or m].
            rng: Random generator of the noise.
        """
        self._settings, self._lower, self._upper, self._rng = settings, lower, upper, rng
        inner_steps = settings.num_timesteps - 2
        differences = np.zeros((inner_steps + 2, inner_steps))  # finite-difference matrix of the accelerations
        for column in range(inner_steps):
            differences[column : column + 3, column] = 1.0, -2.0, 1.0
        inverse = np.linalg.inv(differences.T @ differences)
        self._noise = np.linalg.cholesky(inverse / inverse.max())
        self._smoothing = inverse / (inverse.max(axis=0) * inner_steps)

    def line(self, start: Array, goal: Array) -> Array:
        """Returns the straight motion from start to goal."""
        return np.linspace(start, goal, self._settings.num_timesteps)

    def noisy_copies(self, motion: Array, stddev: Array | float) -> Array:
        """Returns a noisy copy of a motion per standard deviation, within the bounds, shape (n, steps, joints)."""
        stddevs = np.atleast_1d(stddev)
        white = self._rng.standard_normal((len(stddevs), len(self._noise), motion.shape[1]))
        copies = np.repeat(motion[None], len(stddevs), axis=0)
        copies[:, 1:-1] += np.einsum("ij,njk->nik", self._noise, white) * stddevs[:, None, None]
        return np.clip(copies, np.minimum(self._lower, motion.min(axis=0)), np.maximum(self._upper, motion.max(axis=0)))

    def costs(self, motions: Array, state_costs: CostFunction) -> Array:
        """Returns the costs of the states of motions (n, steps, joints), shape (n, steps)."""
        count, steps, joints = motions.shape
        settings = self._settings
        accelerations = np.zeros_like(motions)
        accelerations[:, 1:-1] = np.diff(motions, 2, axis=1) / settings.delta_t**2
        control = 0.5 * settings.control_cost_weight * settings.delta_t * (accelerations**2).sum(axis=2)
        return state_costs(motions.reshape(-1, joints)).reshape(count, steps) + control

    def update(self, motion: Array, copies: Array, costs: Array) -> Array:
        """Returns the motion moved towards its cheaper copies and smoothed.

        Args:
            motion: Current motion, shape (steps, joints) [rad or m].
            copies: Noisy copies, shape (n, steps, joints) [rad or m].
            costs: Costs of the copies, shape (n, steps); each time step is weighted separately.
        """
        low, high = costs.min(axis=0), costs.max(axis=0)
        weights = np.exp(-self._settings.exponentiated_cost_sensitivity * (costs - low) / np.maximum(high - low, 1e-9))
        weights /= weights.sum(axis=0)
        change = np.einsum("nt,ntj->tj", weights, copies - motion)
        result = motion.copy()
        result[1:-1] += self._smoothing @ change[1:-1]
        return np.clip(result, np.minimum(self._lower, motion.min(axis=0)), np.maximum(self._upper, motion.max(axis=0)))
