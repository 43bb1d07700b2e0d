# SPDX-License-Identifier: BSD-3-Clause
"""Planners; each planner has its own package."""
