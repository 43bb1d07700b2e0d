# SPDX-License-Identifier: BSD-3-Clause
"""Joint trajectories: interpolation, goal validation, tolerances, limits, and stop motions."""
