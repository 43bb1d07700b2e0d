# SPDX-License-Identifier: BSD-3-Clause
"""Plain values that describe worlds, models and robots, independent of the physics engine."""
