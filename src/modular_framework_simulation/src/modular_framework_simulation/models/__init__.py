# SPDX-License-Identifier: BSD-3-Clause
"""Worlds, models and robots as their files describe them: plain values, without the physics engine."""
