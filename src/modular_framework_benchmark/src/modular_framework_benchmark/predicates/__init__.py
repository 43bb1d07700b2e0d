# SPDX-License-Identifier: BSD-3-Clause
"""Predicates on the world: success criteria and milestones of a task."""
